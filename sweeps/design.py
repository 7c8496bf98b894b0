"""Designs: the points of a sweep as a table with one row per point and one named column for each thing that varies."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.stats import qmc

from jrcjax.checks import refuse
from jrcjax.config.paths import Parameter, Points, Range, parameter_at
from jrcjax.config.stacking import Values


class Column(NamedTuple):
    """What varies between points."""

    name: str
    """Of the coordinate in results."""
    path: str = ""
    """Of the number that it sets, see `jrcjax.config.paths`; none for a column that only names points."""


@dataclass(frozen=True)
class Design:
    """A table of points."""

    columns: tuple[Column, ...] = ()
    rows: tuple[tuple[float | None, ...], ...] = ((),)
    """A value for each column, readings by their index; None where a point is as the base."""

    def __len__(self) -> int:
        """The number of points."""
        return len(self.rows)

    def values(self, name: str) -> np.ndarray:
        """A column [points], NaN where a point is as the base.

        Raises:
          ValueError: for a column that is not there, naming those that are.
        """
        names = [column.name for column in self.columns]
        if name not in names:
            refuse("column", name, ", ".join(names))
        return np.array([row[names.index(name)] for row in self.rows], float)

    def parameters(self, base: Points) -> dict[str, Parameter]:
        """The parameters of the columns with a path, by the column's name.

        Raises:
          ValueError: for a path that leads nowhere, and for columns that overlap.
        """
        found: dict[str, Parameter] = {}
        for column in self.columns:
            if column.path:
                parameter = parameter_at(column.path, base)
                for other in found.values():
                    if parameter.overlaps(other):
                        refuse(column.path, other.path, "columns that do not set the same number")
                found[column.name] = parameter
        return found

    def settings(self, base: Points) -> list[Values]:
        """The parameters of the columns with their values, for `jrcjax.config.stacking`."""
        return [Values(parameter, self.values(name)) for name, parameter in self.parameters(base).items()]

    def distinct(self, names: Sequence[str]) -> tuple[Design, tuple[int, ...]]:
        """The different rows of some columns, and the number of each point's row among them."""
        places = [i for i, column in enumerate(self.columns) if column.name in names]
        projected = [tuple(row[i] for i in places) for row in self.rows]
        rows = tuple(dict.fromkeys(projected))
        return Design(tuple(self.columns[i] for i in places), rows), tuple(rows.index(row) for row in projected)


def along(name: str, path: str, values: Sequence[float]) -> Design:
    """Points that differ in one number."""
    return Design((Column(name, path),), tuple((value,) for value in values))


def table(rows: Sequence[Mapping[str, float]], paths: Mapping[str, str]) -> Design:
    """Points as rows of values by column; what a row leaves out is as in the base.

    Args:
      rows: values by the columns' names.
      paths: by name, the path of each column, or "" for a column that only names points.
    """
    columns = tuple(Column(name, path) for name, path in paths.items())
    return Design(columns, tuple(tuple(row.get(name) for name in paths) for row in rows))


def grid(values: Mapping[str, Sequence[float]]) -> Design:
    """All combinations of values by path; the last path varies fastest."""
    return Design(tuple(Column(path, path) for path in values), tuple(itertools.product(*values.values())))


def sample(ranges: Mapping[str, tuple[Parameter, Range]], number: int, seed: int) -> Design:
    """A scrambled Sobol' sequence through ranges by path (Owen 1998).

    Point i is the same whatever the number of points.
    """
    unit = sobol(len(ranges), number, seed)
    spread = [in_range(unit[:, i], p.is_whole, where) for i, (p, where) in enumerate(ranges.values())]
    rows = tuple(tuple(float(value) for value in row) for row in zip(*spread, strict=True))
    return Design(tuple(Column(path, path) for path in ranges), rows)


def sobol(dimensions: int, number: int, seed: int, skip: int = 0) -> np.ndarray:
    """Points `skip` to `skip + number` of a scrambled Sobol' sequence in the unit cube, [number, dimensions]."""
    whole = 1 << max(skip + number - 1, 1).bit_length()  # so that SciPy does not warn of an unbalanced number
    return qmc.Sobol(dimensions, rng=np.random.default_rng(seed)).random(whole)[skip : skip + number]


def in_range(unit: np.ndarray, is_whole: bool, where: Range) -> np.ndarray:
    """Numbers in [0, 1) as values of a parameter; six digits tell them apart."""
    if where.levels:
        return np.asarray(where.levels)[(unit * len(where.levels)).astype(int)]
    if is_whole and not where.is_log:
        return np.floor(where.low + unit * (where.high - where.low + 1.0))
    if where.is_log:
        found = np.exp(np.log(where.low) + unit * (np.log(where.high) - np.log(where.low)))
    else:
        found = where.low + unit * (where.high - where.low)
    if is_whole:
        return np.clip(np.round(found), where.low, where.high)
    return np.array([float(f"{value:.6g}") for value in found])
