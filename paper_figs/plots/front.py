"""The figure of the trade-off: the target's fronts with what learners make of them, and how the fronts move."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figs.plots import style

_SIZE = (style.TWO_COLUMNS[0], 4.9)
_VARIED = {"b": r"$\omega$", "c": "$p_1^v$", "d": r"$\tau_0$"}
_LINES = {"all_slots": "-", "event_slots": (0, (4.0, 1.5))}
_CONVENTIONS = {"all_slots": "over all slots", "event_slots": "over slots with an event"}
_HEIGHT = (0.0, 1.02)
_INSET = (0.56, 0.1, 0.4, 0.36)
"""Left, bottom, width and height, as shares of the panel's."""
_LABELS = ("throughput (packets per slot)", "miss-detection probability")


@style.styled
def draw(numbers: pd.DataFrame, title: str) -> Figure:
    """The four panels of a table of `paper_figs.analysis.front`."""
    figure = Figure(figsize=_SIZE)
    panels = dict(zip("abcd", figure.subplots(2, 2).ravel(), strict=True))
    target = numbers.query("panel == 'a'")
    _draw_target(panels["a"], target)
    _enlarge(panels["a"], target)
    for panel, symbol in _VARIED.items():
        _draw_fronts(panels[panel], numbers.query(f"panel == {panel!r}"), symbol)
    for panel, axes in panels.items():
        axes.set_xlabel(_LABELS[0])
        axes.set_ylabel(_LABELS[1])
        axes.set_ylim(_HEIGHT)
        axes.set_title(f"({panel})")
    seeds = int(numbers.n_seeds.max())
    figure.suptitle(f"{title} ({f'{seeds} seeds, bars: 95 % interval' if seeds > 1 else 'one seed'})")
    handles = panels["a"].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=4, columnspacing=1.2)
    return figure


def _draw_target(axes: Axes, numbers: pd.DataFrame) -> None:
    """Both fronts, the optimum of the reward for other worths of a packet, and one point per learner."""
    for convention, line in _LINES.items():
        of_one = numbers.query(f"convention == {convention!r}")
        corners, weighted, optimum = (of_one.query(f"algorithm == {n!r}") for n in ("front", "weighted", "optimum"))
        label = f"front, misses {_CONVENTIONS[convention]}"
        axes.plot(corners.x, corners["mean"], color="black", linestyle=line, label=label)
        is_first = convention == "all_slots"
        label = r"optimum of (11), $\rho_1$ from 1/16 to 16" if is_first else None
        axes.plot(weighted.x, weighted["mean"], color="0.5", linestyle=":", marker=".", markersize=2, label=label)
        label = r"optimum, $\rho_1 = 1$" if is_first else None
        axes.plot(optimum.x, optimum["mean"], "*", color="black", markersize=6, label=label)
    for name, look in style.LOOKS.items():
        for point in numbers.query(f"algorithm == {name!r}").itertuples():
            _draw_point(axes, point, look, labelled=numbers["convention"].iloc[0])


def _draw_point(axes: Axes, point: Any, look: style.Look, labelled: str) -> None:
    has_bars = point.n_seeds > 1
    label = look.label if point.n_seeds else f"{look.label}, random"
    axes.errorbar(
        point.x,
        point.mean,
        xerr=[[point.x - point.x_low], [point.x_high - point.x]] if has_bars else None,
        yerr=[[point.mean - point.ci_low], [point.ci_high - point.mean]] if has_bars else None,
        color=look.color,
        marker=look.marker,
        markersize=look.size,
        markerfacecolor="white" if look.hollow else look.color,
        elinewidth=0.6,
        linestyle="",
        label=label if point.convention == labelled else None,
    )


def _enlarge(axes: Axes, numbers: pd.DataFrame) -> None:
    """Enlarges where the learners are, unless they are all over the panel."""
    learners = numbers.query("n_seeds > 0")
    low_x, high_x = learners[["x", "x_low"]].min().min(), learners[["x", "x_high"]].max().max()
    low_y, high_y = learners[["mean", "ci_low"]].min().min(), learners[["mean", "ci_high"]].max().max()
    margin_x, margin_y = 0.05 + 0.4 * (high_x - low_x), 0.01 + 0.4 * (high_y - low_y)
    x, y = (low_x - margin_x, high_x + margin_x), (low_y - margin_y, high_y + margin_y)
    _, _, width, height = _INSET
    if np.ptp(x) > width * np.ptp(axes.get_xlim()) or np.ptp(y) > height * np.ptp(_HEIGHT):
        return
    inset = axes.inset_axes(_INSET)
    _draw_target(inset, numbers)
    inset.set_xlim(x)
    inset.set_ylim(y)
    inset.tick_params(labelsize=6)
    axes.indicate_inset_zoom(inset, edgecolor="0.4", linewidth=0.6)


def _draw_fronts(axes: Axes, numbers: pd.DataFrame, symbol: str) -> None:
    """Both fronts for each value of a parameter, from light to dark."""
    values = sorted(numbers["value"].unique())
    colors = mpl.colormaps["cividis_r"]
    for i, value in enumerate(values):
        for convention, line in _LINES.items():
            corners = numbers.query(f"value == {value} and convention == {convention!r}")
            label = f"{symbol} = {value:g}" if convention == "all_slots" else None
            color = colors(0.15 + 0.85 * i / max(len(values) - 1, 1))
            axes.plot(corners.x, corners["mean"], color=color, linestyle=line, label=label)
    axes.legend(fontsize=6, handlelength=1.2, loc="upper left")
