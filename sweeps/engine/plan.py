"""What is still to be run of some sweeps, in what order, and what of it together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from sweeps.engine import estimate
from sweeps.engine.ahead import Ahead
from sweeps.engine.bundle import Bundle, bundled, what_is_shared
from sweeps.engine.job import Job
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


def to_do(bundle: Bundle, out: Path) -> list[range]:
    """The blocks of seeds that any sweep of a bundle still lacks.

    Raises:
      ConfigurationMismatch: if there are results of another configuration.
    """
    wanted = bundle.job.size.seeds
    missing = set().union(*(store.lacking(member.job, range(wanted), out) for member in bundle.members))
    return list(blocks(wanted, set(range(wanted)) - missing, bundle.job.sweep.seeds_per_part))


def plan(sweeps: Sequence[Sweep], size: Size, out: Path) -> list[Bundle]:
    """What is run of these sweeps and of the source agents that they lack, in order.

    Sweeps that one program serves, and that lack the same seeds, are run together; those that lack none are left out.
    """
    alike: dict[Any, dict[Sweep, Job]] = {}

    def add(job: Job) -> None:
        if seeds := store.lacking(job, range(size.seeds), out):
            alike.setdefault((what_is_shared(job.sweep), frozenset(seeds)), {})[job.sweep] = job

    for job in [Job(sweep, size) for sweep in sweeps]:
        if job.source and store.lacking(job, range(size.seeds), out):
            add(job.source)
        add(job)
    return [bundled(tuple(jobs.values())) for jobs in alike.values()]


def expected_seconds(bundles: Iterable[Bundle], out: Path) -> float:
    """What these bundles will take, as far as one can tell beforehand."""
    return sum(estimate.block_seconds(bundle.job, len(seeds)) for bundle in bundles for seeds in to_do(bundle, out))


def compile_ahead(bundles: Iterable[Bundle], out: Path) -> Ahead:
    """Begins to compile, in threads, what these bundles need, in their order; for `run_together`."""
    return Ahead((bundle.job, todo[0]) for bundle in bundles if (todo := to_do(bundle, out)))
