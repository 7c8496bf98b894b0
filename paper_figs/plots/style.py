"""What all figures share: names, colours and markers of the algorithms, and how a figure is saved."""

from __future__ import annotations

import functools
import io
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, ParamSpec

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jrcjax.files import write_text, write_whole

P = ParamSpec("P")
STYLE = Path(__file__).with_name("ieee.mplstyle")
TWO_COLUMNS = (7.16, 2.55)
"""Inches of a figure across both columns."""


class Look(NamedTuple):
    """How a line appears in every figure."""

    label: str
    color: str
    marker: str = ""
    line: str | tuple[int, tuple[float, ...]] = "-"
    size: float | None = None
    """Of the marker in points; the style's if None."""
    hollow: bool = False
    """Whether the marker shows what is drawn on it."""


# Okabe and Ito's palette, which stays apart for the colour-blind; markers and line styles do in grey. DDQN, which often
# lies on DPR, is a dashed line on a solid one, with small markers in hollow ones.
LOOKS = {
    "tlwd": Look("TLwD", "#D55E00", "o"),
    "tlwd_uniform": Look("TLwD, uniform", "#000000", "x", (0, (2.5, 1.0))),
    "dpr": Look("DPR", "#009E73", "s", size=5.0, hollow=True),
    "ddqn": Look("DDQN", "#0072B2", "^", (0, (4.0, 1.5)), size=3.0),
    "q_learning": Look("Q-learning", "#CC79A7", "D", (0, (6.0, 1.0, 1.0, 1.0))),
    "round_robin": Look("Round Robin", "#56B4E9", "v"),
}
EXACT = {
    "optimum": Look("optimum (exact)", "black", line="--"),
    "explored": Look("optimum, exploring (exact)", "0.35", line="-."),
    "constant": Look("best constant (exact)", "0.5", line=":"),
}
"""What is computed and not simulated."""


def plot(axes: Axes, curve: pd.DataFrame, look: Look, markers: int) -> None:
    """One line of a table with its band and about so many markers, where there is room beside those of other lines."""
    every = max(len(curve) // markers, 1)
    place = [*LOOKS.values()].index(look) if look in LOOKS.values() else 0
    axes.plot(
        curve.x,
        curve["mean"],
        color=look.color,
        linestyle=look.line,
        marker=look.marker,
        markersize=look.size,
        markerfacecolor="white" if look.hollow else look.color,
        markevery=(place * every // len(LOOKS), every),
        label=look.label,
    )
    if curve.n_seeds.max() > 0:
        axes.fill_between(curve.x, curve.ci_low, curve.ci_high, color=look.color, alpha=0.25, linewidth=0)


def band_of(numbers: pd.DataFrame, has_bands: bool = True) -> str:
    """What a figure's title says of its seeds, of its bands where it has some, and of agents that diverged."""
    seeds = int(numbers.n_seeds.max())
    diverged = int(numbers.drop_duplicates(["algorithm", "x"]).groupby("algorithm").n_diverged.max().sum())
    note = f"; up to {diverged} diverged agents at a point" if diverged else ""
    number, bands = (f"{seeds} seeds", "bands: 95 % interval of the mean") if seeds > 1 else ("one seed", "no interval")
    return (f"{number}, {bands}" if has_bands else number) + note


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Runs a drawing function under the style, without touching anyone else's matplotlib settings."""

    @functools.wraps(draw)
    def under_style(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with mpl.rc_context(fname=STYLE):
            return draw(*args, **kwargs)

    return under_style


def save(figure: Figure, path: Path) -> list[Path]:
    """Writes PDF and PNG beside each other; the same figure gives the same bytes."""
    written = []
    with mpl.rc_context(fname=STYLE):
        for suffix, metadata in ((".pdf", {"CreationDate": None, "Producer": None}), (".png", {"Software": None})):
            picture, target = io.BytesIO(), path.with_name(path.name + suffix)
            figure.savefig(picture, format=suffix[1:], metadata=metadata)
            write_whole(target, picture.getvalue())
            written.append(target)
    return written


def save_table(table: pd.DataFrame, path: Path) -> Path:
    """Writes a table as CSV in UTF-8, numbers with six digits."""
    return write_text(path, table.to_csv(index=False, float_format="%.6g"))
