"""Refusals: every error names the field, the value and what is allowed, before anything compiles.

Each container is checked in its own module with these tools. Shapes and types are always checked; numbers only where
they are known, that is outside `jit` and `vmap`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

_SUM_TOLERANCE = 1e-5  # a few float32 roundings of a sum of probabilities


def is_traced(*values: Any) -> bool:
    """Whether any value is only known inside a transformation."""
    return any(isinstance(value, Tracer) for value in values)


def refuse(field: str, value: Any, allowed: str) -> NoReturn:
    """Raises the ValueError that all checks raise."""
    shown = value if isinstance(value, str | int | float) else np.asarray(value).tolist()
    raise ValueError(f"{field:.200}: {shown!r:.600}; allowed: {allowed:.900}")  # some lines at most


def require(
    field: str, value: Any, shape: tuple[int | None, ...], test: Callable[[np.ndarray], Any], allowed: str, kinds="iuf"
) -> None:
    """Refuses a wrong shape, a non-number, NaN, and entries for which `test` fails.

    Args:
      field: dotted name.
      value: array or number, possibly traced.
      shape: wanted shape; None allows any size of at least 1.
      test: array to booleans.
      allowed: what the error says is allowed.
      kinds: NumPy's letters of the allowed dtypes: signed, unsigned, float.
    """
    if shape and not hasattr(value, "shape"):
        refuse(field, str(value), f"an array, {allowed}")
    got = np.shape(value)
    if len(got) != len(shape) or any(g == 0 or w not in (None, g) for g, w in zip(got, shape, strict=True)):
        wanted = tuple("any" if w is None else w for w in shape)
        refuse(field, f"shape {got}", f"shape {wanted}, {allowed}")
    if is_traced(value):
        if getattr(value.dtype, "kind", "V") not in kinds:  # the type of keys has none
            refuse(field, f"an array of {value.dtype}", allowed)
        return
    array = np.asarray(value)
    if array.dtype.kind not in kinds or not np.isfinite(array).all() or not np.all(test(array)):
        refuse(field, value if array.dtype.kind in "biuf" else str(value), allowed)


def require_type(field: str, value: Any, wanted: type) -> None:
    """Refuses an object of another type."""
    if not isinstance(value, wanted):
        raise ValueError(f"{field}: {type(value).__name__}; allowed: {wanted.__name__}")


def require_integer(field: str, value: Any, least: int, most: int = 2**31 - 1) -> None:
    """Refuses what is not a Python integer in a range; NumPy's are none, since they would not compare as settings."""
    if type(value) is not int or not least <= value <= most:
        refuse(field, value if type(value) in (int, float) else repr(value), f"an int from {least} to {most}")


def require_keys(keys: Any, dimensions: int, allowed: str) -> None:
    """Refuses what is not an array of PRNG keys with so many dimensions."""
    if not isinstance(keys, jax.Array):
        refuse("key", f"object of type {type(keys).__name__}", allowed)
    typed = jnp.issubdtype(keys.dtype, jax.dtypes.prng_key)
    if not typed and (keys.dtype != jnp.uint32 or keys.shape[-1:] != (2,)):
        refuse("key", f"array of {keys.dtype}, shape {keys.shape}", allowed)
    shape = keys.shape if typed else keys.shape[:-1]  # an old-style key is an array of two words
    if len(shape) != dimensions or 0 in shape:
        refuse("key", f"shape {keys.shape}", allowed)


def is_probability(x: np.ndarray) -> np.ndarray:
    """In [0, 1]."""
    return (x >= 0) & (x <= 1)


def is_positive(x: np.ndarray) -> np.ndarray:
    """Above 0."""
    return x > 0


def is_not_negative(x: np.ndarray) -> np.ndarray:
    """0 or above."""
    return x >= 0


def is_ascending(x: np.ndarray) -> bool:
    """Above 0 and strictly ascending."""
    return bool((x > 0).all() and (np.diff(x) > 0).all())


def is_distribution(x: np.ndarray) -> bool:
    """Probabilities that sum to 1."""
    return bool(is_probability(x).all() and abs(x.astype(np.float64).sum() - 1) <= _SUM_TOLERANCE)
