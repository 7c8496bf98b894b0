"""Runs a sweep block by block with progress for a person, and leaves its results on disk."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import jax
import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from jrcjax.training import Log
from sweeps import store
from sweeps.program import points_of, reference_of, run_block
from sweeps.sweep import Size, Sweep

SEEDS_PER_PART = 16
"""Seeds that share a part file."""


def blocks(wanted: int, finished: set[int]) -> Iterator[range]:
    """Blocks of consecutive seeds that are still to be run, none across a multiple of SEEDS_PER_PART."""
    seed = 0
    while seed < wanted:
        if seed in finished:
            seed += 1
            continue
        stop = seed + 1
        while stop < wanted and stop % SEEDS_PER_PART and stop not in finished:
            stop += 1
        yield range(seed, stop)
        seed = stop


def run_sweep(sweep: Sweep, size: Size, out: Path, console: Console, *, resume: bool) -> Path:
    """Runs what is missing of a sweep.

    Args:
      sweep: what to run.
      size: how much of it.
      out: results go to `out / sweep.name`.
      console: where progress is shown.
      resume: continue in a folder that holds results of the same configuration.

    Returns:
      The folder with the results.

    Raises:
      ValueError: bad sizes, or a folder that already holds results.
    """
    size.check()
    folder = out / sweep.name
    store.check_folder(folder, sweep, size)
    finished = store.finished_seeds(folder) if folder.exists() else set()
    if finished and not resume:
        raise ValueError(
            f"{folder} holds results of {len(finished)} seeds already; add --resume, or choose another --out"
        )
    todo = list(blocks(size.seeds, finished))
    if not todo:
        console.print(f"{sweep.name}: all {size.seeds} seeds are there, in {folder}")
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    points = points_of(sweep, size.preset)
    reference = reference_of(points)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as progress:
        total = sum(len(seeds) for seeds in todo) * size.episodes
        task = progress.add_task(f"{sweep.name}: {size.seeds} seeds x {size.episodes} episodes", total=total)
        for seeds in todo:
            logs: list[dict[str, Log]] = []
            for chunk in run_block(sweep, size, points, seeds):
                logs.append(chunk.log)
                progress.advance(task, chunk.episodes * len(seeds))
            whole = jax.tree.map(lambda *parts: np.concatenate(parts, axis=-1), *logs)
            store.write_part(folder, seeds, store.dataset(sweep, size, seeds, whole, reference))
            store.write_manifest(folder, sweep, size)
    return folder
