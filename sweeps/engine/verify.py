"""Recomputes parts of results and compares them with what is on disk, bit for bit."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from jrcjax import provenance
from jrcjax.checks import refuse
from sweeps.engine.block import compute, source_in
from sweeps.engine.job import Job
from sweeps.results import store
from sweeps.results.parts import Part, parts_of, read_part
from sweeps.sweep import Size, Sweep


class Difference(NamedTuple):
    """Where a recomputed array is not the one on disk."""

    variable: str
    entries: int
    of: int
    first: dict[str, Any]
    """Coordinates of the first entry that differs."""
    largest: float
    """Largest absolute difference; NaN where one of the two is no number."""

    def __str__(self) -> str:
        """In one line."""
        where = ", ".join(f"{name} {value}" for name, value in self.first.items())
        count = f"{self.entries} of {self.of} entries differ"
        return f"{self.variable}: {count}, by at most {self.largest:g}, first at {where}"


def sample_of(parts: list[Part], number: int | None) -> list[Part]:
    """So many parts, evenly spread from the first to the last; all if None.

    Raises:
      ValueError: naming the argument, the value and what is allowed.
    """
    if number is None:
        return parts
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        refuse("parts", str(number), "an integer >= 1")
    chosen = np.unique(np.linspace(0, len(parts) - 1, min(number, len(parts))).round().astype(int))
    return [parts[i] for i in chosen]


def size_of_part(part: Part) -> Size:
    """The size of the run that a part is of, as far as its configuration says."""
    config, fields = part.configuration, {field.name for field in dataclasses.fields(Size)}
    held = {name: _of_size(config, name) for name in config["config"] if name in fields}
    return Size(seeds=part.seeds.stop, episodes=config["episodes"], preset=config["preset"], **held)


def _of_size(config: dict[str, Any], name: str) -> Any:
    """What the size says of a setting: as the source has it, whose points leave it alone, or a point that does."""
    value = config.get("source", config)["config"][name]
    if not isinstance(value, list):
        return value
    (column,) = (column for column, path in config["paths"].items() if path == f"config.{name}")
    return next((v for v, own in zip(value, config["design"][column], strict=True) if own is None), value[0])


def recomputed(part: Part, sweep: Sweep) -> xr.Dataset:
    """The results of a part, computed anew; the source agents of a sweep that transfers are trained anew, too.

    Args:
      part: what is on disk.
      sweep: its sweep.

    Raises:
      ConfigurationMismatch: if today's sweep of that name is not the one that made the part.
    """
    job = Job(sweep, size_of_part(part))
    store.check_configuration(part, store.configuration(job))
    source = source_in(job.source, compute(job.source, part.seeds).results) if job.source else None
    return compute(job, part.seeds, source).results


def differences(there: xr.Dataset, again: xr.Dataset) -> list[Difference]:
    """What differs between the arrays of two datasets; equal NaNs are equal."""
    found = []
    for name in sorted({*map(str, there.variables), *map(str, again.variables)}):
        if name not in there.variables or name not in again.variables:
            missing = "disk" if name not in there.variables else "today's results"
            found.append(Difference(f"{name} (not in {missing})", 1, 1, {}, float("nan")))
            continue
        a, b = there[name], again[name]
        if a.shape != b.shape:
            found.append(Difference(f"{name} (shapes {a.shape} and {b.shape})", 1, 1, {}, float("nan")))
            continue
        differs = np.asarray(a.values != b.values)
        if a.dtype.kind == "f":
            differs &= ~(np.isnan(a.values) & np.isnan(b.values))
        if differs.any():
            found.append(_difference(name, a, b, differs))
    return found


def _difference(name: str, a: xr.DataArray, b: xr.DataArray, differs: np.ndarray) -> Difference:
    first = np.argwhere(differs)[0]
    coords = {str(d): a[d].values[i] if d in a.coords else int(i) for d, i in zip(a.dims, first, strict=True)}
    gap = np.abs(a.values[differs].astype(float) - b.values[differs]).max() if a.dtype.kind in "biuf" else np.nan
    return Difference(name, int(differs.sum()), differs.size, coords, float(gap))


def verify(folder: Path, number: int | None, sweeps: Mapping[str, Sweep]) -> Iterator[tuple[Part, list[Difference]]]:
    """Recomputes some parts of a folder, all if `number` is None, and says of each what differs before the next one.

    Args:
      folder: with the parts of one sweep.
      number: of parts.
      sweeps: all sweeps by name, with those that train source agents.

    Raises:
      ValueError: if there are no parts, or none of a known sweep or of its configuration.
    """
    if not folder.is_dir() or not (parts := parts_of(folder)):
        refuse("folder", str(folder), "a folder with the parts of a sweep, such as out/results/fig6")
    for part in sample_of(parts, number):
        sweep = _sweep_of(part, sweeps)
        yield part, differences(read_part(part.path), recomputed(part, sweep))


def _sweep_of(part: Part, sweeps: Mapping[str, Sweep]) -> Sweep:
    """Today's sweep of the name that a part gives; one of a person's own is what the part says of it."""
    name = part.configuration["sweep"]
    if name in sweeps:
        return sweeps[name]
    if not part.configuration.get("own"):
        refuse(str(part.path), f"results of the sweep {name!r}", ", ".join(map(repr, sweeps)))
    return store.sweep_of(part.configuration)


def made_elsewhere(part: Part) -> list[str]:
    """What was different where a part was made, of what decides the last bit of its numbers."""
    made, machine = part.provenance, provenance.machine()
    decisive = ("cpu_features", "xla_flags")
    there = {name: made["machine"].get(name) for name in decisive} | made["versions"]
    here = {name: machine[name] for name in decisive} | provenance.versions()
    return [f"{name}: {there.get(name)} there, {here[name]} here" for name in here if there.get(name) != here[name]]
