"""Figs. 6 to 8: reward, throughput and miss detection against a parameter, for each algorithm, and what is exact."""

from __future__ import annotations

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from paper_figs.analysis import divergence
from paper_figs.analysis.statistics import mean_over_seeds
from paper_figs.plots import style
from paper_figs.plots.curves import COLUMNS

PANELS = {
    "a": ("reward", "average reward per slot", 1),
    "b": ("throughput", "throughput (packets per episode)", None),
    "c": ("miss_detection", "miss-detection probability", 1),
}
"""Panel to the metric, its axis label, and what a long-run figure per slot is multiplied by: None for the slots."""


def table(data: xr.Dataset, figure: str, x_name: str, slots: int) -> pd.DataFrame:
    """The plotted numbers: means over all episodes, exploration included, and over seeds; and three exact lines.

    The interval is at 95 % over seeds (`mean_effect`). The exact lines have no seeds (n_seeds 0) and their interval is
    themselves. `n_diverged` of the seeds' agents diverged at some time.

    Args:
      data: results of a sweep.
      figure: the figure's number.
      x_name: the coordinate that varies between points.
      slots: of an episode.
    """
    x = [float(value) for value in data[x_name].values]
    rows = []
    for panel, (metric, _, scale) in PANELS.items():
        for name in data["algorithm"].values:
            values = data[metric].sel(algorithm=name).mean("episode").transpose("seed", "point").values
            mean = mean_over_seeds(values)
            n_diverged = [divergence.count(data, name, point) for point in range(len(x))]
            numbers = zip(x, mean.mean, mean.low, mean.high, n_diverged, strict=True)
            rows += [(figure, panel, name, *row, mean.n_seeds, n) for *row, n in numbers]
        for name in style.EXACT:
            value = data[f"{name}_{metric}"]
            value = (scale or slots) * (value.mean("episode") if "episode" in value.dims else value).values
            rows += [(figure, panel, name, e, v, v, v, 0, 0) for e, v in zip(x, value, strict=True)]
    return pd.DataFrame(rows, columns=COLUMNS)


@style.styled
def draw(numbers: pd.DataFrame, title: str, x_label: str) -> Figure:
    """The three panels of a `table` beside each other, as wide as two columns."""
    figure = Figure(figsize=style.TWO_COLUMNS)
    panels = figure.subplots(1, len(PANELS))
    for axes, (panel, (_, label, _)) in zip(panels, PANELS.items(), strict=True):
        for name, look in (style.EXACT | style.LOOKS).items():
            curve = numbers.query(f"panel == {panel!r} and algorithm == {name!r}")
            if not curve.empty:
                style.plot(axes, curve, look, markers=len(curve))
        axes.set_xlabel(x_label)
        axes.set_ylabel(label)
        axes.set_title(f"({panel})")
    figure.suptitle(f"{title} ({style.band_of(numbers)})")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, columnspacing=1.2)
    return figure
