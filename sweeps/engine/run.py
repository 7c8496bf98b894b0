"""Runs a sweep block by block with progress for a person, and leaves its results on disk."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from jrcjax import files
from jrcjax.learners import Source
from jrcjax.machine import usable_cores
from sweeps import progress
from sweeps.engine import estimate, pace
from sweeps.engine.ahead import Ahead
from sweeps.engine.block import Block, block_of
from sweeps.engine.bundle import Bundle, bundled
from sweeps.engine.job import Job
from sweeps.engine.plan import compile_ahead, expected_seconds, plan, to_do
from sweeps.engine.program import Chunk, advance
from sweeps.engine.sources import say_that_it_waits, sources_of
from sweeps.results import store
from sweeps.results.agents import check_agents, write_agents
from sweeps.sweep import Size, Sweep


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
    finished = size.seeds - len(store.lacking(job, range(size.seeds), out))
    if finished and not resume:
        raise ValueError(f"{folder} holds results of {finished} seeds already; add --resume, or choose another --out")
    if save_agents:
        check_agents(folder, job)
    if finished == size.seeds:
        _say_all_there(job, folder, console)
        return folder
    seconds = expected_seconds(plan([sweep], size, out), out)
    _run(bundled([job]), out, console, seconds, _How(save_agents, client, patience))
    return folder


def run_together(sweeps: Sequence[Sweep], size: Size, out: Path, console: Console) -> Iterator[Sweep]:
    """Runs what is missing of some sweeps, in bundles that one program serves, while it compiles what comes next.

    Args:
      sweeps: what to run.
      size: how much of it.
      out: results of each sweep go to a folder here, source agents to that of its source.
      console: where the expected time and the progress are shown.

    Yields:
      Each of the sweeps as soon as all of its results are there.

    Raises:
      ValueError: more than this machine can hold, or results of another configuration in `out`.
      FolderInUse: if another process writes to one of the folders.
    """
    bundles = plan(sweeps, size, out)
    waiting = {member.job.sweep for bundle in bundles for member in bundle.members}
    with contextlib.closing(compile_ahead(bundles, out)) as ahead:
        for sweep in sweeps:
            if sweep not in waiting:
                _say_all_there(Job(sweep, size), out / sweep.name, console)
                yield sweep
        for bundle in bundles:
            bundle.job.check()
            _run(bundle, out, console, expected_seconds([bundle], out), _How(ahead=ahead))
            yield from (member.job.sweep for member in bundle.members if member.job.sweep in sweeps)


def _say_all_there(job: Job, folder: Path, console: Console) -> None:
    console.print(f"{job.sweep.name}: all {job.size.seeds} seeds are there, in {folder}")
    store.write_manifest(folder)  # which a killed process may not have come to


class _How(NamedTuple):
    """How a bundle is run; see `run_sweep`."""

    save_agents: bool = False
    client: Any = None
    patience: float = 300.0
    ahead: Ahead | None = None


def _run(bundle: Bundle, out: Path, console: Console, seconds: float, how: _How) -> None:
    console.print(_announcement(bundle.job, sum(map(len, to_do(bundle, out))), seconds))
    folders = [out / member.job.sweep.name for member in bundle.members]
    with contextlib.ExitStack() as locks:
        for member, folder in zip(bundle.members, folders, strict=True):
            locks.enter_context(files.locked(folder, say_that_it_waits if member.job.sweep.hands_on else None))
        try:
            if how.client is None:
                _run_here(bundle, out, console, seconds, how)
            else:
                _run_on_cluster(bundle, out, console, how)
        except (KeyboardInterrupt, OSError):
            for folder in folders:
                saved = store.in_words(store.finished_seeds(folder))
                held = f"seeds {saved}" if saved else "nothing yet"
                console.print(f"{folder.name}: stopped; saved in {folder}: {held}", soft_wrap=True)
            raise


def save(block: Block, bundle: Bundle, out: Path, save_agents: bool) -> None:
    """Keeps a block: of each sweep its agents if they are wanted, then its part."""
    for member in bundle.members:
        folder = out / member.job.sweep.name
        if save_agents:
            write_agents(folder, member.job, block.seeds, bundle.agents_of(member, block.agents))
        store.add_part(folder, block.seeds, bundle.results_of(member, block.results))


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


def _run_here(bundle: Bundle, out: Path, console: Console, seconds: float, how: _How) -> None:
    """Runs what is missing, as it is now that nobody else writes, and shows the progress of so many seconds."""
    job = bundle.job
    with progress.shown(console, job.sweep.name, seconds) as told:
        shown = _Shown(told, how.ahead)
        for seeds in to_do(bundle, out):
            source = sources_of(job.source, seeds, out, shown.compute) if job.source else None
            save(shown.compute(job, seeds, source), bundle, out, how.save_agents)
        shown.stopwatch.keep()


def _run_on_cluster(bundle: Bundle, out: Path, console: Console, how: _How) -> None:
    """The same on a cluster; the progress counts seeds, over all workers."""
    from sweeps.engine import distributed  # which needs an extra

    job, todo = bundle.job, to_do(bundle, out)
    with progress.shown(console, f"{job.sweep.name} on a cluster", sum(map(len, todo))) as told:
        for block in distributed.compute_blocks(how.client, job, out, todo, how.patience):
            save(block, bundle, out, how.save_agents)
            told(len(block.seeds))


def _announcement(job: Job, seeds: int, seconds: float) -> str:
    agents = len(job.sweep.design) * seeds * len(job.sweep.learners)
    programs = f" in {len(job.groups)} programs" if len(job.groups) > 1 else ""
    return (
        f"{job.sweep.name}: {agents} agents (points x seeds x learners){programs}, {job.size.episodes} episodes each; "
        f"expected {estimate.in_words(seconds)} with {usable_cores()} cores; "
        f"compiling, if no earlier run did: {estimate.in_words(estimate.compiling_seconds(job))}"
    )
