"""What all figures share: names, colours and markers of the algorithms, and how a figure is saved."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, ParamSpec

import matplotlib as mpl
from matplotlib.figure import Figure

P = ParamSpec("P")
STYLE = Path(__file__).with_name("ieee.mplstyle")


class Look(NamedTuple):
    """How an algorithm appears in every figure."""

    label: str
    color: str
    marker: str


# Okabe and Ito's palette, which stays apart for the colour-blind and in grey.
LOOKS = {
    "tlwd": Look("TLwD", "#D55E00", "o"),
    "dpr": Look("DPR", "#009E73", "s"),
    "ddqn": Look("DDQN", "#0072B2", "^"),
    "q_learning": Look("Q-learning", "#CC79A7", "D"),
    "round_robin": Look("Round Robin", "#56B4E9", "v"),
}


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
            target = path.with_name(path.name + suffix)
            figure.savefig(target, metadata=metadata)
            written.append(target)
    return written
