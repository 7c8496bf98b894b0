"""Pytrees as named arrays, for files, digests and tables: every leaf by its path."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import jax
from jaxtyping import Array

from jrcjax.containers import Container, Field, Kind, schema_of

C = TypeVar("C", bound=Container)


def named_arrays(tree: Any, separator: str = ".") -> dict[str, Any]:
    """The leaves of a pytree by their path, such as "speed.prior", in the tree's order."""
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return {jax.tree_util.keystr(path, simple=True, separator=separator): leaf for path, leaf in leaves}


def named_inputs(container: Container) -> dict[str, Any]:
    """`named_arrays` of a container without what is derived from the others."""
    gone = _names(container, Kind.DERIVED)
    return {name: leaf for name, leaf in named_arrays(container).items() if name not in gone}


def named_settings(container: Container) -> dict[str, Any]:
    """What is static in a container and its parts, by dotted path."""
    return _names(container, Kind.SETTING)


def _names(container: Container, kind: Kind, prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, field in schema_of(container).items():
        value = getattr(container, name)
        if field.part is not None:
            found |= _names(value, kind, f"{prefix}{name}.")
        elif field.kind is kind:
            found[prefix + name] = value
    return found


def field_at(kind: type[Container], path: str) -> Field:
    """What the schema says of a dotted path, such as "speed.prior"."""
    first, _, rest = path.partition(".")
    field = schema_of(kind)[first]
    return field_at(field.part, rest) if field.part is not None and rest else field


def container_of(kind: type[C], named: Mapping[str, Array], settings: Mapping[str, Any], prefix: str = "") -> C:
    """The container with these arrays, those that are derived included, and settings, by dotted path.

    Nothing is derived anew, so the container is the one that the names come from, to the last bit.

    Raises:
      KeyError: for a field that is missing.
    """
    values: dict[str, Any] = {}
    for name, field in schema_of(kind).items():
        path = prefix + name
        if field.part is not None:
            values[name] = container_of(field.part, named, settings, f"{path}.")
        else:
            values[name] = (settings if field.kind is Kind.SETTING else named)[path]
    return kind.restored(values)
