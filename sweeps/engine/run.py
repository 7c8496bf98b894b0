"""Runs a sweep block by block with progress for a person, and leaves its results on disk."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeAlias

import jax
import numpy as np
import xarray as xr
from rich.console import Console

from jrcjax import files
from jrcjax.learners import Source
from jrcjax.machine import usable_cores
from jrcjax.training.rollout import AgentState, Log
from sweeps import progress
from sweeps.engine import estimate
from sweeps.engine.program import Points, Reference, points_of, reference_of, run_block
from sweeps.engine.sources import missing_sources, sources_of
from sweeps.results import store
from sweeps.results.agents import check_agents, write_agents
from sweeps.sweep import Size, Sweep

Keep: TypeAlias = Callable[[list[dict[str, AgentState]]], Any]
"""What is done with a block's agents before its part is written."""


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


def to_do(sweep: Sweep, size: Size, out: Path) -> list[range]:
    """The blocks of a sweep that are still to be run.

    Raises:
      ConfigurationMismatch: if there are results of another configuration.
    """
    folder = out / sweep.name
    store.check_folder(folder, sweep, size)
    return list(blocks(size.seeds, store.finished_seeds(folder), sweep.seeds_per_part))


def expected_seconds(sweeps: list[Sweep], size: Size, out: Path) -> float:
    """What these sweeps will take, with the source agents that they lack, as far as one can tell beforehand."""
    todo = {sweep: to_do(sweep, size, out) for sweep in sweeps}
    transfers = {(sweep.source, seeds) for sweep in sweeps if sweep.source for seeds in todo[sweep]}
    lacking = {(source, missing_sources(source, size, seeds, out)) for source, seeds in transfers}
    agents = sum(estimate.block_seconds(source, size, len(seeds)) for source, seeds in lacking if seeds)
    return agents + sum(estimate.block_seconds(sweep, size, len(seeds)) for sweep in sweeps for seeds in todo[sweep])


def run_sweep(
    sweep: Sweep,
    size: Size,
    out: Path,
    console: Console,
    *,
    resume: bool,
    save_agents: bool = False,
    client: Any = None,
) -> Path:
    """Runs what is missing of a sweep.

    Args:
      sweep: what to run.
      size: how much of it.
      out: results go to `out / sweep.name`, source agents to the folder of `sweep.source`.
      console: where the expected time and the progress are shown.
      resume: continue in a folder that holds results of the same configuration.
      save_agents: save the trained agents beside the results.
      client: of the Dask cluster that computes (see `sweeps.engine.distributed`); this process if None.

    Returns:
      The folder with the results.

    Raises:
      ValueError: bad sizes, or a folder that already holds results, or holds some without their agents.
      FolderInUse: if another process writes to the folder.
    """
    size.check()
    folder = out / sweep.name
    todo = to_do(sweep, size, out)
    finished = size.seeds - sum(map(len, todo))
    if finished and not resume:
        raise ValueError(f"{folder} holds results of {finished} seeds already; add --resume, or choose another --out")
    if save_agents:
        check_agents(folder, sweep)
    if not todo:
        console.print(f"{sweep.name}: all {size.seeds} seeds are there, in {folder}")
        store.write_manifest(folder)
        return folder
    seconds = expected_seconds([sweep], size, out)
    console.print(_announcement(sweep, size, todo, seconds))
    with files.locked(folder):
        try:
            if client is None:
                _run_blocks(sweep, size, out, console, seconds, save_agents)
            else:
                _run_on_cluster(client, sweep, size, out, console, save_agents)
        except (KeyboardInterrupt, OSError):
            saved = store.in_words(store.finished_seeds(folder))
            held = f"seeds {saved}" if saved else "nothing yet"
            console.print(f"{sweep.name}: stopped; saved in {folder}: {held}", soft_wrap=True)
            raise
    return folder


def _run_blocks(sweep: Sweep, size: Size, out: Path, console: Console, seconds: float, save_agents: bool) -> None:
    """Runs what is missing, as it is now that nobody else writes, and shows the progress of so many seconds."""
    points = points_of(sweep, size.preset)
    reference = reference_of(points, size.episodes)
    with progress.shown(console, sweep.name, seconds) as told:
        for seeds in to_do(sweep, size, out):
            keep = functools.partial(write_agents, out / sweep.name, sweep, size, points, seeds)
            _run_block(sweep, size, points, reference, seeds, out, told, keep if save_agents else None)


def _run_on_cluster(client: Any, sweep: Sweep, size: Size, out: Path, console: Console, save_agents: bool) -> None:
    """The same on a cluster; the progress counts seeds, over all workers."""
    from sweeps.engine import distributed  # which builds upon this module

    todo = to_do(sweep, size, out)
    with progress.shown(console, f"{sweep.name} on a cluster", sum(map(len, todo))) as told:
        for seeds in distributed.run_blocks(client, sweep, size, out, todo, save_agents):
            told(len(seeds))


def _announcement(sweep: Sweep, size: Size, todo: list[range], seconds: float) -> str:
    agents = len(sweep.x_values) * sum(map(len, todo)) * len(sweep.learners)
    return (
        f"{sweep.name}: {agents} agents (points x seeds x learners), {size.episodes} episodes each; expected "
        f"{estimate.in_words(seconds)} with {usable_cores()} cores, and half a minute of compiling"
    )


def _run_block(
    sweep: Sweep,
    size: Size,
    points: Points,
    reference: Reference,
    seeds: range,
    out: Path,
    advance: Callable[[float], None],
    keep: Keep | None = None,
) -> None:
    """Runs one block of seeds and writes its part; `advance` is told how many of the expected seconds are done."""
    source = sources_of(sweep.source, size, seeds, out, advance) if sweep.source else None
    folder = out / sweep.name
    store.add_part(folder, seeds, results_of(sweep, size, points, reference, seeds, source, advance, keep))


def quiet(seconds: float) -> None:
    """An `advance` that shows no progress."""


def results_of(
    sweep: Sweep,
    size: Size,
    points: Points,
    reference: Reference,
    seeds: range,
    source: Source | None,
    advance: Callable[[float], None],
    keep: Keep | None = None,
) -> xr.Dataset:
    """The results of one block of seeds.

    `advance` is told how many of the expected seconds are done, `keep` is given the agents after their last episode.
    """
    groups: list[dict[str, AgentState]] = []
    logs: list[dict[str, Log]] = []
    for chunk in run_block(sweep, size, points, seeds, source):
        if not logs:
            advance(estimate.pretraining_seconds(sweep, size, len(seeds)))
        logs.append(chunk.log)
        groups = chunk.groups
        advance(chunk.episodes * estimate.seconds_per_episode(sweep, size, len(seeds)))
    if keep:
        keep(groups)
    whole = jax.tree.map(lambda *parts: np.concatenate(parts, axis=-1), *logs)
    return store.dataset(sweep, size, seeds, whole, reference)
