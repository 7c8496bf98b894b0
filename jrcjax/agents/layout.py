"""What a file of agents holds, name by name, and the refusal of every file that holds anything else.

The file is a safetensors file. Its metadata says what it holds, as JSON, and has the checksum of the whole file, in
which the checksum's own place is zeros. Nothing is taken from a file before its size, names, types and shapes are those
that it should have.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jrcjax.checks import refuse, require_integer
from jrcjax.containers import Container, Kind, schema_of
from jrcjax.files import DamagedFile, status_of
from jrcjax.files import content_of as bytes_of
from jrcjax.learners import LEARNERS
from jrcjax.learners.hparams import Config, HParams, check_config
from jrcjax.machine import physical_memory
from jrcjax.model.params import EnvParams
from jrcjax.named import named_arrays
from jrcjax.types import choice

VERSION = 3
"""Of the layout."""
ABOUT = "jrcjax agents"
"""Key of the metadata under which a file says what it holds."""
LEARNING = tuple(name for name in LEARNERS if name != "round_robin")
"""Learners that have something to save."""
OPTAX = "optax"
"""Stands for an optimiser that had no name."""
_SEAL, _UNSEALED = "sha256", "0" * 64
_KEYS = {"threefry2x32": 2, "rbg": 4, "unsafe_rbg": 4}  # implementations and their words
_MOST_LAYERS = 100
_MOST = 1_000_000  # points, and numbers of seeds
_FIELDS = ("version", "learners", "points", "seeds", "config", "settings", "key_implementation", "provenance")


class File(NamedTuple):
    """A file as it is."""

    content: bytes
    metadata: dict[str, str]
    about: dict[str, Any]
    """What the file says of itself; its fields are those that `save_agents` writes."""
    tensors: dict[str, np.ndarray]


def content_of(tensors: dict[str, np.ndarray], about: dict[str, Any]) -> bytes:
    """The bytes of a sealed file."""
    from safetensors.numpy import save  # here, since importing the package needs it for nothing else

    plain = save({name: np.ascontiguousarray(array) for name, array in tensors.items()})
    content = _with_metadata(plain, {ABOUT: json.dumps(about), _SEAL: _UNSEALED})
    return _with_seal(content, _UNSEALED, hashlib.sha256(content).hexdigest())


def _with_metadata(content: bytes, metadata: dict[str, str]) -> bytes:
    """A safetensors file with metadata in its header; the library's own come in an order that changes."""
    start = 8 + int.from_bytes(content[:8], "little")
    header = json.dumps({"__metadata__": metadata} | json.loads(content[8:start]), separators=(",", ":")).encode()
    header += b" " * (-len(header) % 8)  # tensors start at a multiple of 8
    return len(header).to_bytes(8, "little") + header + content[start:]


def _with_seal(content: bytes, old: str, new: str) -> bytes:
    """A file with another checksum in the place of the old one."""
    before, after = (f'"{_SEAL}":"{seal}"'.encode() for seal in (old, new))
    return content.replace(before, after, 1)


def read(path: Path) -> File:
    """A file with its metadata and tensors, none of them checked.

    Raises:
      FileNotFoundError: if there is nothing.
      DamagedFile: if it is no safetensors file, or larger than the memory of this machine.
      ValueError: if it is one without agents, or of another version.
    """
    from safetensors.numpy import load

    if (size := status_of(path).st_size) > physical_memory():
        raise DamagedFile(f"it has {size} bytes, more than this machine has memory")
    content = bytes_of(path)
    try:
        header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
        metadata = header.get("__metadata__", {})
        tensors = load(content)
    except Exception as error:  # whatever readers of JSON and of safetensors say
        raise DamagedFile(f"damaged, or not a file that save_agent wrote ({str(error)[:200]})") from None
    if ABOUT not in metadata:
        raise ValueError("a safetensors file without agents; allowed: one that save_agent wrote")
    try:
        about = json.loads(metadata[ABOUT])
    except (ValueError, RecursionError):
        refuse(ABOUT, metadata[ABOUT][:50], "JSON, as save_agent writes it")
    if not isinstance(about, dict):
        refuse(ABOUT, metadata[ABOUT][:50], "an object, as save_agent writes it")
    version = about.get("version")
    if type(version) is not int or version != VERSION:
        refuse("version", repr(version), f"{VERSION}, which this jrcjax reads")
    return File(content, metadata, about, tensors)


def check(file: File) -> None:
    """Refuses fields that are not what `save_agents` writes, and tensors that don't fit them.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    about = file.about
    if set(about) != set(_FIELDS):
        refuse(ABOUT, f"the fields {sorted(about)!r}", ", ".join(_FIELDS))
    _check_list("learners", about["learners"])
    for name in about["learners"]:
        choice("learners", name, LEARNING)
    require_integer("points", about["points"], 1, _MOST)
    _check_list("seeds", about["seeds"])
    for seed in about["seeds"]:
        require_integer("seeds", seed, 0, _MOST)
    config_of(about)
    settings_of(about)
    if about["key_implementation"] not in tuple(_KEYS):
        refuse("key_implementation", repr(about["key_implementation"]), ", ".join(map(repr, _KEYS)))
    if not isinstance(about["provenance"], dict):
        refuse("provenance", repr(about["provenance"]), "an object")
    _check_tensors(file)


def check_seal(file: File) -> None:
    """Refuses a file of which any bit is not as it was written.

    Raises:
      DamagedFile: for such a file.
    """
    seal = str(file.metadata.get(_SEAL))
    if hashlib.sha256(_with_seal(file.content, seal, _UNSEALED)).hexdigest() != seal:
        raise DamagedFile("damaged: its checksum does not fit its content")


def config_of(about: dict[str, Any]) -> Config:
    """The static settings that a file tells of; an optimiser that had no name is called "optax"."""
    given, names = about["config"], [field.name for field in dataclasses.fields(Config)]
    if not isinstance(given, dict) or set(given) != set(names):
        refuse("config", repr(given), f"an object with {', '.join(names)}")
    if not isinstance(given["hidden"], list) or len(given["hidden"]) > _MOST_LAYERS:
        refuse("config.hidden", repr(given["hidden"]), f"a list of at most {_MOST_LAYERS} widths")
    values: dict[str, Any] = {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}
    config = Config(**values)
    check_config(dataclasses.replace(config, optimiser="adam") if config.optimiser == OPTAX else config)
    return config


def settings_of(about: dict[str, Any]) -> dict[str, Any]:
    """What is static of the environments, by dotted path, which JSON gives as lists."""
    given, wanted = about["settings"], dict(_fields_of(EnvParams, Kind.SETTING))
    if not isinstance(given, dict) or set(given) != set(wanted):
        refuse("settings", repr(given), f"an object with {', '.join(wanted)}")
    settings = {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}
    for name, value in settings.items():
        verify = wanted[name].verify
        if verify is not None:
            verify(name, value)
    return settings


def _fields_of(kind: type[Container], *kinds: Kind, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """(dotted path, field) of all fields of these kinds in a container and its parts."""
    for name, field in schema_of(kind).items():
        if field.part is not None:
            yield from _fields_of(field.part, *kinds, prefix=f"{prefix}{name}.")
        elif field.kind in kinds:
            yield prefix + name, field


def _check_list(field: str, given: Any) -> None:
    if not isinstance(given, list) or not given or len(set(map(str, given))) != len(given):
        refuse(field, repr(given), "a list of different ones, at least one")


def _check_tensors(file: File) -> None:
    """Refuses missing and unknown names, and other types and leading axes than a name stands for."""
    about, points = file.about, (file.about["points"],)
    numbers = tuple(kind for kind in Kind if kind not in (Kind.SETTING, Kind.PART))
    wanted = {
        f"params.{path}": (np.dtype(np.float32 if field.kind in (Kind.NUMBER, Kind.DERIVED) else np.int32), points)
        for path, field in _fields_of(EnvParams, *numbers)
    }
    wanted |= {f"hparams.{name}": (leaf.dtype, points) for name, leaf in named_arrays(HParams()).items()}
    leading = (*points, len(about["seeds"]))
    words = (*leading, _KEYS[about["key_implementation"]])
    wanted |= {f"agents.{learner}.key": (np.dtype(np.uint32), words) for learner in about["learners"]}
    of_agents = tuple(f"agents.{learner}." for learner in about["learners"])
    for name in (*wanted, *file.tensors):
        if name not in wanted and not name.startswith(of_agents):
            refuse("tensors", name, f"params, hparams, and agents of {', '.join(about['learners'])}")
        if name not in file.tensors:
            refuse(name, "missing", "a tensor of this name")
        tensor, (dtype, axes) = file.tensors[name], wanted.get(name, (np.dtype(np.float32), leading))
        if tensor.dtype != dtype or tensor.shape[: len(axes)] != axes:
            refuse(name, f"{tensor.dtype} of shape {tensor.shape}", f"{dtype} of shape {axes} and what an entry needs")
