"""Containers: frozen pytrees of named fields, and the one place that says what a field may hold.

A field's annotation, such as `Float[Array, " K"]`, gives its shape. One of the functions `number`, `integer`, `flag`,
`reading`, `count`, `option`, `setting`, `part` and `derived` gives the rest: unit, allowed values, traced or static.
Checks, parameter files, dotted paths, saved agents and the reference all read this declaration through `schema_of`.

Numbers that people type become arrays when a container is made. JAX makes containers without that step, so leaves of
any kind (tracers, None, numbers of axes) pass through its transformations as they are.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, get_type_hints

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax.checks import (
    is_ascending,
    is_distribution,
    is_not_negative,
    is_positive,
    is_probability,
    refuse,
    require,
    require_integer,
    require_type,
)
from jrcjax.readings import Reading


class Allowed(NamedTuple):
    """The numbers that a field may hold."""

    test: Callable[[np.ndarray], Any]
    """Array to booleans."""
    words: str
    """The same for people, after "a number" or "numbers"."""


POSITIVE = Allowed(is_positive, "> 0")
NOT_NEGATIVE = Allowed(is_not_negative, ">= 0")
PROBABILITY = Allowed(is_probability, "in [0, 1]")
BELOW_ONE = Allowed(lambda x: (x >= 0) & (x < 1), "in [0, 1)")
DISTRIBUTION = Allowed(is_distribution, "in [0, 1] that sum to 1")
ASCENDING = Allowed(is_ascending, "> 0 and ascending")
ANY = Allowed(lambda x: True, "")

AXES = {"J": "level", "L": "data rate", "K": "radar mode", "C": "class of objects", "B": "placement in the bank"}
"""Letter of an axis to what it counts."""


class Kind(Enum):
    """What sort of thing a field holds."""

    NUMBER = "numbers"
    """float32, traced."""
    INTEGER = "integers"
    """int32, traced."""
    FLAG = "true or false"
    """int32 0 or 1, traced."""
    READING = "a reading"
    """int32, the number of a reading, traced."""
    SETTING = "a setting"
    """Anything that decides shapes or code, static."""
    PART = "a container"
    DERIVED = "derived"
    """float32, follows from the other fields, traced."""


class Field(NamedTuple):
    """What one field of a container may hold."""

    name: str
    kind: Kind
    axes: tuple[str, ...] = ()
    """Letters or sizes of its axes."""
    allowed: Allowed = ANY
    unit: str = ""
    names: tuple[str, ...] = ()
    """Of the readings, or of an option's values."""
    verify: Callable[[str, Any], None] | None = None
    """For a setting: (dotted name, value) is refused or not."""
    part: type[Container] | None = None
    required: bool = True
    """Whether it has no default."""

    @property
    def is_array(self) -> bool:
        """Whether it holds numbers that may be traced and vmapped over."""
        return self.kind not in (Kind.SETTING, Kind.PART)

    @property
    def words(self) -> str:
        """What it may hold, for people."""
        if self.names:
            return ", ".join(f"{i} ({name})" for i, name in enumerate(self.names)) if self.is_array else _or(self.names)
        if self.kind is Kind.FLAG:
            return "0 or 1"
        unit = f" {self.unit}" if self.unit else ""
        if not self.axes:
            noun = "an integer" if self.kind is Kind.INTEGER else "a number"
            return f"{noun} {self.allowed.words}{unit}".strip()
        each = " and ".join(AXES[axis] for axis in self.axes if axis in AXES)
        size = " x ".join(axis for axis in self.axes if axis not in AXES)
        number = f"numbers, {size or 'one'} per {each}," if each else f"{size} numbers"
        return f"{number} {self.allowed.words}{unit}"


def _or(names: tuple[str, ...]) -> str:
    return ", ".join(map(repr, names))


def _field(kind: Kind, default: Any = dataclasses.MISSING, **about: Any) -> Any:
    declared = {"kind": kind, "required": default is dataclasses.MISSING, **about}
    return dataclasses.field(default=default, metadata={"declared": declared}, init=kind is not Kind.DERIVED)


def number(allowed: Allowed, unit: str = "", *, default: Any = dataclasses.MISSING) -> Any:
    """A field of float32 numbers."""
    return _field(Kind.NUMBER, default, allowed=allowed, unit=unit)


def integer(allowed: Allowed, *, default: Any = dataclasses.MISSING) -> Any:
    """A field of int32 integers."""
    return _field(Kind.INTEGER, default, allowed=allowed)


def flag(*, default: bool) -> Any:
    """A field that is 1 for yes and 0 for no."""
    return _field(Kind.FLAG, default, allowed=Allowed(lambda x: np.isin(x, (0, 1)), "0 or 1"))


def reading(readings: type[Reading]) -> Any:
    """A field with the number of a reading; the first is the default."""
    known = Allowed(lambda x: np.isin(x, [int(member) for member in readings]), "")
    return _field(Kind.READING, next(iter(readings)), allowed=known, names=readings.names())


def count(least: int = 1, *, default: int) -> Any:
    """A static Python integer."""
    return setting(lambda field, value: require_integer(field, value, least), default=default)


def option(names: tuple[str, ...]) -> Any:
    """A static choice by name; the first is the default."""

    def verify(field: str, value: Any) -> None:
        if not isinstance(value, str) or value not in names:
            refuse(field, str(value), _or(names))

    return _field(Kind.SETTING, names[0], verify=verify, names=names)


def setting(verify: Callable[[str, Any], None], *, default: Any = dataclasses.MISSING) -> Any:
    """A static field of any type, with its own check."""
    return _field(Kind.SETTING, default, verify=verify)


def part(kind: type[Container]) -> Any:
    """A field that is itself a container."""
    return _field(Kind.PART, part=kind)


def derived(allowed: Allowed) -> Any:
    """A field of float32 numbers that the container makes from its other fields."""
    return _field(Kind.DERIVED, allowed=allowed)


class Container:
    """A frozen dataclass and pytree; see the module's docstring. Fields are given by keyword."""

    if TYPE_CHECKING:
        __dataclass_fields__: ClassVar[dict[str, Any]]

        def __init__(self, **fields: Any) -> None: ...

    _schema: ClassVar[dict[str, Field]]

    def __init_subclass__(cls) -> None:
        """Makes a class with field declarations a dataclass and a pytree."""
        dataclasses.dataclass(frozen=True, eq=False, kw_only=True)(cls)
        cls.__init__.__annotations__.clear()  # it also takes plain numbers, which fields do not hold
        hints = get_type_hints(cls)
        cls._schema = {}
        for field in dataclasses.fields(cls):
            axes = tuple(getattr(hints[field.name], "dim_str", "").split())
            cls._schema[field.name] = Field(field.name, axes=axes, **field.metadata["declared"])
        _register(cls)

    def __post_init__(self) -> None:
        """Turns numbers into arrays; what cannot become one stays, and checks refuse it by its full name."""
        for name, field in self._schema.items():
            if field.is_array and field.kind is not Kind.DERIVED:
                object.__setattr__(self, name, _admitted(getattr(self, name), field))

    def replace(self, **changes: Any) -> Self:
        """A copy with the given fields changed, and what is derived from them.

        Raises:
          ValueError: for a name that is no field, or that of a derived one.
        """
        known = [name for name, field in self._schema.items() if field.kind is not Kind.DERIVED]
        for name in changes:
            if name not in known:
                refuse(f"{type(self).__name__}.replace", name, f"the fields {', '.join(known)}")
        return dataclasses.replace(self, **changes)

    @classmethod
    def restored(cls, values: Mapping[str, Any]) -> Self:
        """A container of these fields as they are, the derived ones included: nothing is converted or made anew."""
        container = object.__new__(cls)
        vars(container).update((name, values[name]) for name in cls._schema)
        return container

    def check(self, name: str = "") -> None:
        """Refuses wrong shapes and, where they are known, numbers that are not allowed.

        Args:
          name: dotted name of this container, for messages.

        Raises:
          ValueError: naming the field, the value and what is allowed.
        """
        sizes: dict[str, tuple[int, str]] = {}
        for field in self._schema.values():
            if hasattr(self, field.name):  # what is derived may still be missing
                _check_field(f"{name}.{field.name}".lstrip("."), getattr(self, field.name), field, sizes)


def schema_of(kind: type[Container] | Container) -> dict[str, Field]:
    """The fields of a kind of container by name."""
    return dict(kind._schema)


def check_value(kind: type[Container], name: str, value: Any) -> None:
    """Refuses what a field of a container may not hold, for a container that is still to be made.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    field = kind._schema[name]
    _check_field(name, _admitted(value, field) if field.is_array else value, field, {})


def _register(cls: type[Container]) -> None:
    """Registers a class whose objects JAX takes apart and puts together without `__init__`."""
    data = tuple(name for name, field in cls._schema.items() if field.kind is not Kind.SETTING)
    static = tuple(name for name in cls._schema if name not in data)
    keys = tuple(map(jax.tree_util.GetAttrKey, data))

    def leaves_of(container: Container) -> tuple[Any, ...]:
        return tuple(getattr(container, name) for name in data)

    def settings_of(container: Container) -> tuple[Any, ...]:
        return tuple(getattr(container, name) for name in static)

    def with_keys(container: Container):
        return tuple(zip(keys, leaves_of(container), strict=True)), settings_of(container)

    def unflatten(settings: tuple[Any, ...], leaves: Any) -> Container:
        return cls.restored({**dict(zip(data, leaves, strict=True)), **dict(zip(static, settings, strict=True))})

    jax.tree_util.register_pytree_with_keys(
        cls, with_keys, unflatten, lambda container: (leaves_of(container), settings_of(container))
    )


def _admitted(value: Any, field: Field) -> Any:
    """`value` as an array of the field's type, if it is made of numbers of that kind."""
    if isinstance(value, str) and value in field.names:
        value = field.names.index(value)
    dtype = np.float32 if field.kind is Kind.NUMBER else np.int32
    kinds = {Kind.NUMBER: "iuf", Kind.FLAG: "iub"}.get(field.kind, "iu")
    if isinstance(value, jax.Array):  # a tracer is one, too
        fits = not jnp.issubdtype(value.dtype, jax.dtypes.extended) and value.dtype.kind in kinds
        as_it_is = value.dtype == dtype and not value.weak_type
        return jnp.asarray(value, dtype) if fits and not as_it_is else value
    if not isinstance(value, int | float | list | tuple | np.ndarray | np.generic):
        return value
    try:
        given = np.asarray(value)
    except (TypeError, ValueError):  # ragged
        return value
    with np.errstate(all="ignore"):
        if given.dtype.kind not in kinds or (kinds != "iuf" and (given.astype(dtype) != given).any()):
            return value
        with jax.ensure_compile_time_eval():  # numbers stay numbers, also while a program is traced
            return jnp.asarray(given.astype(dtype))


def _check_field(name: str, value: Any, field: Field, sizes: dict[str, tuple[int, str]]) -> None:
    """Checks one field; `sizes` holds how long axes are and which field says so, and learns new ones."""
    if field.part is not None:
        require_type(name, value, field.part)
        value.check(name)
    elif field.verify is not None:
        field.verify(name, value)
    else:
        shape = tuple(int(axis) if axis.isdecimal() else sizes.get(axis, (None,))[0] for axis in field.axes)
        known = {f"{other} has {size}" for size, other in (sizes[axis] for axis in field.axes if axis in sizes)}
        words = f"{field.words} ({', '.join(known)})" if known else field.words
        kinds = "iuf" if field.kind in (Kind.NUMBER, Kind.DERIVED) else "iu"
        require(name, value, shape, field.allowed.test, words, kinds)
        for axis, size in zip(field.axes, np.shape(value), strict=True):
            sizes.setdefault(axis, (size, name))
