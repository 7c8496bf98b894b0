"""The paper's figures: which sweep each rests on, how it is drawn, and which claims it bears."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from paper_figs.claims import learning_claims, sweep_claims
from paper_figs.claims.judge import Judgement
from paper_figs.plots import curves, points


@dataclass(frozen=True)
class PaperFigure:
    """One picture."""

    name: str
    """File name without suffix, and name of the sweep with its results."""
    number: int
    """Number in the paper, as `--only` takes it."""
    title: str
    table: Callable[[xr.Dataset], pd.DataFrame]
    """Results to plotted numbers."""
    draw: Callable[[pd.DataFrame, str], Figure]
    """Plotted numbers and title to picture."""
    claims: Callable[[xr.Dataset], list[Judgement]]
    """Results to verdicts."""


FIGURES = (
    PaperFigure(
        name="fig5a",
        number=5,
        title="Fig. 5(a): source environment",
        table=lambda data: curves.table(data, figure="5", panel="a"),
        draw=curves.draw,
        claims=learning_claims.source_claims,
    ),
    PaperFigure(
        name="fig5b",
        number=5,
        title="Fig. 5(b): target environment",
        table=lambda data: curves.table(data, figure="5", panel="b"),
        draw=curves.draw,
        claims=learning_claims.target_claims,
    ),
    PaperFigure(
        name="fig6",
        number=6,
        title="Fig. 6: event probability at high speed",
        table=lambda data: points.table(data, "6", "high_speed_event_probability"),
        draw=functools.partial(points.draw, x_label="$p_1^v$"),
        claims=sweep_claims.speed_claims,
    ),
    PaperFigure(
        name="fig7",
        number=7,
        title="Fig. 7: probability of favourable conditions",
        table=lambda data: points.table(data, "7", "favourable_probability"),
        draw=functools.partial(points.draw, x_label=r"$\tau_0$ of all factors"),
        claims=sweep_claims.favourable_claims,
    ),
    PaperFigure(
        name="fig8",
        number=8,
        title="Fig. 8: traffic density",
        table=lambda data: points.table(data, "8", "density"),
        draw=functools.partial(points.draw, x_label=r"$\omega$ (objects per 45 m $\times$ 45 m)"),
        claims=sweep_claims.density_claims,
    ),
    PaperFigure(
        name="fig9",
        number=9,
        title="Fig. 9: TLwD in the target",
        table=lambda data: curves.table(data, figure="9", panel="", points={"tlwd": 0, "tlwd_uniform": 1}),
        draw=curves.draw,
        claims=learning_claims.replay_claims,
    ),
)
NUMBERS = tuple(sorted({figure.number for figure in FIGURES}))
"""Numbers that `--only` takes."""
