"""Samples over many parameters: results against each of them, and sensitivity indices."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from paper_figs.analysis.sensitivity import Sensitivity
from paper_figs.plots import style
from paper_figs.plots.maps import LOGARITHMIC
from paper_figs.plots.points import PANELS

_BINS = 8
_ACROSS = 3  # small axes beside each other


@style.styled
def draw_profiles(
    numbers: pd.DataFrame, panel: str, columns: tuple[str, ...], readings: dict[str, tuple[str, ...]]
) -> Figure:
    """A metric at all points against each parameter, with the mean in bins of equally many points.

    Args:
      numbers: as `paper_figs.analysis.designs.table` gives them.
      panel: of the metric, see `paper_figs.plots.points.PANELS`.
      columns: the parameters.
      readings: by column, names of its values, if they are indices.
    """
    here = numbers.query(f"panel == {panel!r}")
    down = -(-len(columns) // _ACROSS)
    figure = Figure(figsize=(style.TWO_COLUMNS[0], 2.0 * down + 0.6))
    axes = figure.subplots(down, _ACROSS, squeeze=False).reshape(-1)
    for place, column in zip(axes, columns, strict=False):
        for name, look in style.LOOKS.items():
            own = here.query(f"algorithm == {name!r}").sort_values(column)
            if own.empty:
                continue
            place.plot(own[column], own["mean"], look.marker, color=look.color, markersize=1.5, alpha=0.3, linestyle="")
            bins = own.groupby(column) if readings.get(column) else own.groupby(np.arange(len(own)) * _BINS // len(own))
            place.plot(
                bins[column].mean(), bins["mean"].mean(), color=look.color, linestyle=look.line, label=look.label
            )
        values = here[column].to_numpy(float)
        if readings.get(column):
            names = readings[column]
            place.set_xticks(range(len(names)), [name.replace("_", " ") for name in names])
        elif values.min() > 0 and values.max() / values.min() >= LOGARITHMIC:
            place.set_xscale("log")
        place.set_xlabel(column, fontsize=6)
        place.tick_params(labelsize=6)
    for place in axes[len(columns) :]:
        place.set_axis_off()
    figure.supylabel(PANELS[panel][1], fontsize=8)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


@style.styled
def draw_indices(found: dict[str, Sensitivity], title: str) -> Figure:
    """First-order and total indices of each input, for each output, with their 95 % intervals.

    Args:
      found: by output.
      title: of the figure.
    """
    number = len(next(iter(found.values())).table)
    figure = Figure(figsize=(style.TWO_COLUMNS[0], 0.16 * number + 1.3))
    axes = figure.subplots(1, len(found), sharey=True, squeeze=False)[0]
    for place, (output, sensitivity) in zip(axes, found.items(), strict=True):
        table, rows = sensitivity.table, np.arange(number)[::-1]
        for order, shift, colour, marker in (("first", 0.15, "#0072B2", "o"), ("total", -0.15, "#D55E00", "s")):
            bars = [(table[order] - table[f"{order}_low"]).clip(0), (table[f"{order}_high"] - table[order]).clip(0)]
            look = {"marker": marker, "color": colour, "markersize": 3, "elinewidth": 0.7, "linestyle": ""}
            place.errorbar(table[order], rows + shift, xerr=bars, label=f"{order} order", **look)
        place.set_yticks(rows, table.input, fontsize=6)
        place.set_xlim(-0.02, 1.02)
        place.set_title(f"{output}\n{sensitivity.surrogate}, error {sensitivity.error:.2f}", fontsize=7)
    figure.supxlabel("share of the variance", fontsize=8)
    figure.suptitle(title)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
