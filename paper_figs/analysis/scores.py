"""One number per seed and point: means over a run's episodes, exploration included, as the paper plots them."""

from __future__ import annotations

import numpy as np
import xarray as xr


def mean_over_episodes(data: xr.Dataset, metric: str, algorithm: str, episodes: int | None = None) -> np.ndarray:
    """Mean of a simulated metric over the first episodes at each point, [seeds, points].

    Args:
      data: results of a sweep.
      metric: "reward", "throughput" or "miss_detection".
      algorithm: the learner.
      episodes: how many of the first ones; all if None.
    """
    values = data[metric].sel(algorithm=algorithm).isel(episode=slice(episodes))
    return values.mean("episode").transpose("seed", "point").values.astype(float)
