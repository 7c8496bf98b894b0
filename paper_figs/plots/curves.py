"""Learning curves, Figs. 5 and 9: reward against episodes for each algorithm, and what is exactly known."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figs.analysis import divergence
from paper_figs.analysis.statistics import bin_means, bins_of, mean_over_seeds
from paper_figs.plots import style

_INSET = (0.3, 0.26, 0.66, 0.42)  # left, bottom, width and height, as shares of the axes
COLUMNS = ["figure", "panel", "algorithm", "x", "mean", "ci_low", "ci_high", "n_seeds", "n_diverged"]


def table(data: xr.Dataset, figure: str, panel: str, points: dict[str, int] | None = None) -> pd.DataFrame:
    """The plotted numbers: mean reward per slot in bins of consecutive episodes, over seeds; and three exact lines.

    `x` is the last episode of a bin; the last bin may have fewer than the others. The interval is at 95 % over seeds
    (`mean_effect`). The exact lines have no seeds (n_seeds 0) and their interval is themselves. `n_diverged` of the
    seeds' agents diverged at some time.

    Args:
      data: results of a sweep.
      figure: the figure's number.
      panel: its panel.
      points: name to point, where one algorithm is drawn at several points; all algorithms at the first point if None.
    """
    episodes = data.sizes["episode"]
    width = bins_of(episodes)
    x = [*range(width, episodes, width), episodes]
    rows = []
    curves = {name: (name, 0) for name in data["algorithm"].values}
    if points is not None:
        curves = {name: (data["algorithm"].values[0], point) for name, point in points.items()}
    for name, (algorithm, point) in curves.items():
        reward = data["reward"].sel(algorithm=algorithm).isel(point=point).transpose("seed", "episode").values
        n_diverged = divergence.count(data, algorithm, point)
        mean = mean_over_seeds(bin_means(reward, width))
        rows += [
            (figure, panel, name, int(e), m, low, high, mean.n_seeds, n_diverged)
            for e, m, low, high in zip(x, mean.mean, mean.low, mean.high, strict=True)
        ]
    for name in style.EXACT:
        reward = data[f"{name}_reward"].isel(point=0)
        reward = reward.values if "episode" in reward.dims else np.full(episodes, float(reward))
        rows += [(figure, panel, name, int(e), r, r, r, 0, 0) for e, r in zip(x, bin_means(reward, width), strict=True)]
    return pd.DataFrame(rows, columns=COLUMNS)


@style.styled
def draw(numbers: pd.DataFrame, title: str) -> Figure:
    """The figure of a `table`, with the curves' upper end enlarged in an inset."""
    figure = Figure()
    axes = figure.subplots()
    _plot(axes, numbers)
    width = int(numbers.x.min())
    axes.set_xlabel("episode" if width == 1 else f"episode (each point: mean over {width} episodes)")
    axes.set_ylabel("average reward per slot")
    axes.set_xlim(0, numbers.x.max())
    axes.set_title(f"{title} ({style.band_of(numbers)})")
    _enlarge(axes, numbers)
    # Below the axes, where it can hide no curve.
    figure.legend(
        *axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, columnspacing=0.8, handlelength=1.7
    )
    return figure


def _plot(axes: Axes, numbers: pd.DataFrame) -> None:
    for name, look in (style.EXACT | style.LOOKS).items():
        curve = numbers.query(f"algorithm == {name!r}")
        if not curve.empty:
            style.plot(axes, curve, look, markers=8)


def _enlarge(axes: Axes, numbers: pd.DataFrame) -> None:
    """Enlarges what lies near the optimum in the second half, where there is room for it between the curves."""
    late = numbers.query("x > x.max() / 2")
    span = numbers["mean"].max() - numbers["mean"].min()
    best = numbers.loc[numbers["algorithm"] == "optimum", "mean"].to_numpy()[0]
    near = late.loc[(late["mean"] - best).abs() < 0.15 * span]
    if set(near["algorithm"]) <= set(style.EXACT) or _hides(axes, numbers):
        return
    inset = axes.inset_axes(_INSET)
    _plot(inset, numbers)
    low, high = near[["mean", "ci_low"]].min().min(), near[["mean", "ci_high"]].max().max()
    margin = 0.1 * (high - low)
    inset.set_xlim(late.x.min(), late.x.max())
    inset.set_ylim(low - margin, high + margin)
    inset.tick_params(labelsize=6)
    axes.indicate_inset_zoom(inset, edgecolor="0.4", linewidth=0.6)


def _hides(axes: Axes, numbers: pd.DataFrame) -> bool:
    """Whether an inset would lie over a curve."""
    left, bottom, width, height = _INSET
    (low, high), most = axes.get_ylim(), numbers.x.max()
    x, height_of_curve = numbers.x / most, (numbers["mean"] - low) / (high - low)
    behind = (x > left) & (x < left + width) & (height_of_curve > bottom) & (height_of_curve < bottom + height)
    return bool(behind.any())
