"""The source agents of a sweep that transfers: trained once per seed, kept on disk with their demonstrations."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from jrcjax import files
from jrcjax.learners import Source
from sweeps.engine.block import Block, compute, source_in
from sweeps.engine.job import Job
from sweeps.results import store
from sweeps.results.parts import parts_of


def missing_sources(job: Job, seeds: range, out: Path) -> range:
    """Those of the seeds, from the first to the last, whose source agents are still to be trained.

    Args:
      job: what trains them.
      seeds: the seeds.
      out: the folder with the results of all sweeps.

    Raises:
      ConfigurationMismatch: if the folder of the sweep holds agents of another configuration.
    """
    missing = store.lacking(job, seeds, out)
    return range(min(missing), max(missing) + 1) if missing else range(0)


def say_that_it_waits(held: str) -> None:
    """For `files.locked`: of sweeps that share source agents and run at the same time one trains them, others wait."""
    print(f"{held}; waiting for its agents", file=sys.stderr)


def kept_sources(job: Job, seeds: range, out: Path) -> Source:
    """The sources of some seeds from disk, every leaf with leading axes of points and of seeds."""
    parts = [part for part in parts_of(out / job.sweep.name) if set(part.seeds) & set(seeds)]
    return source_in(job, store.joined(parts).sel(seed=list(seeds)))


def sources_of(
    job: Job, seeds: range, out: Path, compute: Callable[[Job, range, Source | None], Block] = compute
) -> Source:
    """The sources of some seeds, from disk where they are there, else trained and kept there.

    Args:
      job: what trains them.
      seeds: the seeds.
      out: the folder with the results of all sweeps.
      compute: `sweeps.engine.block.compute`, or one that shows its progress.

    Returns:
      Weights and demonstrations, every leaf with leading axes of points and of seeds.

    Raises:
      ConfigurationMismatch: if the folder holds agents of another configuration.
    """
    folder = out / job.sweep.name
    if missing_sources(job, seeds, out):
        with files.locked(folder, say_that_it_waits):
            if missing := missing_sources(job, seeds, out):
                store.add_part(folder, missing, compute(job, missing, None).results)
    store.write_manifest(folder)  # which a killed process may not have come to
    return kept_sources(job, seeds, out)
