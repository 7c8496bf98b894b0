"""FMCW chirp to range resolution and maximum range: the paper's equation (2)."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from jax import Array

A = TypeVar("A", Array, np.ndarray)

SPEED_OF_LIGHT = 299_792_458.0
"""c0 in m/s."""


def range_resolution(bandwidth: A) -> A:
    """R_re = c0 / (2 b), equation (2).

    Args:
      bandwidth: sweep bandwidth b in Hz, any shape.

    Returns:
      The smallest separation of two resolved objects in m, same shape.
    """
    return SPEED_OF_LIGHT / (2.0 * bandwidth)


def maximum_range(slope: A, max_intermediate_frequency: A) -> A:
    """R_max = c0 F_max / (2 f_c), equation (2).

    Args:
      slope: chirp slope f_c in Hz/s, any shape.
      max_intermediate_frequency: F_max in Hz, same shape; each chirp has its own.

    Returns:
      The largest distance at which an echo is still in band, in m, same shape.
    """
    # Divided before multiplied: c0 F_max would leave little headroom in float32.
    return SPEED_OF_LIGHT / 2.0 * (max_intermediate_frequency / slope)
