"""How long a sweep takes, before it starts: its agents and slots times what a slot cost where it was measured."""

from __future__ import annotations

from jrcjax.machine import usable_cores
from jrcjax.training import parallel
from sweeps.preset import slots_of
from sweeps.sweep import Size, Sweep

# Core time of one agent in one slot, microseconds, on the machine of the README's table of speeds.
_CORE_US = {"tlwd": 6.5, "dpr": 2.8, "ddqn": 2.8, "q_learning": 0.4, "round_robin": 0.2}


def _seconds_per_slot(sweep: Sweep, seeds: int, learners: tuple[str, ...]) -> float:
    agents = parallel.padded(len(sweep.x_values) * seeds)  # whole blocks
    return agents * sum(_CORE_US[name] for name in learners) * 1e-6 / usable_cores()


def seconds_per_episode(sweep: Sweep, size: Size, seeds: int) -> float:
    """Seconds for one episode of so many seeds at all points."""
    return slots_of(size.preset) * _seconds_per_slot(sweep, seeds, sweep.learners)


def pretraining_seconds(sweep: Sweep, size: Size, seeds: int) -> float:
    """Seconds for TLwD's updates before its first episode."""
    return size.pretraining * _seconds_per_slot(sweep, seeds, ("tlwd",)) if "tlwd" in sweep.learners else 0.0


def block_seconds(sweep: Sweep, size: Size, seeds: int) -> float:
    """Seconds for so many seeds at all points, from start to end."""
    return pretraining_seconds(sweep, size, seeds) + size.episodes * seconds_per_episode(sweep, size, seeds)


def in_words(seconds: float) -> str:
    """A duration as a person says it."""
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"
