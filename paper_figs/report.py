"""The report: one self-contained HTML page with figures, claims, the exact optimum and where it all comes from."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import jinja2
import xarray as xr

from paper_figs.claims import Judgement
from sweeps.sweep import Size

_TEMPLATE = Path(__file__).with_name("report.html.jinja")


def optimum_rows(sweep: str, data: xr.Dataset) -> list[dict[str, Any]]:
    """One row per point with the exact optimum's figures."""
    names = ("reward", "throughput", "miss_detection")
    return [
        {"sweep": sweep, "point": int(point)} | {n: float(data[f"optimum_{n}"].sel(point=point)) for n in names}
        for point in data["point"].values
    ]


def render(
    size: Size,
    pictures: dict[str, Path],
    claims: list[Judgement],
    optima: list[dict],
    diverged: list[dict],
    manifests: dict[str, str],
) -> str:
    """The page.

    Args:
      size: what was run.
      pictures: title to PNG file.
      claims: verdicts.
      optima: rows of `optimum_rows`.
      diverged: rows of `divergence.rows`.
      manifests: sweep name to its manifest's text.
    """
    embedded = [
        {"title": title, "png": base64.b64encode(path.read_bytes()).decode()} for title, path in pictures.items()
    ]
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    template = environment.from_string(_TEMPLATE.read_text())
    return template.render(
        size=size, pictures=embedded, claims=claims, optima=optima, diverged=diverged, manifests=manifests
    )
