"""The paper's figures: which sweep each rests on, and how it is drawn."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from paper_figs.claims.results import AXES
from paper_figs.plots import curves, points
from sweeps.results import store


@dataclass(frozen=True)
class PaperFigure:
    """One picture."""

    name: str
    """File name without suffix, and name of the sweep with its results."""
    number: int
    """Number in the paper, as `--only` takes it."""
    title: str
    table: Callable[[xr.Dataset, int], pd.DataFrame]
    """Results and slots per episode to plotted numbers."""
    draw: Callable[[pd.DataFrame, str], Figure]
    """Plotted numbers and title to picture."""
    learners: tuple[str, ...] = ()
    """Which of the sweep's it shows; all if empty. Claims are judged from all in any case."""

    def results(self, folder: Path, seeds: int) -> xr.Dataset:
        """Its sweep's results in a folder of sweeps, of all learners, in memory; see `store.load`."""
        return store.load(folder / self.name, seeds)

    def shown(self, data: xr.Dataset) -> xr.Dataset:
        """What it shows of these results."""
        return data.sel(algorithm=list(self.learners)) if self.learners else data


_OF_POINTS = ("tlwd", "dpr", "ddqn")

FIGURES = (
    PaperFigure(
        name="fig5a",
        number=5,
        title="Fig. 5(a): source environment",
        table=lambda data, slots: curves.table(data, figure="5", panel="a"),
        draw=curves.draw,
    ),
    PaperFigure(
        name="fig5b",
        number=5,
        title="Fig. 5(b): target environment",
        table=lambda data, slots: curves.table(data, figure="5", panel="b"),
        draw=curves.draw,
    ),
    PaperFigure(
        name="fig6",
        number=6,
        title="Fig. 6: event probability at high speed",
        table=lambda data, slots: points.table(data, "6", AXES["fig6"].coordinate, slots),
        draw=functools.partial(points.draw, x_label="$p_1^v$"),
        learners=_OF_POINTS,
    ),
    PaperFigure(
        name="fig7",
        number=7,
        title="Fig. 7: probability of favourable conditions",
        table=lambda data, slots: points.table(data, "7", AXES["fig7"].coordinate, slots),
        draw=functools.partial(points.draw, x_label=r"$\tau_0$ of all factors"),
        learners=_OF_POINTS,
    ),
    PaperFigure(
        name="fig8",
        number=8,
        title="Fig. 8: traffic density",
        table=lambda data, slots: points.table(data, "8", AXES["fig8"].coordinate, slots),
        draw=functools.partial(points.draw, x_label=r"$\omega$ (objects per 45 m $\times$ 45 m)"),
        learners=_OF_POINTS,
    ),
    PaperFigure(
        name="fig9",
        number=9,
        title="Fig. 9: TLwD in the target",
        table=lambda data, slots: curves.table(data, figure="9", panel="", points={"tlwd": 0, "tlwd_uniform": 1}),
        draw=curves.draw,
        learners=("tlwd",),
    ),
)
