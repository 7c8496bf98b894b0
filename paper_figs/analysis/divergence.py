"""Agents whose values diverged: they count in every mean like all others, and are named wherever they do."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr


def count(data: xr.Dataset, algorithm: str, point: int | None = None) -> int:
    """Diverged agents of an algorithm, at one point or at all."""
    first = data["first_diverged"].sel(algorithm=algorithm)
    return int(((first if point is None else first.isel(point=point)) >= 0).sum())


def rows(sweep: str, data: xr.Dataset) -> list[dict[str, Any]]:
    """One row per diverged agent, with the first episode after which it was seen."""
    first = data["first_diverged"].transpose("algorithm", "point", "seed")
    return [
        {
            "sweep": sweep,
            "algorithm": str(data["algorithm"].values[a]),
            "point": int(data["point"].values[p]),
            "seed": int(data["seed"].values[s]),
            "episode": int(first.values[a, p, s]),
        }
        for a, p, s in np.argwhere(first.values >= 0)
    ]
