"""The figure of the table: for every rule and world, the more frequent of both false verdicts, and the coverage."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import Colormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from paper_figs.calibration.reach import COVERAGE, FALSE_VERDICTS, FEWEST
from paper_figs.plots import style

_WIDEST = 12.0  # percent at which the panel of errors ends
_LEAST = 76.0  # percent at which the panel of coverage begins
_APART = 1.5  # percent between arrows of one line


@style.styled
def draw(numbers: pd.DataFrame) -> Figure:
    """One line per rule and world, one marker per number of seeds; hollow where it is out of reach."""
    numbers = numbers[numbers.n_seeds >= FEWEST].assign(
        false=numbers[["false_supported", "false_contradicted"]].max(axis=1)
    )
    labels = list(dict.fromkeys(zip(numbers.rule, numbers.world, strict=True)))
    figure = Figure(figsize=(style.TWO_COLUMNS[0], 0.165 * len(labels) + 1.1))
    errors, coverage = figure.subplots(1, 2, sharey=True)
    _dots(errors, numbers, labels, "false", most=_WIDEST)
    _dots(coverage, numbers, labels, "coverage", least=_LEAST)
    errors.axvline(2.5, color="0.6", linewidth=0.8, linestyle=":")
    errors.axvspan(0, 100 * FALSE_VERDICTS, color="0.92", linewidth=0)
    coverage.axvline(95, color="0.6", linewidth=0.8, linestyle=":")
    coverage.axvspan(*(100 * limit for limit in COVERAGE), color="0.92", linewidth=0)
    errors.set_xlim(-0.3, _WIDEST + 0.3)
    coverage.set_xlim(_LEAST - 0.5, 100.5)
    errors.set_yticks(range(len(labels)), [f"{rule}: {world}" for rule, world in labels], fontsize=6)
    errors.set_ylim(len(labels) - 0.5, -0.5)
    errors.set_xlabel("more frequent false verdict (%)")
    coverage.set_xlabel("coverage (%)")
    figure.legend(*errors.get_legend_handles_labels(), title="seeds", loc="outside upper center", ncols=6)
    figure.legend(handles=_meanings(), loc="outside lower center", ncols=2)
    return figure


def _meanings() -> list[Artist]:
    """What a reader has to know of markers, band and lines."""
    look = {"linestyle": "", "markersize": 3, "color": "0.3", "markerfacecolor": "none"}
    limits = " to ".join(f"{100 * limit:g}" for limit in COVERAGE)
    return [
        Line2D([], [], marker="o", label="hollow: the band is out of reach (table: why)", **look),
        Line2D([], [], marker=">", label="arrow: beyond the panel, at the value beside it", **look),
        Patch(color="0.92", label=f"band: up to {100 * FALSE_VERDICTS:g} % false, coverage of {limits} %"),
        Line2D([], [], color="0.6", linewidth=0.8, linestyle=":", label="nominal: 2.5 % false, coverage of 95 %"),
    ]


def _dots(
    axes: Axes,
    numbers: pd.DataFrame,
    labels: list[tuple[str, str]],
    column: str,
    least: float = -np.inf,
    most: float = np.inf,
) -> None:
    """Markers of a column in percent; of those beyond the panel there are arrows at its end, with their values."""
    sizes = sorted(set(numbers.n_seeds))
    colours: Colormap = mpl.colormaps["viridis"]
    beyond = []
    for marker, n, shade in zip("osD^v", sizes, np.linspace(0, 0.9, len(sizes)), strict=False):
        here = numbers[numbers.n_seeds == n].set_index(["rule", "world"]).loc[labels]
        x, is_hollow = 100 * here[column].to_numpy(), (here.out_of_reach == 1).to_numpy()
        is_within = (least <= x) & (x <= most)
        color = colours(shade)
        for hollow in (True, False):
            chosen = is_within & (is_hollow == hollow)
            axes.plot(
                x[chosen],
                np.arange(len(labels))[chosen],
                marker=marker,
                linestyle="",
                markersize=3,
                color=color,
                markerfacecolor="none" if hollow else color,
                label=None if hollow else str(n),
            )
        beyond += [(line, x[line], is_hollow[line], color) for line in np.flatnonzero(~is_within)]
    beyond.sort(key=lambda found: min(found[1] - least, most - found[1]))  # the outermost first
    for line in {found[0] for found in beyond}:
        for place, (_, value, hollow, color) in enumerate(found for found in beyond if found[0] == line):
            _arrow(axes, line, value, least if value < least else most, place, hollow, color)


def _arrow(axes: Axes, line: int, value: float, end: float, place: int, hollow: bool, color: tuple) -> None:
    """An arrow towards a value beyond a panel's end, with the value beside it; others of the line stand further out."""
    inwards = 1 if value < end else -1
    x = end + inwards * _APART * place
    face = "none" if hollow else color
    axes.plot(x, line, marker="<" if inwards > 0 else ">", markersize=3, color=color, markerfacecolor=face)
    axes.annotate(
        f"{value:.3g}",
        (x, line),
        (inwards * 3, 0),
        textcoords="offset points",
        ha="left" if inwards > 0 else "right",
        va="center",
        fontsize=5,
        color=color,
    )
