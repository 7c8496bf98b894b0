"""How long a sweep takes, before it starts: agents times slots times the cost of a slot, at this machine's pace."""

from __future__ import annotations

from jrcjax.machine import usable_cores
from jrcjax.training import parallel
from sweeps.engine import pace
from sweeps.engine.job import Group, Job

# Core time of one agent in one slot, microseconds, on the machine of the table in docs/explanation/performance.md.
_CORE_US = {"tlwd": 6.5, "dpr": 2.8, "ddqn": 2.8, "q_learning": 0.4, "round_robin": 0.2}


def _seconds_per_slot(group: Group, seeds: int, learners: tuple[str, ...]) -> float:
    agents = parallel.padded(len(group.rows) * seeds)  # whole blocks
    return pace.of_machine().ratio * agents * sum(_CORE_US[name] for name in learners) * 1e-6 / usable_cores()


def seconds_per_episode(job: Job, group: Group, seeds: int) -> float:
    """Seconds for one episode of so many seeds at all points of a group."""
    return job.spec.episode_slots * _seconds_per_slot(group, seeds, job.sweep.learners)


def pretraining_seconds(job: Job, group: Group, seeds: int) -> float:
    """Seconds for TLwD's updates before its first episode."""
    return group.config.pretraining * _seconds_per_slot(group, seeds, tuple({"tlwd"} & set(job.sweep.learners)))


def block_seconds(job: Job, seeds: int) -> float:
    """Seconds for so many seeds at all points, from start to end."""
    return sum(
        pretraining_seconds(job, group, seeds) + job.size.episodes * seconds_per_episode(job, group, seeds)
        for group in job.groups
    )


def compiling_seconds(job: Job) -> float:
    """Seconds for what a job compiles, if none of it is kept from earlier runs."""
    return len(job.groups) * pace.of_machine().compiling


def in_words(seconds: float) -> str:
    """A duration as a person says it."""
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"
