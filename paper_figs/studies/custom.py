"""The figure of a sweep of one's own: the panels of Figs. 6 to 8 against any parameter."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from paper_figs.plots import points, style
from sweeps.results import store
from sweeps.studies.custom import Custom

_LOGARITHMIC = 30.0
"""Largest by smallest value from which the x axis is logarithmic."""


def write(folder: Path, custom: Custom, seeds: int) -> list[Path]:
    """Writes the figure as PDF and PNG and the plotted numbers as CSV beside a sweep's results.

    Args:
      folder: with the results.
      custom: what was run.
      seeds: how many seeds of it to draw.

    Returns:
      The files.
    """
    sweep, parameter = custom.sweep, custom.parameter
    table = points.table(store.load(folder, seeds), sweep.name, sweep.x_name, custom.slots)
    figure = points.draw(table, sweep.name, x_label=parameter.path)
    _fit_axis(figure, sweep.x_values, parameter.readings)
    if parameter.readings:
        table["reading"] = [parameter.readings[int(x)] for x in table.x]
    path = style.save_table(table, folder / f"{sweep.name}.csv")
    return [path, *style.save(figure, folder / sweep.name)]


def _fit_axis(figure: Figure, values: tuple[float, ...], readings: tuple[str, ...]) -> None:
    """Names the ticks after readings, and spreads values of several orders of magnitude."""
    for axes in figure.axes:
        if readings:
            axes.set_xticks(values, [readings[int(x)].replace("_", " ") for x in values])
            axes.set_xlim(min(values) - 0.5, max(values) + 0.5)
        elif min(values) > 0 and max(values) / min(values) >= _LOGARITHMIC:
            axes.set_xscale("log")
            axes.xaxis.set_minor_locator(NullLocator())
