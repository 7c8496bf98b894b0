"""Learning curves, Fig. 5: reward against episodes for each algorithm, and the exact optimum."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figs import style
from paper_figs.statistics import bins_of, mean_over_seeds

COLUMNS = ["figure", "panel", "algorithm", "x", "mean", "ci_low", "ci_high", "n_seeds"]


def table(data: xr.Dataset, figure: str, panel: str) -> pd.DataFrame:
    """The plotted numbers: mean reward per slot in bins of consecutive episodes, over seeds; and two exact lines.

    `x` is the last episode of a bin. The interval is Student's t at 95 % over seeds. The optimum and the best
    constant action are exact: they have no seeds (n_seeds 0) and their interval is themselves.
    """
    episodes = data.sizes["episode"]
    width = bins_of(episodes)
    x = np.arange(width, episodes + 1, width)
    rows = []
    for name in data["algorithm"].values:
        reward = data["reward"].sel(algorithm=name).isel(point=0).transpose("seed", "episode").values
        mean = mean_over_seeds(reward.reshape(reward.shape[0], -1, width).mean(axis=2))
        rows += [
            (figure, panel, name, int(e), m, low, high, mean.n_seeds)
            for e, m, low, high in zip(x, mean.mean, mean.low, mean.high, strict=True)
        ]
    for name in ("optimum", "constant"):
        reward = float(data[f"{name}_reward"].isel(point=0))
        rows += [(figure, panel, name, int(e), reward, reward, reward, 0) for e in x]
    return pd.DataFrame(rows, columns=COLUMNS)


@style.styled
def draw(numbers: pd.DataFrame, title: str) -> Figure:
    """The figure of a `table`, with the last part of the curves enlarged in an inset."""
    figure = Figure()
    axes = figure.subplots()
    _plot(axes, numbers)
    width = int(numbers.x.min())
    axes.set_xlabel("episode" if width == 1 else f"episode (each point: mean over {width} episodes)")
    axes.set_ylabel("average reward per slot")
    axes.set_xlim(0, numbers.x.max())
    seeds = int(numbers.n_seeds.max())
    band = f"{seeds} seeds, bands: 95 % interval of the mean" if seeds > 1 else "one seed, no interval"
    axes.set_title(f"{title} ({band})")
    _enlarge(axes, numbers)
    # Below the axes, where it can hide no curve.
    figure.legend(
        *axes.get_legend_handles_labels(), loc="outside lower center", ncols=3, columnspacing=1.0, handlelength=1.7
    )
    return figure


def _exact(numbers: pd.DataFrame, name: str) -> float:
    return float(numbers.loc[numbers["algorithm"] == name, "mean"].to_numpy()[0])


def _plot(axes: Axes, numbers: pd.DataFrame) -> None:
    axes.axhline(_exact(numbers, "optimum"), color="black", linestyle="--", label="optimum (exact)", zorder=3)
    axes.axhline(
        _exact(numbers, "constant"), color="0.4", linestyle=":", label="best constant action (exact)", zorder=3
    )
    for name, look in style.LOOKS.items():
        curve = numbers[numbers.algorithm == name]
        if curve.empty:
            continue
        every = max(len(curve) // 8, 1)
        axes.plot(curve.x, curve["mean"], color=look.color, marker=look.marker, markevery=every, label=look.label)
        axes.fill_between(curve.x, curve.ci_low, curve.ci_high, color=look.color, alpha=0.25, linewidth=0)


def _enlarge(axes: Axes, numbers: pd.DataFrame) -> None:
    """Enlarges what lies near the optimum in the second half, if the full range hides it."""
    late = numbers.query("x > x.max() / 2")
    span = numbers["mean"].max() - numbers["mean"].min()
    near = late.loc[(late["mean"] - _exact(numbers, "optimum")).abs() < 0.15 * span]
    if set(near["algorithm"]) <= {"optimum", "constant"}:
        return
    inset = axes.inset_axes((0.3, 0.26, 0.66, 0.42))
    _plot(inset, numbers)
    low, high = near[["mean", "ci_low"]].min().min(), near[["mean", "ci_high"]].max().max()
    margin = 0.1 * (high - low)
    inset.set_xlim(late.x.min(), late.x.max())
    inset.set_ylim(low - margin, high + margin)
    inset.tick_params(labelsize=6)
    axes.indicate_inset_zoom(inset, edgecolor="0.4", linewidth=0.6)
