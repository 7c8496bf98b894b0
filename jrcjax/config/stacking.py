"""Many points at once: a base whose numbers at some paths differ from point to point."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from jrcjax.config.paths import DISTRIBUTIONS, Entry, Parameter, Points, leaf_of
from jrcjax.containers import Container
from jrcjax.learners.hparams import Config, check_config, check_hparams
from jrcjax.model.params import check_params
from jrcjax.radar.modes import Modes


class Values(NamedTuple):
    """A parameter and its value at each point; NaN where it is as in the base."""

    parameter: Parameter
    at: np.ndarray
    """[points]."""


def stacked(base: Points, columns: Sequence[Values], number: int) -> Points:
    """So many points, checked: the base with the values of the columns, every leaf with a leading axis of points.

    The other entries of a distribution keep their proportions.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    of_radar = [c for c in columns if _is_of_radar(c)]
    others = [c for c in columns if c not in of_radar and c.parameter.container != "config"]
    bare = base._replace(params=_with(base.params, radar=np.zeros(())))
    points = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (number, *np.shape(leaf))), bare)
    for column in others:
        changed = getattr(points, column.parameter.container)
        for entry in column.parameter.entries:
            changed = _replaced(changed, entry.fields, _changed(leaf_of(changed, entry), entry, column.at))
        points = points._replace(**{column.parameter.container: changed})
    points = points._replace(params=_with(points.params, radar=_radars(base, of_radar, number)))
    for i in range(number):
        params, hparams = jax.tree.map(lambda leaf, i=i: leaf[i], points)
        check_params(params)
        check_hparams(hparams)
    return jax.device_put(points)  # unlike jnp.asarray it compiles nothing for each shape


def changes(base: Points, column: Values) -> np.ndarray:
    """Which of the values of a column change the base, [points]; those of a setting are taken to."""
    number, parameter = len(column.at), column.parameter
    if parameter.container == "config":
        return ~np.isnan(column.at)
    found = np.zeros(number, bool)
    for entry in parameter.entries:
        leaf = np.asarray(leaf_of(getattr(base, parameter.container), entry))
        changed = _changed(np.broadcast_to(leaf, (number, *leaf.shape)), entry, column.at)
        found |= (changed != leaf).reshape(number, -1).any(axis=1)
    return found


def shapes(base: Points, columns: Sequence[Values], number: int) -> Points:
    """Shapes and types of `stacked`, without the banks of placements, which take seconds to draw."""
    of_radar = [c for c in columns if _is_of_radar(c)]
    modes = [_radar(base.params.radar.modes, of_radar, row) for row in _different(of_radar, number)[0]]
    point = base._replace(params=_with(base.params, radar=_with(base.params.radar, max_objects=_room(modes))))
    return jax.tree.map(lambda leaf: jax.ShapeDtypeStruct((number, *leaf.shape), leaf.dtype), point)


def with_value(point: Points, parameter: Parameter, value: float) -> Points:
    """One point, checked, with one number changed."""
    return jax.tree.map(lambda leaf: leaf[0], stacked(point, [Values(parameter, np.array([value]))], 1))


def _changed(array: np.ndarray, entry: Entry, values: np.ndarray) -> np.ndarray:
    """A leaf [points, ...] with one entry set where there is a value."""
    changed, given = np.array(array), ~np.isnan(values)
    if entry.fields[-1] in DISTRIBUTIONS:
        others = np.arange(changed.shape[1]) != entry.index[0]
        kept = changed[given][:, others].astype(np.float64)
        total = kept.sum(axis=1, keepdims=True)
        even = np.full(kept.shape, 1.0 / max(kept.shape[1], 1))
        shares = np.where(total > 0, kept / np.where(total > 0, total, 1.0), even)
        changed[np.ix_(given, others)] = (1.0 - values[given])[:, None] * shares
    changed[(given, *entry.index)] = values[given]
    return changed


def _with(container: Any, **fields: Any) -> Any:
    """A copy with fields as they are: nothing is checked, converted or derived from them."""
    if isinstance(container, Container):
        return type(container).restored(vars(container) | fields)
    return dataclasses.replace(container, **fields)


def _replaced(container: Any, fields: tuple[str, ...], leaf: Any) -> Any:
    name, *rest = fields
    return _with(container, **{name: _replaced(getattr(container, name), tuple(rest), leaf) if rest else leaf})


def _radars(base: Points, columns: list[Values], number: int) -> Any:
    """The radars of all points, each that differs built once, with room for as many objects as the densest needs."""
    different, which = _different(columns, number)
    radars = [_radar(base.params.radar, columns, row) for row in different]
    room = _room(radars)
    roomy = [_with(radar, max_objects=room) for radar in radars]
    whole = jax.tree.map(lambda *leaves: np.stack(leaves), *roomy)
    return jax.tree.map(lambda leaf: leaf[which], whole)


def _is_of_radar(column: Values) -> bool:
    return column.parameter.entries[0].fields[0] == "radar"


def _different(columns: list[Values], number: int) -> tuple[np.ndarray, np.ndarray]:
    """The rows of values that differ, and which of them each point has."""
    rows = np.stack([column.at for column in columns], axis=1) if columns else np.zeros((number, 0))
    different, which = np.unique(rows, axis=0, return_inverse=True, equal_nan=True)
    return different, which.reshape(-1)


def _room(radars: Sequence[Modes]) -> tuple[int, ...]:
    return tuple(int(most) for most in np.max([radar.max_objects for radar in radars], axis=0))


def _radar(radar: Any, columns: list[Values], row: np.ndarray) -> Any:
    """A radar, or its modes alone, with the values of one point."""
    changes = {}
    for column, value in zip(columns, row, strict=True):
        entry = column.parameter.entries[0]
        name = entry.fields[1]
        if not hasattr(radar, name):  # the seed of a bank
            continue
        held = np.asarray(changes.get(name, getattr(radar, name)))
        changes[name] = _changed(held[None], entry, np.array([value]))[0]
    changes = {name: value for name, value in changes.items() if not np.array_equal(value, getattr(radar, name))}
    return radar.replace(**changes) if changes else radar


def settings(base: Config, columns: Sequence[Values], number: int) -> list[Config]:
    """The static settings of each of so many points, checked.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    found = []
    for i in range(number):
        changes = {
            c.parameter.entries[0].fields[0]: c.parameter.readings[int(c.at[i])]
            if c.parameter.readings
            else int(c.at[i])
            for c in columns
            if c.parameter.container == "config" and not np.isnan(c.at[i])
        }
        found.append(dataclasses.replace(base, **changes))
    for config in dict.fromkeys(found):
        check_config(config)
    return found
