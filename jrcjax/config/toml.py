"""Environments as TOML files: `load_params` reads what people write, `save_params` writes any `EnvParams` exactly.

Keys are the fields of `EnvParams`, `Channel`, `Factor` and `Radar`, readings by name. A file describes a whole
environment, or names one of the paper's (`environment`, `preset`) and what differs from it.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jrcjax.checks import as_array, refuse
from jrcjax.model.channel import Channel
from jrcjax.model.params import FACTORS, EnvParams, check_all_but_radar, check_params, make_factor
from jrcjax.model.presets import ENVIRONMENTS, PRESETS, paper_params
from jrcjax.radar.modes import Radar, make_radar
from jrcjax.radar.paper import MAX_DENSITY
from jrcjax.types import (
    COUNT_MODELS,
    COUNTING_RULES,
    DISTANCES,
    EVENT_MODELS,
    MISS_CONVENTIONS,
    PLACEMENTS,
    Int,
    choice,
)

_NUMBERS, _INTEGERS, _FLAG = "numbers", "integers", "true or false"


class _Key(NamedTuple):
    """What one key of a file holds."""

    kind: str | tuple[str, ...]
    """_NUMBERS, _INTEGERS, _FLAG, or the names of a reading."""
    comment: str
    """Shape and unit, written beside the value."""
    required: bool = False


_BASE = {
    "environment": _Key(ENVIRONMENTS, "column of Table I that the rest of the file changes"),
    "preset": _Key(PRESETS, "reading of Table I"),
}
_TOP = {
    "reward_weights": _Key(_NUMBERS, "rho_1 to rho_4 of equation (11)", required=True),
    "event_model": _Key(EVENT_MODELS, "how factors add up to the chance of an event"),
    "miss_convention": _Key(MISS_CONVENTIONS, "which slots count for miss detection"),
    "count_event_packets": _Key(_FLAG, "whether packets in a slot with an event count as throughput"),
    "terminal_time_limit": _Key(_FLAG, "whether the last slot is terminal"),
    "max_steps_in_episode": _Key(_INTEGERS, "slots per episode"),
}
_CHANNEL = {
    "prior": _Key(_NUMBERS, "probability per level, sum 1", required=True),
    "persistence": _Key(_NUMBERS, "probability that the level stays, in [0, 1)"),
    "received_power": _Key(_NUMBERS, "W", required=True),
    "interference": _Key(_NUMBERS, "W per level", required=True),
    "noise": _Key(_NUMBERS, "W", required=True),
    "sinr_threshold": _Key(_NUMBERS, "smallest SINR per data rate, a ratio and not dB, ascending", required=True),
    "packets": _Key(_NUMBERS, "packets per slot and data rate", required=True),
}
_FACTOR = {
    "prior": _Key(_NUMBERS, "probability per level, sum 1", required=True),
    "event_probability": _Key(_NUMBERS, "probability of an unexpected event per level", required=True),
    "persistence": _Key(_NUMBERS, "probability that the level stays, in [0, 1)"),
}
_RADAR = {
    "bandwidth": _Key(_NUMBERS, "Hz per mode", required=True),
    "slope": _Key(_NUMBERS, "Hz/s per mode", required=True),
    "max_intermediate_frequency": _Key(_NUMBERS, "Hz per mode", required=True),
    "density": _Key(_NUMBERS, "objects per 45 m x 45 m", required=True),
    "class_share": _Key(_NUMBERS, "per class of objects, sum 1", required=True),
    "size_mean": _Key(_NUMBERS, "length and width in m per class", required=True),
    "size_std": _Key(_NUMBERS, "their standard deviations in m", required=True),
    "distance": _Key(DISTANCES, "between objects that are to be resolved"),
    "counting_rule": _Key(COUNTING_RULES, "which objects count as detected"),
    "count_model": _Key(COUNT_MODELS, "number of objects, given its mean"),
    "placements": _Key(PLACEMENTS, "drawn from a bank, or made in every slot"),
    "bank_size": _Key(_INTEGERS, "placements per mode"),
    "bank_seed": _Key(_INTEGERS, "of the placements"),
    "max_density": _Key(_NUMBERS, "largest density that may be set under vmap"),
    "max_objects": _Key(_INTEGERS, "the same as slots for objects per mode"),
}
_TABLES = {"channel": _CHANNEL, **dict.fromkeys(FACTORS[1:], _FACTOR), "radar": _RADAR}


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
        return from_toml(Path(path).read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def save_params(path: str | Path, params: EnvParams) -> None:
    """Writes an environment to a TOML file from which `load_params` makes the same one, to the last bit.

    The bank of placements is not written but drawn again from its seed.

    Raises:
      ValueError: for parameters that `check_params` refuses, before the file is touched.
    """
    Path(path).write_text(to_toml(params), encoding="utf-8")


def from_toml(text: str) -> EnvParams:
    """The environment that the text of a file describes; see `load_params`."""
    return params_of(description_of(text))


def description_of(text: str) -> dict[str, Any]:
    """What the text of a file says, key by key and table by table.

    Raises:
      ValueError: for keys that are unknown and values of the wrong kind, naming them and what is allowed.
    """
    return _checked(tomllib.loads(text))


def params_of(description: dict[str, Any]) -> EnvParams:
    """The environment that a description (see `description_of`) is of.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    given = dict(description)
    base = {name: given.pop(name) for name in _BASE if name in given}
    paper = paper_params(**base) if base else None
    radar = paper.radar if paper and "radar" not in given else None  # with its bank, which takes seconds to build
    if paper:
        given = _merged(_description(paper), given)
    for prefix, keys, table in _tables_of(given):
        for name, key in keys.items():
            if key.required and name not in table:
                refuse(f"{prefix}{name}", "missing", f"{key.kind}, {key.comment}")
    params = EnvParams(
        channel=_channel(given["channel"]),
        **{name: make_factor(**_arrays(name, given[name])) for name in FACTORS[1:]},
        radar=radar,  # pyright: ignore[reportArgumentType]  # built last, when the rest is known to be good
        reward_weights=jnp.asarray(as_array("reward_weights", given["reward_weights"], _NUMBERS)),
        event_model=_reading("event_model", given, EVENT_MODELS),
        miss_convention=_reading("miss_convention", given, MISS_CONVENTIONS),
        count_event_packets=jnp.int32(given.get("count_event_packets", True)),
        terminal_time_limit=jnp.int32(given.get("terminal_time_limit", False)),
        **{name: given[name] for name in ("max_steps_in_episode",) if name in given},
    )
    check_all_but_radar(params)
    params = dataclasses.replace(params, radar=radar or _radar(given["radar"]))
    check_params(params)
    return params


def to_toml(params: EnvParams) -> str:
    """The text of a file that describes `params` without reference to a preset; see `save_params`."""
    check_params(params)
    return "# An environment of jrcjax; jrcjax.load_params reads it.\n" + text_of(_description(params))


def text_of(description: dict[str, Any]) -> str:
    """The text of a file with this description; the same for equal ones."""
    lines = [f"{name} = {_toml(description[name])}  # {_BASE[name].comment}" for name in _BASE if name in description]
    for prefix, keys, table in _tables_of(description):
        if prefix and table:
            lines += ["", f"[{prefix.rstrip('.')}]"]
        lines += [f"{name} = {_toml(table[name])}  # {key.comment}" for name, key in keys.items() if name in table]
    return "\n".join(lines).lstrip("\n") + "\n"


def _tables_of(description: dict[str, Any]) -> Iterator[tuple[str, dict[str, _Key], dict[str, Any]]]:
    """(prefix of dotted names, keys, table) of the file and of each of its tables."""
    yield "", _TOP, description
    for name, keys in _TABLES.items():
        yield f"{name}.", keys, description.get(name, {})


def _checked(given: dict[str, Any]) -> dict[str, Any]:
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
                _check_kind(f"{prefix}{name}", value, keys[name].kind)
    for name in _BASE.keys() & given.keys():
        _check_kind(name, given[name], _BASE[name].kind)
    return given


def _check_kind(field: str, value: Any, kind: str | tuple[str, ...]) -> None:
    if isinstance(kind, tuple):
        allowed = ", ".join(map(repr, kind))
        if value not in kind:
            refuse(field, str(value), allowed)
    elif kind == _FLAG:
        if not isinstance(value, bool):
            refuse(field, str(value), kind)
    elif isinstance(value, list):
        for entry in value:
            _check_kind(field, entry, kind)
    elif isinstance(value, bool) or not isinstance(value, int if kind == _INTEGERS else int | float):
        refuse(field, str(value), kind)


def _merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    """The paper's description with changes; it holds as large a density as the paper's, as its presets do."""
    del base["radar"]["max_objects"]
    base["radar"]["max_density"] = MAX_DENSITY
    if "max_objects" in changes.get("radar", {}):
        del base["radar"]["max_density"]
    tables = {name: base[name] | changes.get(name, {}) for name in _TABLES}
    return base | changes | tables


def _arrays(prefix: str, table: dict[str, Any]) -> dict[str, Any]:
    return {name: jnp.asarray(as_array(f"{prefix}.{name}", value, _NUMBERS)) for name, value in table.items()}


def _reading(field: str, table: dict[str, Any], names: tuple[str, ...]) -> Int:
    return jnp.int32(choice(field, table.get(field, names[0]), names))


def _channel(table: dict[str, Any]) -> Channel:
    return Channel(**_arrays("channel", {"persistence": 0.0} | table))


def _radar(table: dict[str, Any]) -> Radar:
    table = dict(table)
    slots = table.pop("max_objects", None)
    if slots is None:
        return make_radar(**table)
    if "max_density" in table:
        refuse("radar.max_density", table["max_density"], "either max_density or max_objects, not both")
    # A number of slots is part of the compiled programs' shapes; an object is the same in any that holds it.
    return dataclasses.replace(make_radar(**table), max_objects=tuple(slots) if isinstance(slots, list) else slots)


def _description(params: EnvParams) -> dict[str, Any]:
    """Plain numbers, names and flags of an environment, table by table."""
    tables = {name: _values(getattr(params, name), keys) for name, keys in _TABLES.items()}
    tables["radar"]["bank_size"] = params.radar.miss_bank.shape[-1]
    return _values(params, _TOP) | tables


def _values(container: Any, keys: dict[str, _Key]) -> dict[str, Any]:
    return {name: _value(getattr(container, name), key.kind) for name, key in keys.items() if hasattr(container, name)}


def _value(field: Any, kind: str | tuple[str, ...]) -> Any:
    if isinstance(kind, tuple):
        return field if isinstance(field, str) else kind[int(field)]
    if kind == _FLAG:
        return bool(field)
    return _plain(np.asarray(field, np.float32 if kind == _NUMBERS else None))


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
