"""The figure of the table: for every rule and world, the more frequent of both false verdicts, and the coverage."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import Colormap
from matplotlib.figure import Figure

from paper_figs.calibration.reach import COVERAGE, FALSE_VERDICTS, FEWEST
from paper_figs.plots import style

_WIDEST = 12.0  # percent at which the panel of errors ends
_LEAST = 82.0  # percent at which the panel of coverage begins


@style.styled
def draw(numbers: pd.DataFrame) -> Figure:
    """One line per rule and world, one marker per number of seeds; hollow where it is out of reach."""
    numbers = numbers[numbers.n_seeds >= FEWEST].assign(
        false=numbers[["false_supported", "false_contradicted"]].max(axis=1)
    )
    labels = list(dict.fromkeys(zip(numbers.rule, numbers.world, strict=True)))
    figure = Figure(figsize=(style.TWO_COLUMNS[0], 0.165 * len(labels) + 0.9))
    errors, coverage = figure.subplots(1, 2, sharey=True)
    _dots(errors, numbers, labels, "false", _WIDEST)
    _dots(coverage, numbers, labels, "coverage", _LEAST)
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
    return figure


def _dots(axes: Axes, numbers: pd.DataFrame, labels: list[tuple[str, str]], column: str, end: float) -> None:
    """Markers of a column in percent; those beyond the panel's end stand at it."""
    sizes = sorted(set(numbers.n_seeds))
    colours: Colormap = mpl.colormaps["viridis"]
    for marker, n, shade in zip("osD^v", sizes, np.linspace(0, 0.9, len(sizes)), strict=False):
        here = numbers[numbers.n_seeds == n].set_index(["rule", "world"]).loc[labels]
        x = np.minimum(100 * here[column], end) if column == "false" else np.maximum(100 * here[column], end)
        for hollow in (True, False):
            chosen = (here.out_of_reach == 1).to_numpy() == hollow
            axes.plot(
                x.to_numpy()[chosen],
                np.arange(len(labels))[chosen],
                marker=marker,
                linestyle="",
                markersize=3,
                color=colours(shade),
                markerfacecolor="none" if hollow else colours(shade),
                label=None if hollow else str(n),
            )
