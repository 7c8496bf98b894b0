"""A sweep on the workers of a Dask cluster: a block of seeds is a task, and what it returns becomes a part here.

Workers compute and never write, so they need no folder in common. A task whose worker is lost runs again on another
one, and since a seed has the same bits wherever it runs, results are those of a local run. A worker uses all of its
devices: it shards its agents over them like any other process. Workers of a local cluster share its cores.
"""

from __future__ import annotations

import functools
import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
import xarray as xr

from jrcjax import files
from jrcjax.checks import refuse, require_integer
from jrcjax.learners import Source
from jrcjax.provenance import command, working_for
from jrcjax.training import parallel
from sweeps.engine import sources
from sweeps.engine.program import points_of, reference_of
from sweeps.engine.run import quiet, results_of
from sweeps.results import store
from sweeps.results.agents import agents_path, write_agents
from sweeps.sweep import Size, Sweep

_LOST_WORKERS = 10  # that one block may have before the run gives up

_ADDRESS = "the address of a running scheduler, such as tcp://host:8786"


@contextmanager
def client_of(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """A client of the scheduler at an address, or of a cluster of so many processes on this machine.

    Raises:
      ValueError: naming the flag, the value and what is allowed.
    """
    if scheduler is not None and workers is not None:
        refuse("workers", workers, "none together with scheduler")
    if scheduler is None:
        require_integer("workers", workers, 1, 1024)
    elif not re.fullmatch(r"(tcp|tls|ws|wss|ucx)://.+:\d+", scheduler):
        refuse("scheduler", scheduler, _ADDRESS)
    try:
        from dask import config
        from distributed import Client, LocalCluster
    except ModuleNotFoundError as error:
        refuse("scheduler, workers", f"without package {error.name}", "with the extra: pip install 'jrcjax[dask]'")
    if scheduler is not None:
        try:
            client = Client(scheduler, timeout="10s", set_as_default=False)
        except (OSError, ValueError) as error:
            refuse("scheduler", scheduler, f"{_ADDRESS} ({error})")
        with client:
            yield client
        return
    with (
        config.set({"distributed.scheduler.allowed-failures": _LOST_WORKERS}),
        LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=":0") as cluster,
        # As the default client it would give xarray locks of the cluster, also for files that only this process has.
        Client(cluster, set_as_default=False) as client,
    ):
        yield client


def run_blocks(
    client: Any, sweep: Sweep, size: Size, out: Path, todo: list[range], save_agents: bool = False
) -> Iterator[range]:
    """Runs blocks of seeds on a cluster and writes their parts, and those of source agents, as they come in.

    Args:
      client: of the cluster.
      sweep: what to run.
      size: how much of it.
      out: the folder with the results of all sweeps.
      todo: the blocks.
      save_agents: save the trained agents beside the parts.

    Yields:
      Each block, when its part is written.
    """
    from distributed import as_completed

    blocks = {}
    share_of = len(client.cluster.workers) if client.cluster else None  # those of this machine share its cores
    for seeds in todo:
        source = None
        if sweep.source and not sources.missing_sources(sweep.source, size, seeds, out):
            kept = sources.sources_of(sweep.source, size, seeds, out, quiet)
            source = client.scatter(jax.tree.map(np.asarray, kept))
        asked = _Asked(sweep, size, seeds, save_agents, share_of, command())
        blocks[client.submit(_block, asked, source, pure=False)] = seeds
    for done in as_completed(list(blocks), loop=client.loop):
        seeds, made = blocks[done], done.result()
        if sweep.source and made.sources is not None:
            folder = out / sweep.source.name
            with files.locked(folder, waiting=lambda held: None):
                store.add_part(folder, seeds, made.sources)
        if made.agents is not None:
            files.write_whole(agents_path(out / sweep.name, seeds), made.agents)
        store.add_part(out / sweep.name, seeds, made.results)
        done.release()
        yield seeds


class _Asked(NamedTuple):
    """What a worker is asked for."""

    sweep: Sweep
    size: Size
    seeds: range
    save_agents: bool
    share_of: int | None
    """Workers that share the cores of its machine; None if it has them for itself."""
    command: str
    """Of the process that asks."""


class _Made(NamedTuple):
    """What a worker returns."""

    results: xr.Dataset
    sources: xr.Dataset | None
    """Results of the source agents, if it had to train them."""
    agents: bytes | None
    """The file of the agents, if it was asked for."""


def _block(asked: _Asked, source: Source | None) -> _Made:
    """On a worker: the results of a block of seeds."""
    _prepare(asked.share_of)
    sweep, size, seeds, trained = asked.sweep, asked.size, asked.seeds, None
    with working_for(asked.command), tempfile.TemporaryDirectory() as scratch:
        if sweep.source and source is None:
            source, trained = sources.trained(sweep.source, size, seeds, quiet)
        points = points_of(sweep, size.preset)
        reference = reference_of(points, size.episodes)
        keep = functools.partial(write_agents, Path(scratch), sweep, size, points, seeds) if asked.save_agents else None
        results = results_of(sweep, size, points, reference, seeds, source, quiet, keep)
        saved = agents_path(Path(scratch), seeds).read_bytes() if keep else None
    return _Made(results, trained, saved)


def share(cores: list[int], number: int, of: int) -> list[int]:
    """The cores of worker `number` of so many: each core has one worker, or each worker one core."""
    return cores[number % of :: of] or [cores[number % len(cores)]]


@functools.cache
def _prepare(share_of: int | None) -> None:
    """Makes a worker's process what the command line makes its own, once, before it has any array."""
    if share_of and hasattr(os, "sched_setaffinity"):
        from distributed import get_worker

        os.sched_setaffinity(0, share(sorted(os.sched_getaffinity(0)), int(get_worker().name), share_of))
    parallel.start()
