"""What is still to be run of some sweeps, in what order, and what of it together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from sweeps.engine import estimate
from sweeps.engine.ahead import Ahead
from sweeps.engine.job import Job
from sweeps.engine.together import Together, together, what_is_shared
from sweeps.results import store
from sweeps.sweep import Size, Sweep


def blocks(wanted: int, finished: set[int], per_part: int) -> Iterator[range]:
    """Blocks of consecutive seeds that are still to be run, none across a multiple of `per_part`."""
    seed = 0
    while seed < wanted:
        if seed in finished:
            seed += 1
            continue
        stop = seed + 1
        while stop < wanted and stop % per_part and stop not in finished:
            stop += 1
        yield range(seed, stop)
        seed = stop


def to_do(group: Together, out: Path) -> list[range]:
    """The blocks of seeds that any sweep of a group still lacks.

    Raises:
      ConfigurationMismatch: if there are results of another configuration.
    """
    wanted = group.job.size.seeds
    missing = set().union(*(lacking(member.job, out) for member in group.members))
    return list(blocks(wanted, set(range(wanted)) - missing, group.job.sweep.seeds_per_part))


def lacking(job: Job, out: Path) -> set[int]:
    """The seeds of a job that are still to be run.

    Raises:
      ConfigurationMismatch: if there are results of another configuration.
    """
    folder = out / job.sweep.name
    store.check_folder(folder, job)
    return set(range(job.size.seeds)) - store.finished_seeds(folder)


def plan(sweeps: Sequence[Sweep], size: Size, out: Path) -> list[Together]:
    """What is run of these sweeps and of the source agents that they lack, in order.

    Sweeps that one program serves, and that lack the same seeds, are run together; those that lack none are left out.
    """
    alike: dict[Any, dict[Sweep, Job]] = {}

    def add(job: Job) -> None:
        if seeds := lacking(job, out):
            alike.setdefault((what_is_shared(job.sweep), frozenset(seeds)), {})[job.sweep] = job

    for job in [Job(sweep, size) for sweep in sweeps]:
        if job.source and lacking(job, out):
            add(job.source)
        add(job)
    return [together(tuple(jobs.values())) for jobs in alike.values()]


def expected_seconds(groups: Iterable[Together], out: Path) -> float:
    """What these groups will take, as far as one can tell beforehand."""
    return sum(estimate.block_seconds(g.job, len(seeds)) for g in groups for seeds in to_do(g, out))


def compile_ahead(groups: Iterable[Together], out: Path) -> Ahead:
    """Begins to compile, in threads, what these groups need, in their order; for `run_together`."""
    return Ahead((group.job, todo[0]) for group in groups if (todo := to_do(group, out)))
