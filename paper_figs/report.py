"""The report: one self-contained HTML page with figures, claims, the exact optimum and where it all comes from."""

from __future__ import annotations

import base64
import json
import re
import shlex
import struct
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import xarray as xr

from jrcjax.model.params import EnvParams
from jrcjax.model.presets import ENVIRONMENTS, PRESETS
from jrcjax.named import field_at, named_inputs
from paper_figs.claims import words
from paper_figs.claims.delta import Delta
from paper_figs.claims.judge import Judgement
from paper_figs.claims.results import Rules
from sweeps.preset import environment_of, label_of, slots_of
from sweeps.sweep import Size

_TEMPLATE = Path(__file__).with_name("report.html.jinja")
_MORE_SEEDS = 10  # at least, to decide more
_OPTIMUM = ("reward", "throughput", "miss_detection")
SIGNS = {"supported": "✓", "contradicted": "✗", "undecided": "?"}
"""Signs of the verdicts, which are told apart without their colours."""


def optimum_rows(sweep: str, data: xr.Dataset) -> list[dict[str, Any]]:
    """One row per point with the exact optimum's figures, and what varies where there are several points."""
    varied = [str(name) for name, values in data.coords.items() if values.dims == ("point",) and name != "point"]
    varied = varied if data.sizes["point"] > 1 else []
    return [
        {
            "sweep": sweep,
            "point": int(point),
            "x": {name: float(data[name].sel(point=point)) for name in varied},
            **{name: float(data[f"optimum_{name}"].sel(point=point)) for name in _OPTIMUM},
        }
        for point in data["point"].values
    ]


def render(
    size: Size,
    pictures: dict[str, Path],
    claims: list[Judgement],
    optima: list[dict],
    diverged: list[dict],
    manifests: dict[str, str],
    only: tuple[int, ...] = (),
    delta: Delta | None = None,
) -> str:
    """The page.

    Args:
      size: what was run.
      pictures: title to PNG file, whose name without suffix is that of the figure's sweep.
      claims: verdicts.
      optima: rows of `optimum_rows`.
      diverged: rows of `divergence.rows`.
      manifests: sweep name to its manifest's text.
      only: numbers of the figures that were asked for, all if empty.
      delta: what the verdicts count as negligible; the defaults if None.
    """
    figures = [_picture(title, path) for title, path in pictures.items()]
    parsed = {name: json.loads(text) for name, text in manifests.items()}
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {
        "number": _number,
        "short": words.number,
        "criterion": words.criterion,
        "interval": words.interval,
        "anchor": _anchor,
    }
    return environment.from_string(_TEMPLATE.read_text(encoding="utf-8")).render(
        size=size,
        preset=label_of(size.preset),
        file=None if size.preset in PRESETS else size.preset,
        figures=figures,
        claims=[(claim, _figure_of(claim, figures)) for claim in claims],
        counts={verdict: sum(claim.verdict == verdict for claim in claims) for verdict in SIGNS},
        signs=SIGNS,
        least_seeds=Rules().least_seeds,
        environments=_environments(size.preset),
        optima=optima,
        slots=slots_of(size.preset),
        diverged=diverged,
        command=_command(size, only, delta or Delta()),
        more=_command(replace(size, seeds=max(3 * size.seeds, _MORE_SEEDS)), only, delta or Delta()),
        settings=_settings(parsed),
        made=_made(parsed),
        manifests=manifests,
    )


def _picture(title: str, path: Path) -> dict[str, Any]:
    png = path.read_bytes()
    width, height = struct.unpack(">II", png[16:24])  # the first fields of the first chunk
    narrow = width < 1.5 * height
    content = base64.b64encode(png).decode()
    return {"name": path.stem, "title": title, "png": content, "width": width, "height": height, "is_column": narrow}


def _number(value: float) -> str:
    """A number for a table, with four digits; a dash where there is none."""
    return "–" if value != value else f"{value:#.4g}".rstrip(".").replace("-", "−")


def _anchor(claim: Judgement) -> str:
    """The id of a claim's row: "c1-reached" for "C1 (reached)"."""
    return re.sub(r"[^a-z0-9]+", "-", claim.claim.lower()).strip("-")


def _figure_of(claim: Judgement, figures: list[dict[str, Any]]) -> str | None:
    """The name of the picture that a claim rests on: "6a" is a panel of fig6, "5a" is fig5a."""
    names = [figure["name"] for figure in figures]
    return next((name for name in (f"fig{claim.figure}", f"fig{claim.figure}".rstrip("abc")) if name in names), None)


def _command(size: Size, only: tuple[int, ...], delta: Delta) -> str:
    """What makes the same figures and the same page."""
    preset = size.preset if size.preset in PRESETS else "FILE.toml"
    options = ["--seeds", str(size.seeds), "--episodes", str(size.episodes), "--preset", preset]
    smoke = [] if size.pretraining == Size.pretraining else ["--smoke"]
    if only:
        options += ["--only", *map(str, only)]
    for name, value in asdict(delta).items():
        if value != getattr(Delta(), name):
            options += [f"--delta.{name.replace('_', '-')}", str(value)]
    return f"make figures ARGS={shlex.quote(shlex.join([*smoke, *options]))}"


def _environments(preset: str) -> dict[str, list[str]]:
    """Every number of source and target by its path, without the bank, which follows from the others."""
    both = [_numbers(environment_of(name, preset)) for name in ENVIRONMENTS]
    return {path: [numbers[path] for numbers in both] for path in both[0]}


def _numbers(params: EnvParams) -> dict[str, str]:
    found = {}
    for path, values in named_inputs(params).items():
        names = field_at(EnvParams, path).names
        found[path] = names[int(values)] if names else _listed(np.asarray(values))
    return found | {"max_steps_in_episode": str(params.max_steps_in_episode)}


def _listed(values: np.ndarray) -> str:
    if values.ndim < 2:
        return ", ".join(f"{value:.6g}" for value in np.atleast_1d(values))
    return "; ".join(map(_listed, values))


def _settings(manifests: dict[str, dict]) -> dict[str, dict[str, dict[str, list[str]]]]:
    """Section to field to value to the sweeps with that value; a value that all sweeps share has all of their names."""
    found: dict[str, dict[str, dict[str, list[str]]]] = {"hparams": {}, "config": {}}
    for name, manifest in manifests.items():
        for section, fields in found.items():
            for field, value in manifest["configuration"].get(section, {}).items():
                shown = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
                fields.setdefault(field, {}).setdefault(shown, []).append(name)
    return found


def _made(manifests: dict[str, dict]) -> list[dict[str, Any]]:
    """Where each sweep's results come from."""
    return [
        {
            "sweep": name,
            "seeds": len(m["seeds"]),
            "finished": m["finished"],
            "command": "; ".join(_each(m["command"])),
            "commit": ", ".join((commit or "not in git")[:12] for commit in _each(m["git_commit"]))
            + (" with changes" if any(_each(m["git_modified"])) else ""),
            "machine": "; ".join(
                ", ".join(_in_words(key, value) for key, value in machine.items()) for machine in _each(m["machine"])
            ),
            "versions": "; ".join(
                ", ".join(f"{package} {version}" for package, version in versions.items())
                for versions in _each(m["versions"])
            ),
        }
        for name, m in manifests.items()
    ]


def _each(value: Any) -> list[Any]:
    """The values of a manifest's field: several where the parts of a sweep come from several places."""
    return value if isinstance(value, list) else [value]


def _in_words(key: str, value: Any) -> str:
    if key == "cores":
        return f"{value} cores"
    return " ".join(value) if isinstance(value, list) else str(value)
