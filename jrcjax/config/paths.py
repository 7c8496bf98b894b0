"""Numbers of an environment and of the hyperparameters by dotted path, such as env.speed.event_probability.high.

A path follows the fields of `EnvParams` (after env) or of `HParams` (after hparams) and ends with an index for each
axis of an array. Where factors have two levels, and channels two rates, low and high are the indices 0 and 1. In place
of a factor, `all` stands for every factor that has the field.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax.checks import refuse
from jrcjax.containers import Container, Kind, schema_of
from jrcjax.learners.hparams import HParams
from jrcjax.model.params import FACTORS, EnvParams
from jrcjax.named import field_at
from jrcjax.types import INITIAL_WEIGHTS


class Points(NamedTuple):
    """What differs between points, every leaf with a leading axis of points."""

    params: EnvParams
    hparams: HParams


_ROOTS = {"env": "params", "hparams": "hparams"}
_READINGS = {"initial_weights": INITIAL_WEIGHTS}
_DISTRIBUTIONS = ("prior", "class_share")
_LOW_AND_HIGH = ("prior", "event_probability", "interference", "packets", "sinr_threshold")
_MOST_VALUES = 1000


class Entry(NamedTuple):
    """One number of a container."""

    fields: tuple[str, ...]
    index: tuple[int, ...]


class Parameter(NamedTuple):
    """One number, or the same number of all factors."""

    path: str
    container: str
    """Field of `Points` that it is in."""
    entries: tuple[Entry, ...]
    readings: tuple[str, ...]
    """Names of its values, if it is the index of a reading."""
    is_whole: bool
    """Whether it is an integer."""

    def set_in(self, point: Points, value: float) -> Points:
        """A copy of a point with this value; the other entries of a distribution keep their proportions."""
        changed = getattr(point, self.container)
        for entry in self.entries:
            changed = _replaced(changed, entry.fields, entry.index, value)
        return point._replace(**{self.container: changed})

    def value_of(self, text: str) -> float:
        """The number that `text` stands for, or the index of the reading of that name.

        Raises:
          ValueError: naming the path, the text and what is allowed.
        """
        if text in self.readings:
            return float(self.readings.index(text))
        try:
            value = float(text)
        except ValueError:
            refuse(self.path, text, ", ".join(self.readings) or "a number")
        if self.readings:
            refuse(self.path, text, ", ".join(self.readings))
        if not np.isfinite(value) or (self.is_whole and value != int(value)):
            refuse(self.path, text, "an integer" if self.is_whole else "a finite number")
        return value

    def text_of(self, value: float) -> str:
        """What `value_of` takes for a value."""
        return self.readings[int(value)] if self.readings else repr(value)

    def values_of(self, text: str) -> tuple[float, ...]:
        """The values that `text` stands for, ascending: a list a,b,c, or start:stop:count, or start:stop:count:log.

        Raises:
          ValueError: naming the path, the text and what is allowed.
        """
        values = self._spread(text) if ":" in text else [self.value_of(part.strip()) for part in text.split(",")]
        if len(set(values)) < len(values):
            refuse(self.path, text, "values that differ")
        return tuple(sorted(values))

    def _spread(self, text: str) -> list[float]:
        allowed = f"start:stop:count or start:stop:count:log, with 2 to {_MOST_VALUES} values, or a list a,b,c"
        start, stop, count, *scale = [*text.split(":"), "", ""][: max(3, text.count(":") + 1)]
        if self.readings or scale not in ([], ["log"]) or not count.isdecimal() or not 2 <= int(count) <= _MOST_VALUES:
            refuse(self.path, text, ", ".join(self.readings) or allowed)
        ends = self.value_of(start), self.value_of(stop)
        if scale and min(ends) <= 0:
            refuse(self.path, text, "numbers > 0 on a logarithmic scale")
        spread = np.geomspace if scale else np.linspace
        # As a person would write it: 0.3, where the sum of tenths gives 0.30000000000000004.
        return [self.value_of(f"{value:.10g}") for value in spread(*ends, int(count))]


def parameter_at(path: str, point: Points) -> Parameter:
    """The parameter at a path, in containers of the shapes of `point`.

    Raises:
      ValueError: naming the path, the part that is wrong and what is allowed in its place.
    """
    root, *parts = path.split(".")
    if root not in _ROOTS:
        hint = "; the fields of Config decide shapes and code, which all points share" if root == "config" else ""
        refuse(path, root, f"{' or '.join(_ROOTS)} before the first dot{hint}")
    container = getattr(point, _ROOTS[root])
    starts = [parts]
    if root == "env" and parts[:1] == ["all"]:
        field = _take(path, parts, 1, _fields_of(container.road))
        starts = [[name, *parts[1:]] for name in FACTORS if hasattr(getattr(container, name), field)]
    entries = tuple(_entry(path, start, container) for start in starts)
    leaf = _leaf(container, entries[0])
    is_whole = jnp.issubdtype(leaf.dtype, jnp.integer)
    return Parameter(path, _ROOTS[root], entries, _readings_of(container, entries[0].fields), is_whole)


def _leaf(container: Any, entry: Entry) -> jax.Array:
    for name in entry.fields:
        container = getattr(container, name)
    return container


def _entry(path: str, parts: list[str], container: Any) -> Entry:
    """Follows fields, then indices, as far as there are any."""
    fields: list[str] = []
    while dataclasses.is_dataclass(container):
        _refuse_static(path, parts[len(fields) :], container)
        fields.append(_take(path, parts, len(fields), _fields_of(container)))
        container = getattr(container, fields[-1])
    index: list[int] = []
    for size in container.shape:
        names = [str(i) for i in range(size)]
        aliases = ["low", "high"] if size == 2 and fields[-1] in _LOW_AND_HIGH else []
        part = _take(path, parts, len(fields) + len(index), [*names, *aliases])
        index.append(int(part) if part in names else aliases.index(part))
    if len(parts) > len(fields) + len(index):
        refuse(path, parts[-1], f"nothing more, {'.'.join(path.split('.')[:-1])} is a number")
    return Entry(tuple(fields), tuple(index))


def _fields_of(container: Any) -> list[str]:
    """The fields that may differ between the points of one program."""
    if isinstance(container, Container):
        fields = [name for name, f in schema_of(container).items() if f.kind not in (Kind.SETTING, Kind.DERIVED)]
    else:
        fields = [f.name for f in dataclasses.fields(container) if f.metadata.get("pytree_node", True)]
    return fields + (["all"] if "channel" in fields else [])


def _readings_of(container: Any, fields: tuple[str, ...]) -> tuple[str, ...]:
    if isinstance(container, Container):
        return field_at(type(container), ".".join(fields)).names
    return _READINGS.get(fields[-1], ())


def _refuse_static(path: str, parts: list[str], container: Any) -> None:
    """Says of a field that is there why it cannot be set."""
    part = parts[0] if parts else ""
    if isinstance(container, Container) and part in schema_of(container) and _is_derived(container, part):
        refuse(path, part, "what a radar is made from; this is derived from it")
    if part in [f.name for f in dataclasses.fields(container)] and part not in _fields_of(container):
        refuse(path, part, "numbers that leave shapes and code alone; this one belongs into the base")


def _is_derived(container: Container, name: str) -> bool:
    return schema_of(container)[name].kind is Kind.DERIVED


def _take(path: str, parts: list[str], position: int, allowed: list[str]) -> str:
    """The part at a position, which must be one of those allowed."""
    if position < len(parts) and parts[position] in allowed:
        return parts[position]
    given = path.split(".")
    before = ".".join(given[: len(given) - len(parts) + position]) if len(given) > position else path
    found = parts[position] if position < len(parts) else ""
    refuse(path, found, f"after {before} one of {', '.join(allowed)}")


def _replaced(container: Any, fields: tuple[str, ...], index: tuple[int, ...], value: float) -> Any:
    name, *rest = fields
    old = getattr(container, name)
    new = _replaced(old, tuple(rest), index, value) if rest else _changed(name, old, index, value)
    return container.replace(**{name: new})  # of a radar, with the bank that fits


def _changed(name: str, array: jax.Array, index: tuple[int, ...], value: float) -> jax.Array:
    changed = np.array(array)
    if name in _DISTRIBUTIONS:
        others = np.arange(changed.size) != index[0]
        kept = changed[others].astype(np.float64)
        shares = kept / kept.sum() if kept.sum() > 0 else np.full(kept.size, 1 / max(kept.size, 1))
        changed[others] = (1.0 - value) * shares
    changed[index] = value
    return jnp.asarray(changed)
