"""Numbers of an environment, of the hyperparameters and of the settings by dotted path.

A path such as env.speed.event_probability.high follows the fields of `EnvParams` (after env), of `HParams` (after
hparams) or of `Config` (after config), and ends with an index for each axis of an array. Where factors have two levels,
and channels two rates, low and high are the indices 0 and 1. In place of a factor, `all` stands for every factor that
has the field.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jrcjax.checks import refuse
from jrcjax.containers import Container, Kind, schema_of
from jrcjax.learners.hparams import CLIPPINGS, FORMS, OPTIMISERS, TARGET_UPDATES, Config, HParams
from jrcjax.model.params import FACTORS, EnvParams
from jrcjax.named import field_at


class Points(NamedTuple):
    """What differs between points: of one point, or with a leading axis of points on every leaf."""

    params: EnvParams
    hparams: HParams


_ROOTS = {"env": "params", "hparams": "hparams", "config": "config"}
DISTRIBUTIONS = ("prior", "class_share")
"""Fields whose entries sum to 1."""
_LOW_AND_HIGH = ("prior", "event_probability", "interference", "packets", "sinr_threshold")
_STATIC_READINGS = {
    "optimiser": OPTIMISERS,
    "form": FORMS,
    "target_update": TARGET_UPDATES,
    "gradient_clipping": CLIPPINGS,
}
_SHARED = ("episodes", "demonstrations")  # dimensions of results, the same at all points
_MOST_VALUES = 1000


class Entry(NamedTuple):
    """One number of a container."""

    fields: tuple[str, ...]
    index: tuple[int, ...]


class Range(NamedTuple):
    """What a sample of a parameter is drawn from."""

    low: float
    high: float
    is_log: bool = False
    levels: tuple[float, ...] = ()
    """The values themselves, if they are a list; then `low` and `high` say nothing."""


class Parameter(NamedTuple):
    """One number, or the same number of all factors."""

    path: str
    container: str
    """Field of `Points` that it is in, or config."""
    entries: tuple[Entry, ...]
    readings: tuple[str, ...]
    """Names of its values, if it is the index of a reading."""
    is_whole: bool
    """Whether it is an integer."""

    def overlaps(self, other: Parameter) -> bool:
        """Whether setting one may change the other, as entries of one distribution do."""

        def touched(parameter: Parameter) -> set:
            kept = ((e.fields, () if e.fields[-1] in DISTRIBUTIONS else e.index) for e in parameter.entries)
            return {(parameter.container, *entry) for entry in kept}

        return bool(touched(self) & touched(other))

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
        held = np.float32(value) if abs(value) <= np.finfo(np.float32).max else np.inf
        if (self.is_whole and abs(value) >= 2**31) or not np.isfinite(held) or (held == 0) != (value == 0):
            refuse(
                self.path, text, f"a number that fits {'32 bits' if self.is_whole else 'float32, and is not 0 in it'}"
            )
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
        if len(set(np.asarray(values, np.int64 if self.is_whole else np.float32).tolist())) < len(values):
            refuse(self.path, text, "values that differ" if self.is_whole else "values that differ in float32")
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

    def range_of(self, text: str) -> Range:
        """The range that `text` stands for: low:high, low:high:log, or a list a,b,c of values to choose from.

        Raises:
          ValueError: naming the path, the text and what is allowed.
        """
        if ":" not in text:
            return Range(0.0, 0.0, levels=self.values_of(text))
        low, high, *scale = text.split(":")
        if self.readings or scale not in ([], ["log"]):
            refuse(self.path, text, ", ".join(self.readings) or "low:high, low:high:log, or a list a,b,c")
        ends = self.value_of(low), self.value_of(high)
        if not ends[0] < ends[1] or (scale and ends[0] <= 0):
            refuse(self.path, text, "low < high" + ", both > 0 on a logarithmic scale" * bool(scale))
        return Range(*ends, is_log=bool(scale))


def parameter_at(path: str, point: Points) -> Parameter:
    """The parameter at a path, in containers of the shapes of `point`.

    Raises:
      ValueError: naming the path, the part that is wrong and what is allowed in its place.
    """
    root, *parts = path.split(".")
    if root not in _ROOTS:
        refuse(path, root, f"{', '.join(_ROOTS)} before the first dot")
    if root == "config":
        return _setting(path, parts)
    container = getattr(point, _ROOTS[root])
    starts = [parts]
    if root == "env" and parts[:1] == ["all"]:
        field = _take(path, parts, 1, _fields_of(container.road))
        starts = [[name, *parts[1:]] for name in FACTORS if hasattr(getattr(container, name), field)]
    entries = tuple(_entry(path, start, container) for start in starts)
    is_whole = jnp.issubdtype(leaf_of(container, entries[0]).dtype, jnp.integer)
    return Parameter(path, _ROOTS[root], entries, _readings_of(container, entries[0].fields), is_whole)


def leaf_of(container: Any, entry: Entry) -> Any:
    """The array that holds a number."""
    for name in entry.fields:
        container = getattr(container, name)
    return container


def number_at(parameter: Parameter, point: Points) -> float:
    """The number of one point, the first of those that a parameter sets; not of `Config`."""
    entry = parameter.entries[0]
    return float(np.asarray(leaf_of(getattr(point, parameter.container), entry))[entry.index])


def _setting(path: str, parts: list[str]) -> Parameter:
    """A field of `Config`, which decides shapes or code: points that differ in it are programs of their own."""
    defaults = {field.name: getattr(Config(), field.name) for field in dataclasses.fields(Config)}
    allowed = [
        name
        for name, value in defaults.items()
        if name not in _SHARED and (name in _STATIC_READINGS or type(value) is int)
    ]
    name = _take(path, parts, 0, allowed)
    if len(parts) > 1:
        refuse(path, parts[-1], f"nothing more, config.{name} is a number or a name")
    return Parameter(path, "config", (Entry((name,), ()),), _STATIC_READINGS.get(name, ()), True)


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
    fields = [name for name, f in schema_of(container).items() if f.kind not in (Kind.SETTING, Kind.DERIVED)]
    return fields + (["all"] if "channel" in fields else [])


def _readings_of(container: Any, fields: tuple[str, ...]) -> tuple[str, ...]:
    return field_at(type(container), ".".join(fields)).names


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
