"""Results of any design: means at each point by what varies, and differences between learners."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import xarray as xr

from paper_figs.analysis.convergence import sample_complexity
from paper_figs.analysis.statistics import mean_over_seeds
from paper_figs.plots import points


def table(data: xr.Dataset, name: str, columns: tuple[str, ...], slots: int) -> pd.DataFrame:
    """The numbers of `paper_figs.plots.points.table` at each point, with a column for each thing that varies.

    Args:
      data: results of a sweep.
      name: of the figure.
      columns: coordinates that vary.
      slots: of an episode.
    """
    numbers = points.table(data, name, "point", slots).rename(columns={"x": "point"}).astype({"point": int})
    for column in reversed(columns):
        numbers.insert(3, column, data[column].values[numbers.point])
    return numbers


def convergence(data: xr.Dataset, columns: tuple[str, ...]) -> pd.DataFrame:
    """When each learner's policies converge at each point, with 95 % limits; see `sample_complexity`.

    `reached` is the share of runs that do within this study's episodes, `median` the episode by which half of them
    have, infinite where fewer than half do.

    Args:
      data: results of a sweep.
      columns: coordinates that vary.
    """
    rows = []
    for name in map(str, data["algorithm"].values):
        for point in range(data.sizes["point"]):
            found = sample_complexity(data, name, point)
            row = {column: float(data[column].values[point]) for column in columns} | {"algorithm": name}
            for of in ("reached", "median"):
                row |= dict(zip((of, f"{of}_low", f"{of}_high"), map(float, getattr(found, of)), strict=True))
            rows.append(row | {"n_seeds": data.sizes["seed"], "episodes": data.sizes["episode"]})
    return pd.DataFrame(rows)


def differences(data: xr.Dataset, columns: tuple[str, ...]) -> pd.DataFrame:
    """Differences of each two learners at each point, paired by seed, with the 95 % interval of `mean_effect`.

    Args:
      data: results of a sweep.
      columns: coordinates that vary.
    """
    rows = []
    for panel, (metric, _, _) in points.PANELS.items():
        of = {
            str(name): data[metric].sel(algorithm=name).mean("episode").transpose("seed", "point").values
            for name in data["algorithm"].values
        }
        for a, b in itertools.combinations(of, 2):
            mean = mean_over_seeds(of[a] - of[b])
            for point in range(data.sizes["point"]):
                at = {column: float(data[column].values[point]) for column in columns}
                found = {"mean": mean.mean[point], "ci_low": mean.low[point], "ci_high": mean.high[point]}
                rows.append({"panel": panel, "algorithm": a, "other": b, "point": point} | at | found)
    table = pd.DataFrame(rows)
    if not table.empty:
        table["significant"] = np.where((table.ci_low > 0) | (table.ci_high < 0), 1, 0)
    return table
