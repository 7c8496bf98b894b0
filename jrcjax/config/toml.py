"""Environments as TOML files: `load_params` reads what people write, `save_params` writes any `EnvParams` exactly.

Keys are the fields of `EnvParams`, `Channel`, `Factor` and `Radar`, readings by name. A file describes a whole
environment, or names one of the paper's (`environment`, `preset`) and what differs from it.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jrcjax.checks import refuse
from jrcjax.containers import POSITIVE, Container, Field, Kind, check_value, schema_of
from jrcjax.files import write_text
from jrcjax.model.params import EnvParams, check_params
from jrcjax.model.presets import ENVIRONMENTS, PRESETS, without_bank
from jrcjax.radar.bank import Radar, make_radar
from jrcjax.radar.paper import MAX_DENSITY

Schema = dict[str, Field]
Description = dict[str, Any]

_BASE: Schema = {
    "environment": Field("environment", Kind.SETTING, names=ENVIRONMENTS, required=False),
    "preset": Field("preset", Kind.SETTING, names=PRESETS, required=False),
}
_ROOM = Field("max_density", Kind.NUMBER, (), POSITIVE, "objects that max_objects leaves room for", required=False)


def _keys_of(kind: type[Container]) -> Schema:
    """What a table may hold: the fields of a container that are neither derived nor tables of their own."""
    keys = {n: field for n, field in schema_of(kind).items() if field.kind not in (Kind.DERIVED, Kind.PART)}
    return keys | ({_ROOM.name: _ROOM} if kind is Radar else {})


_PARTS = {name: field.part for name, field in schema_of(EnvParams).items() if field.part is not None}
_TOP = _keys_of(EnvParams)
_TABLES = {name: _keys_of(kind) for name, kind in _PARTS.items()}


def load_params(path: str | Path) -> EnvParams:
    """The environment that a TOML file describes.

    Args:
      path: a file as `save_params` writes it. Keys with a default may be left out; after `environment = "target"` or
        `preset = "paper"` (see `paper_params`) all may, and what is there replaces the paper's value.

    Raises:
      ValueError: naming the file, the field, the value and what is allowed.
      OSError: if the file can't be read.
    """
    try:
        return from_toml(Path(path).read_text(encoding="utf-8-sig"))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def save_params(path: str | Path, params: EnvParams) -> None:
    """Writes an environment to a TOML file from which `load_params` makes the same one, to the last bit.

    The bank of placements is not written but drawn again from its seed.

    Raises:
      ValueError: for parameters that `check_params` refuses, before the file is touched.
    """
    write_text(Path(path), to_toml(params))


def from_toml(text: str) -> EnvParams:
    """The environment that the text of a file describes; see `load_params`."""
    return params_of(description_of(text))


def description_of(text: str, also: tuple[str, ...] = ()) -> Description:
    """What the text of a file says, key by key and table by table.

    Args:
      text: of the file.
      also: names of further keys, whose values the caller checks.

    Raises:
      ValueError: for keys that are unknown and values of the wrong kind, naming them and what is allowed.
    """
    try:
        given = tomllib.loads(text)
        others = {name: given.pop(name) for name in also if name in given}
        return _checked(given) | others
    except RecursionError:
        raise ValueError("nested too deeply; allowed: the tables and lists that save_params writes") from None


def params_of(description: Description) -> EnvParams:
    """The environment that a description (see `description_of`) is of.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    given = dict(description)
    base = {name: given.pop(name) for name in _BASE if name in given}
    if base:
        given = _merged(_description(without_bank(**base)), given)
    for prefix, keys, table in _tables_of(given):
        for name, field in keys.items():
            if field.required and name not in table:
                refuse(f"{prefix}{name}", "missing", field.words)
    top = {name: value for name, value in given.items() if name not in _TABLES}
    tables = {name: kind(**given[name]) for name, kind in _PARTS.items() if kind is not Radar}
    for name, container in tables.items():  # before a bank is built, which takes seconds
        container.check(name)
    for name, value in top.items():
        check_value(EnvParams, name, value)
    params = EnvParams(**top, **tables, radar=_radar(given["radar"]))
    check_params(params)
    return params


def to_toml(params: EnvParams) -> str:
    """The text of a file that describes `params` without reference to a preset; see `save_params`."""
    check_params(params)
    return "# An environment of jrcjax; jrcjax.load_params reads it.\n" + text_of(_description(params))


def text_of(description: Description) -> str:
    """The text of a file with this description; the same for equal ones."""
    lines = [f"{name} = {_toml(description[name])}  # {_BASE[name].words}" for name in _BASE if name in description]
    for prefix, keys, table in _tables_of(description):
        if prefix and table:
            lines += ["", f"[{prefix.rstrip('.')}]"]
        lines += [f"{name} = {_toml(table[name])}  # {_comment(keys[name])}" for name in keys if name in table]
    return "\n".join(lines).lstrip("\n") + "\n"


def _comment(field: Field) -> str:
    if field.names:
        return ", ".join(field.names)
    return {Kind.FLAG: field.kind.value, Kind.SETTING: "an integer, or one per radar mode"}.get(field.kind, field.words)


def _tables_of(description: Description) -> Iterator[tuple[str, Schema, Description]]:
    """(prefix of dotted names, keys, table) of the file and of each of its tables."""
    yield "", _TOP, description
    for name, keys in _TABLES.items():
        yield f"{name}.", keys, description.get(name, {})


def _checked(given: Description) -> Description:
    """The same description, if all its keys are known and their values are of the right kind."""
    for name in given:
        if name not in _BASE | _TOP | _TABLES:
            refuse(name, "an unknown key", ", ".join([*_BASE, *_TOP, *_TABLES]))
    for name in _TABLES:
        if not isinstance(given.get(name, {}), dict):
            refuse(name, str(given[name]), f"a table [{name}]")
    for prefix, keys, table in _tables_of(given):
        for name, value in table.items():
            if prefix and name not in keys:
                refuse(f"{prefix}{name}", "an unknown key", ", ".join(keys))
            if name in keys:
                _check_kind(f"{prefix}{name}", value, keys[name])
    for name in _BASE.keys() & given.keys():
        _check_kind(name, given[name], _BASE[name])
    return given


def _check_kind(name: str, value: Any, field: Field) -> None:
    if field.names:
        if value not in field.names:
            refuse(name, str(value), ", ".join(map(repr, field.names)))
    elif field.kind is Kind.FLAG:
        if not isinstance(value, bool):
            refuse(name, str(value), field.kind.value)
    elif isinstance(value, list):
        for entry in value:
            _check_kind(name, entry, field)
    elif isinstance(value, bool) or not isinstance(value, int | float if field.kind is Kind.NUMBER else int):
        refuse(name, str(value), (field.kind if field.kind is Kind.NUMBER else Kind.INTEGER).value)


def _merged(base: Description, changes: Description) -> Description:
    """The paper's description with changes; it holds as large a density as the paper's, as its presets do."""
    tables = {name: base[name] | changes.get(name, {}) for name in _TABLES}
    if "max_objects" not in changes.get("radar", {}):
        del tables["radar"]["max_objects"]
        tables["radar"] = {"max_density": MAX_DENSITY} | tables["radar"]
    return base | changes | tables


def _radar(table: Description) -> Radar:
    # A number of slots is part of the compiled programs' shapes; an object is the same in any that holds it.
    slots = table.get("max_objects")
    fields: dict[str, Any] = table | {"max_objects": tuple(slots) if isinstance(slots, list) else slots}
    return make_radar(**fields)


def _description(params: EnvParams) -> Description:
    """Plain numbers, names and flags of an environment, table by table."""
    return _values(params, _TOP) | {name: _values(getattr(params, name), keys) for name, keys in _TABLES.items()}


def _values(container: Container, keys: Schema) -> Description:
    return {n: _value(getattr(container, n), field) for n, field in keys.items() if hasattr(container, n)}


def _value(value: Any, field: Field) -> Any:
    if field.kind is Kind.READING:
        return field.names[int(value)]
    if field.kind is Kind.FLAG:
        return bool(value)
    if isinstance(value, str | int):
        return value
    return _plain(np.asarray(value, np.float32 if field.kind is Kind.NUMBER else None))


def _plain(array: np.ndarray) -> Any:
    """Numbers that print in as few digits as tell them apart in their own precision."""
    if array.ndim:
        return [_plain(entry) for entry in array]
    return int(array) if array.dtype.kind in "iu" else array[()]


def _toml(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)
