"""Runs a sweep block by block with progress for a person, and leaves its results on disk."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rich.console import Console

from jrcjax import files
from jrcjax.learners import Source
from jrcjax.machine import usable_cores
from sweeps import progress
from sweeps.engine import estimate, pace
from sweeps.engine.ahead import Ahead
from sweeps.engine.block import Block, block_of
from sweeps.engine.job import Job
from sweeps.engine.program import Chunk, advance
from sweeps.engine.sources import missing_sources, sources_of
from sweeps.results import store
from sweeps.results.agents import check_agents, write_agents
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


def to_do(job: Job, out: Path) -> list[range]:
    """The blocks of a job that are still to be run.

    Raises:
      ConfigurationMismatch: if there are results of another configuration.
    """
    folder = out / job.sweep.name
    store.check_folder(folder, job)
    return list(blocks(job.size.seeds, store.finished_seeds(folder), job.sweep.seeds_per_part))


def lacking(sweeps: list[Sweep], size: Size, out: Path) -> list[tuple[Job, range]]:
    """Blocks that these sweeps lack in `out`, as they are run, each behind the source agents that it lacks."""
    found: dict[tuple[Sweep, range], Job] = {}
    for job in [Job(sweep, size) for sweep in sweeps]:
        for seeds in to_do(job, out):
            if job.source and (missing := missing_sources(job.source, seeds, out)):
                found.setdefault((job.source.sweep, missing), job.source)
            found[job.sweep, seeds] = job
    return [(job, seeds) for (_, seeds), job in found.items()]


def expected_seconds(sweeps: list[Sweep], size: Size, out: Path) -> float:
    """What these sweeps will take, with the source agents that they lack, as far as one can tell beforehand."""
    return sum(estimate.block_seconds(job, len(seeds)) for job, seeds in lacking(sweeps, size, out))


def compile_ahead(sweeps: list[Sweep], size: Size, out: Path) -> Ahead:
    """Begins to compile, in threads, what these sweeps lack in `out`, in their order; for `run_sweep`."""
    first: dict[Sweep, tuple[Job, range]] = {}
    for job, seeds in lacking(sweeps, size, out):
        first.setdefault(job.sweep, (job, seeds))
    return Ahead(first.values())


def run_sweep(
    sweep: Sweep,
    size: Size,
    out: Path,
    console: Console,
    *,
    resume: bool,
    save_agents: bool = False,
    client: Any = None,
    patience: float = 300.0,
    ahead: Ahead | None = None,
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
      patience: seconds to wait for workers of a cluster that has none.
      ahead: what compiles the sweep's programs already, see `compile_ahead`.

    Returns:
      The folder with the results.

    Raises:
      ValueError: bad sizes, more than this machine can hold, or a folder that already holds results, or holds some
        without their agents.
      FolderInUse: if another process writes to the folder.
      TimeoutError: if a cluster has no worker.
    """
    size.check()
    job, folder = Job(sweep, size), out / sweep.name
    job.check()
    todo = to_do(job, out)
    finished = size.seeds - sum(map(len, todo))
    if finished and not resume:
        raise ValueError(f"{folder} holds results of {finished} seeds already; add --resume, or choose another --out")
    if save_agents:
        check_agents(folder, job)
    if not todo:
        console.print(f"{sweep.name}: all {size.seeds} seeds are there, in {folder}")
        store.write_manifest(folder)
        return folder
    seconds = expected_seconds([sweep], size, out)
    console.print(_announcement(job, todo, seconds))
    with files.locked(folder):
        try:
            if client is None:
                _run_here(job, out, console, seconds, save_agents, ahead)
            else:
                _run_on_cluster(client, job, out, console, save_agents, patience)
        except (KeyboardInterrupt, OSError):
            saved = store.in_words(store.finished_seeds(folder))
            held = f"seeds {saved}" if saved else "nothing yet"
            console.print(f"{sweep.name}: stopped; saved in {folder}: {held}", soft_wrap=True)
            raise
    return folder


def save(block: Block, job: Job, out: Path, save_agents: bool) -> None:
    """Keeps a block: its agents if they are wanted, then its part."""
    folder = out / job.sweep.name
    if save_agents:
        write_agents(folder, job, block.seeds, block.agents)
    store.add_part(folder, block.seeds, block.results)


class _Shown:
    """Computes blocks while a bar shows how many of the expected seconds are done."""

    def __init__(self, told: Callable[[float], None], ahead: Ahead | None):
        self._told, self._ahead = told, ahead
        self._compiled = set()
        self.stopwatch = pace.Stopwatch()

    def compute(self, job: Job, seeds: range, source: Source | None) -> Block:
        return block_of(job, seeds, self._chunks(job, seeds, source))

    def _chunks(self, job: Job, seeds: range, source: Source | None) -> Iterator[Chunk]:
        started = set()
        self.stopwatch.start()
        if self._ahead:
            self._ahead.wait(job.sweep)
        for chunk in advance(job, seeds, source):
            seconds = chunk.episodes * estimate.seconds_per_episode(job, chunk.group, len(seeds))
            if chunk.group not in started:
                seconds += estimate.pretraining_seconds(job, chunk.group, len(seeds))
            program = job.sweep.name, chunk.group
            self.stopwatch.lap(seconds, is_first=program not in self._compiled)
            started.add(chunk.group)
            self._compiled.add(program)
            self._told(seconds)
            yield chunk
            self.stopwatch.start()


def _run_here(job: Job, out: Path, console: Console, seconds: float, save_agents: bool, ahead: Ahead | None) -> None:
    """Runs what is missing, as it is now that nobody else writes, and shows the progress of so many seconds."""
    with progress.shown(console, job.sweep.name, seconds) as told:
        shown = _Shown(told, ahead)
        for seeds in to_do(job, out):
            source = sources_of(job.source, seeds, out, shown.compute) if job.source else None
            save(shown.compute(job, seeds, source), job, out, save_agents)
        shown.stopwatch.keep()


def _run_on_cluster(client: Any, job: Job, out: Path, console: Console, save_agents: bool, patience: float) -> None:
    """The same on a cluster; the progress counts seeds, over all workers."""
    from sweeps.engine import distributed  # which needs an extra

    todo = to_do(job, out)
    with progress.shown(console, f"{job.sweep.name} on a cluster", sum(map(len, todo))) as told:
        for block in distributed.compute_blocks(client, job, out, todo, patience):
            save(block, job, out, save_agents)
            told(len(block.seeds))


def _announcement(job: Job, todo: list[range], seconds: float) -> str:
    points, seeds = len(job.sweep.design), sum(map(len, todo))
    agents = points * seeds * len(job.sweep.learners)
    programs = f" in {len(job.groups)} programs" if len(job.groups) > 1 else ""
    return (
        f"{job.sweep.name}: {agents} agents (points x seeds x learners){programs}, {job.size.episodes} episodes each; "
        f"expected {estimate.in_words(seconds)} with {usable_cores()} cores; "
        f"compiling, if no earlier run did: {estimate.in_words(estimate.compiling_seconds(job))}"
    )
