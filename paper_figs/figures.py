"""The paper's figures: which sweep each rests on, how it is drawn, and which claims it bears."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from paper_figs import claims, curves


@dataclass(frozen=True)
class PaperFigure:
    """One picture."""

    name: str
    """File name without suffix."""
    number: int
    """Number in the paper, as `--only` takes it."""
    title: str
    sweep: str
    """Name of the sweep with its results."""
    table: Callable[[xr.Dataset], pd.DataFrame]
    """Results to plotted numbers."""
    draw: Callable[[pd.DataFrame, str], Figure]
    """Plotted numbers and title to picture."""
    claims: Callable[[xr.Dataset], list[claims.Judgement]]
    """Results to verdicts."""


FIGURES = (
    PaperFigure(
        name="fig5a",
        number=5,
        title="Fig. 5(a): source environment",
        sweep="fig5a",
        table=lambda data: curves.table(data, figure="5", panel="a"),
        draw=curves.draw,
        claims=claims.source_claims,
    ),
)
NUMBERS = tuple(sorted({figure.number for figure in FIGURES}))
"""Numbers that `--only` takes."""
