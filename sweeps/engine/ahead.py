"""Compiles what jobs need in threads, while what comes before them runs: compiling is seconds of work for one core."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import jax
import jax.numpy as jnp
from jax.sharding import NamedSharding, PartitionSpec

from jrcjax.machine import usable_cores
from jrcjax.training import parallel
from sweeps.engine.block import hand_on
from sweeps.engine.job import Group, Job
from sweeps.engine.program import chunk_of, program_of
from sweeps.sweep import Sweep


class Ahead:
    """Compiles the programs of jobs, in the order in which they are run.

    JAX keeps a compiled program by its arguments' shapes, so whoever calls the program then finds it ready.
    """

    def __init__(self, jobs: Iterable[tuple[Job, range]]):
        """Begins with the first of these jobs, each with seeds that it is run for."""
        # Tracing holds the interpreter's lock, so a single thread does all of it.
        self._tracing = ThreadPoolExecutor(1, "tracing")
        self._compiling = ThreadPoolExecutor(usable_cores(), "compiling")
        self._agents: dict[Any, Any] = {}  # shapes of what known programs start, by program and shapes
        self._jobs = {job.sweep: self._tracing.submit(self._of_job, job, seeds) for job, seeds in jobs}

    def wait(self, sweep: Sweep) -> None:
        """Waits until what a sweep needs is compiled, if it is among the jobs."""
        if begun := self._jobs.pop(sweep, None):
            for compiled in begun.result():
                compiled.result()

    def close(self) -> None:
        """Begins nothing more."""
        for pool in (self._tracing, self._compiling):
            pool.shutdown(wait=False, cancel_futures=True)

    def _of_job(self, job: Job, seeds: range) -> list[Future]:
        return [future for group in job.groups for future in self._of_group(job, group, seeds)]

    def _of_group(self, job: Job, group: Group, seeds: range) -> list[Future]:
        program = program_of(job.sweep.learners, job.spec, group.config, chunk_of(group.config.episodes))
        table, lanes = job.shapes, _lanes(job, group, seeds)
        key, lowered = (program, str(jax.tree.map(jnp.shape, (table, lanes)))), []
        if key not in self._agents:
            start = program.start.lower(table, lanes)
            self._agents[key] = agents = _on_devices(start.out_info)
            lowered = [start, program.advance.lower((table, jnp.int32(0)), (agents, lanes[2]))]
        if job.sweep.hands_on:
            states = self._agents[key]["ddqn"].learner
            lowered.append(hand_on(job.spec, group.config).lower(table, (lanes[0], lanes[2], states)))
        return [self._compiling.submit(each.compile) for each in lowered]


def _lanes(job: Job, group: Group, seeds: range) -> Any:
    """Shapes of what the program starts a batch of lanes from: keys, sources and numbers of points."""
    number = len(group.rows) * len(seeds)
    size = parallel.group_size(number)
    key = jax.eval_shape(jax.random.key, 0)
    source = _like_sources(job.source) if job.source else None
    of_lane = key, source, jax.ShapeDtypeStruct((), jnp.int32)
    return jax.tree.map(lambda leaf: jax.ShapeDtypeStruct((size, *leaf.shape), leaf.dtype), of_lane)


def _like_sources(job: Job) -> Any:
    """Shapes of what one of a job's agents hands on."""
    group = job.groups[0]
    program = program_of(job.sweep.learners, job.spec, group.config, chunk_of(group.config.episodes))
    keys, _, points = lanes = _lanes(job, group, range(1))  # their number does not matter
    agents = program.start.eval_shape(job.shapes, lanes)
    handed_on = hand_on(job.spec, group.config).eval_shape(job.shapes, (keys, points, agents["ddqn"].learner))
    return jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape[1:], leaf.dtype), handed_on)


def _on_devices(agents: Any) -> Any:
    """Shapes of agents that a program returned, which lie where it left them."""
    number = jax.tree.leaves(agents)[0].shape[0]
    where = NamedSharding(parallel.mesh(parallel.devices_for(number)), PartitionSpec("agents"))
    return jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, leaf.dtype, sharding=where), agents)
