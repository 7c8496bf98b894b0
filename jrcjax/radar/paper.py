"""The radar and the traffic of the paper's Table I."""

from __future__ import annotations

from typing import Any

from jrcjax.radar import chirp
from jrcjax.radar.bank import Radar, make_radar
from jrcjax.radar.modes import Modes

_CARS, _PEDESTRIANS = 20, 7  # mean numbers per slot in nuScenes, from which the paper's density of 27 comes
_RANGES = (225.0, 45.0)  # m, long and short range
_BANDWIDTHS = (300e6, 750e6)  # Hz
_SLOPES = (10e12, 15e12)  # Hz/s
MAX_DENSITY = 54.0  # objects per 45 m x 45 m, the largest in the paper


def paper_radar(density: float = 27.0) -> Radar:
    """The two chirps and the cars and pedestrians of Table I, at `density` objects per 45 m x 45 m.

    One maximum intermediate frequency can't give both ranges that the text states, so each chirp has its own.
    """
    return make_radar(**_fields(density), max_density=MAX_DENSITY)


def paper_modes(density: float = 27.0) -> Modes:
    """`paper_radar` without its bank, which takes seconds to build."""
    return Modes(**_fields(density))


def _fields(density: float) -> dict[str, Any]:
    total = _CARS + _PEDESTRIANS
    return {
        "bandwidth": _BANDWIDTHS,
        "slope": _SLOPES,
        "max_intermediate_frequency": [
            2.0 * r * f / chirp.SPEED_OF_LIGHT for r, f in zip(_RANGES, _SLOPES, strict=True)
        ],
        "density": density,
        "class_share": (_CARS / total, _PEDESTRIANS / total),
        "size_mean": ((4.62, 1.92), (0.73, 0.68)),
        "size_std": ((0.18, 0.08), (0.085, 0.055)),
    }
