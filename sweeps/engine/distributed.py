"""A sweep on the workers of a Dask cluster: a block of seeds is a task, and what it returns becomes a part here.

Workers compute and never write, so they need no folder in common. A task whose worker is lost runs again on another
one, and since a seed has the same bits wherever it runs, results are those of a local run. A worker uses all of its
devices: it shards its agents over them like any other process. Workers of a local cluster share its cores.
"""

from __future__ import annotations

import functools
import os
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from jrcjax import files
from jrcjax.checks import refuse, require_integer
from jrcjax.learners import Source
from jrcjax.provenance import command, working_for
from jrcjax.training import parallel
from sweeps.engine.block import Block, compute, source_in
from sweeps.engine.job import Job
from sweeps.engine.sources import kept_sources, missing_sources
from sweeps.engine.workers import SAME_CHECKOUT, Watch
from sweeps.results import store
from sweeps.sweep import Size, Sweep

_LOST_WORKERS = 10  # that one block may have before the run gives up
_POLL = 0.2  # seconds between two looks at tasks and workers

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


def compute_blocks(client: Any, job: Job, out: Path, todo: list[range], patience: float) -> Iterator[Block]:
    """Computes blocks of seeds on a cluster, and keeps the source agents that workers had to train.

    Args:
      client: of the cluster.
      job: what to run.
      out: the folder with the results of all sweeps.
      todo: the blocks.
      patience: seconds without any worker after which the run gives up.

    Yields:
      The blocks as they come in.

    Raises:
      TimeoutError: when no worker comes, or none comes back.
      ValueError: if a worker lacks a module of this project.
      OSError: if a block is lost with one worker after the other.
    """
    watch = Watch(client, patience)
    while not watch.look():
        time.sleep(_POLL)
    share_of = len(client.cluster.workers) if client.cluster else None  # those of this machine share its cores
    tasks = []
    for seeds in todo:
        source = None
        if job.source and not missing_sources(job.source, seeds, out):
            source = client.scatter(jax.tree.map(np.asarray, kept_sources(job.source, seeds, out)))
        asked = _Asked(job.sweep, job.size, seeds, share_of, command())
        tasks.append(client.submit(_made, asked, source, pure=False))
    for done in _as_they_come(client, tasks, watch):
        made = _result_of(done)
        if made.sources is not None:
            assert job.source
            folder = out / job.source.sweep.name
            with files.locked(folder, waiting=lambda held: None):
                store.add_part(folder, made.block.seeds, made.sources)
        done.release()
        yield made.block


def _as_they_come(client: Any, tasks: list[Any], watch: Watch) -> Iterator[Any]:
    """Tasks as they end, while somebody looks at the workers."""
    from distributed import as_completed

    coming = as_completed(tasks, loop=client.loop)
    while not coming.is_empty():
        if coming.has_ready():
            yield next(coming)
        else:
            watch.look()
            time.sleep(_POLL)


def _result_of(task: Any) -> _Made:
    from distributed import KilledWorker

    try:
        return task.result()
    except KilledWorker as error:
        text = f"a block was lost with {_LOST_WORKERS} workers, one after the other; their logs say why they ended"
        raise OSError(text) from error
    except ModuleNotFoundError as error:  # of a worker that had its task before it was looked at
        refuse("workers", f"one without {error.name}", SAME_CHECKOUT)


class _Asked(NamedTuple):
    """What a worker is asked for."""

    sweep: Sweep
    size: Size
    seeds: range
    share_of: int | None
    """Workers that share the cores of its machine; None if it has them for itself."""
    command: str
    """Of the process that asks."""


class _Made(NamedTuple):
    """What a worker returns."""

    block: Block
    sources: xr.Dataset | None
    """Results of the source agents, if it had to train them."""


def _made(asked: _Asked, source: Source | None) -> _Made:
    """On a worker: a block of seeds."""
    _prepare(asked.share_of)
    job, sources = _job(asked.sweep, asked.size), None
    with working_for(asked.command):
        if job.source and source is None:
            sources = compute(job.source, asked.seeds).results
            source = source_in(job.source, sources)
        block = compute(job, asked.seeds, source)
    return _Made(block._replace(agents=jax.tree.map(_plain, block.agents)), sources)


@functools.lru_cache(maxsize=2)
def _job(sweep: Sweep, size: Size) -> Job:
    """A worker makes a job once for all of its blocks."""
    return Job(sweep, size)


def _plain(leaf: Any) -> np.ndarray:
    """An array that can be sent: keys as the words that they are made of."""
    return np.asarray(jax.random.key_data(leaf) if jnp.issubdtype(leaf.dtype, jax.dtypes.prng_key) else leaf)


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
