"""Laws of what differs from seed to seed: mean 0, arrays [n, k, studies] of n seeds and k columns."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

Law: TypeAlias = Callable[[np.random.Generator, tuple[int, ...]], np.ndarray]


def normal(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Deviation 1."""
    return rng.standard_normal(shape)


def exponential(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Deviation 1, skewness 2."""
    return rng.standard_exponential(shape) - 1


def lognormal(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Of a standard normal exponent: deviation 2.2, skewness 6.2."""
    return np.exp(rng.standard_normal(shape)) - np.exp(0.5)


def student(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Student's t with 3 degrees of freedom: symmetric, and its fourth moment is infinite."""
    return rng.standard_t(3, shape)


def catastrophe(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """One run in ten is 10 deviations below the others."""
    return rng.standard_normal(shape) + 10 * (0.1 - (rng.random(shape) < 0.1))


LAWS: dict[str, Law] = {
    "normal": normal,
    "exponential": exponential,
    "lognormal": lognormal,
    "t with 3 degrees of freedom": student,
}
