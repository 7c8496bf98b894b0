"""Maps over two parameters: each learner, what is exact, and differences between learners."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from paper_figs.plots import style
from paper_figs.plots.points import PANELS

_PANEL = 2.4  # inches of a map
LOGARITHMIC = 30.0
"""Largest by smallest value from which an axis is logarithmic."""


@style.styled
def draw(
    numbers: pd.DataFrame,
    differences: pd.DataFrame,
    panel: str,
    columns: tuple[str, str],
    readings: dict[str, tuple[str, ...]],
) -> Figure:
    """The maps of one metric: the exact optimum and each learner with one scale, then each difference.

    Where a difference is not significant it is crossed out.

    Args:
      numbers: as `paper_figs.analysis.designs.table` gives them.
      differences: as `paper_figs.analysis.designs.differences` gives them.
      panel: of the metric, see `paper_figs.plots.points.PANELS`.
      columns: those of the x and of the y axis.
      readings: by column, names of its values, if they are indices.
    """
    here = numbers.query(f"panel == {panel!r}")
    names = [name for name in ("optimum", *style.LOOKS) if name in set(here.algorithm)]
    between = differences.query(f"panel == {panel!r}") if len(differences) else differences
    pairs = list(dict.fromkeys(zip(between.algorithm, between.other, strict=True))) if len(between) else []
    wide = max(len(names), len(pairs))
    figure = Figure(figsize=(_PANEL * max(wide, 2), _PANEL * (1.05 + bool(pairs)) + 0.4))
    axes = figure.subplots(1 + bool(pairs), wide, squeeze=False)
    values = here.query("algorithm in @names")["mean"].to_numpy(float)
    scale = Normalize(values.min(), values.max())
    for place, name in zip(axes[0], names, strict=False):
        shown = _map(place, here.query(f"algorithm == {name!r}"), columns, readings, scale, "viridis")
        place.set_title((style.LOOKS | style.EXACT)[name].label)
    figure.colorbar(shown, ax=list(axes[0]), label=PANELS[panel][1])
    if pairs:
        largest = np.abs(between["mean"].to_numpy(float)).max() or 1.0
        for place, (a, b) in zip(axes[1], pairs, strict=False):
            table = between.query(f"algorithm == {a!r} and other == {b!r}")
            shown = _map(place, table, columns, readings, Normalize(-largest, largest), "RdBu")
            place.set_title(f"{style.LOOKS[a].label} minus {style.LOOKS[b].label}")
            _cross_out(place, table, columns)
        figure.colorbar(shown, ax=list(axes[1]), label="difference; crosses: not significant")
    for place in [place for row in axes for place in row if not place.has_data()]:
        place.set_axis_off()
    figure.suptitle(f"{PANELS[panel][1]} ({style.band_of(numbers.assign(x=numbers.point), has_bands=False)})")
    return figure


def _map(axes: Axes, table: pd.DataFrame, columns: tuple[str, str], readings, scale, colours: str):
    """One map; cells are as large as each other, and their ticks say the values."""
    x, y = (sorted(table[column].unique()) for column in columns)
    cells = table.pivot_table(index=columns[1], columns=columns[0], values="mean").to_numpy()
    shown = axes.imshow(cells, origin="lower", aspect="auto", norm=scale, cmap=colours)
    for axis, values, column in ((axes.xaxis, x, columns[0]), (axes.yaxis, y, columns[1])):
        every = max(len(values) // 6, 1)
        names = [readings[column][int(v)].replace("_", " ") if readings.get(column) else f"{v:.3g}" for v in values]
        axis.set_ticks(range(0, len(values), every), names[::every])
    axes.set_xlabel(columns[0], fontsize=6)
    axes.set_ylabel(columns[1], fontsize=6)
    axes.tick_params(labelsize=6)
    axes.grid(visible=False)
    return shown


def _cross_out(axes: Axes, table: pd.DataFrame, columns: tuple[str, str]) -> None:
    open_ = table.query("significant == 0")
    places = [np.searchsorted(sorted(table[column].unique()), open_[column]) for column in columns]
    axes.plot(*places, "kx", markersize=3, markeredgewidth=0.6, linestyle="")
