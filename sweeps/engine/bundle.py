"""Sweeps that one program serves are run as one, and a point that several of them have is run once."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import xarray as xr

from jrcjax.config.stacking import changes
from jrcjax.training import parallel
from jrcjax.training.rollout import AgentState
from sweeps.design import Design, table
from sweeps.engine.block import handed_on
from sweeps.engine.job import Job
from sweeps.preset import base_of
from sweeps.results import store
from sweeps.sweep import Sweep


class Member(NamedTuple):
    """One of the sweeps."""

    job: Job
    points: tuple[int, ...]
    """The numbers of its points among those of all."""


@dataclass(frozen=True, eq=False)
class Bundle:
    """Sweeps that are run as one."""

    job: Job
    """With the points of all of them."""
    members: tuple[Member, ...]

    def results_of(self, member: Member, results: xr.Dataset) -> xr.Dataset:
        """What results of all points say of one sweep's, as if it had been run alone."""
        if member.job is self.job:
            return results
        names = {column.name for column in self.job.sweep.design.columns}
        kept = results.isel(point=list(member.points)).drop_vars([*names, *_unwanted(member.job, results)])
        return kept.assign_coords(store.points_of(member.job)).assign_attrs(store.about(member.job))

    def agents_of(self, member: Member, agents: dict[str, AgentState]) -> dict[str, AgentState]:
        """Those of one sweep's points."""
        rows = list(member.points)
        return jax.tree.map(lambda leaf: parallel.on_host(lambda array: array[rows], leaf), agents)


def _unwanted(job: Job, results: xr.Dataset) -> list[str]:
    """Names of what only sweeps that hand on their agents keep, unless the job is one of these."""
    return [] if job.sweep.hands_on else [str(name) for name in results.data_vars if handed_on(str(name))]


def what_is_shared(sweep: Sweep) -> Sweep:
    """Sweeps for which this is the same can be run together: they differ in points, and in what is kept of them."""
    return dataclasses.replace(sweep, name="", description="", design=Design(), hands_on=False, seeds_per_part=1)


def bundled(jobs: Sequence[Job]) -> Bundle:
    """Jobs of one size whose sweeps have in common `what_is_shared`, as one."""
    if len(jobs) == 1:
        return Bundle(jobs[0], (Member(jobs[0], tuple(range(len(jobs[0].sweep.design)))),))
    rows = [_rows(job) for job in jobs]
    different = list(dict.fromkeys(row for of_job in rows for row in of_job))
    sweeps = [job.sweep for job in jobs]
    sweep = dataclasses.replace(
        sweeps[0],
        name=", ".join(sweep.name for sweep in sweeps),
        design=_design(different),
        hands_on=any(sweep.hands_on for sweep in sweeps),
        seeds_per_part=parts_for(len(different), jobs[0].size.seeds)[0],
    )
    members = [Member(job, tuple(map(different.index, of_job))) for job, of_job in zip(jobs, rows, strict=True)]
    return Bundle(Job(sweep, jobs[0].size), tuple(members))


def parts_for(points: int, seeds: int, available: int | None = None) -> list[int]:
    """Seeds of each part: as few as take no more rounds of blocks than many, so that an interrupt costs little.

    Args:
      points: of a bundle.
      seeds: that it lacks.
      available: devices, those of this process if None.
    """

    def parts(size: int) -> list[int]:
        return [size] * (seeds // size) + [seeds % size] * bool(seeds % size)

    def cost(size: int) -> tuple[int, int]:
        lanes = [points * some for some in parts(size)]
        rounds = sum(parallel.rounds_for(count, available=available) for count in lanes)
        return rounds, sum(parallel.padded(count, available=available) for count in lanes)

    return parts(min(range(1, Sweep.seeds_per_part + 1), key=cost))


_Row = tuple[tuple[str, float], ...]  # what a point changes of the base, by path


def _rows(job: Job) -> list[_Row]:
    """What each point of a job changes; points that change the same are the same."""
    design, base = job.sweep.design, base_of(job.sweep.environment, job.size.preset).points
    columns = [(values, changes(base, values)) for values in design.settings(base)]
    return [
        tuple(sorted((values.parameter.path, float(values.at[i])) for values, changed in columns if changed[i]))
        for i in range(len(design))
    ]


def _design(rows: Sequence[_Row]) -> Design:
    paths = dict.fromkeys(path for row in rows for path, _ in row)
    return table([dict(row) for row in rows], {path: path for path in paths})
