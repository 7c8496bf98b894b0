"""From nothing to all files: runs the sweeps that are missing, then draws, judges and writes."""

from __future__ import annotations

import functools
import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure
from rich.console import Console

from jrcjax.files import write_text
from paper_figs import check_numbers, record, report
from paper_figs.analysis import divergence, front, ranking, regret
from paper_figs.claims.delta import Delta
from paper_figs.claims.judge import Judgement, as_json
from paper_figs.claims.results import Rules
from paper_figs.claims.table import claims_of
from paper_figs.figures import FIGURES, PaperFigure
from paper_figs.plots import front as front_plot
from paper_figs.plots import style
from sweeps.engine.estimate import in_words
from sweeps.engine.plan import expected_seconds, plan
from sweeps.engine.run import run_together
from sweeps.preset import environment_of, label_of, slots_of
from sweeps.results import store
from sweeps.studies.registry import SWEEPS
from sweeps.sweep import Size


def results_folder(out: Path, size: Size) -> Path:
    """Where results of one preset and length lie, so that runs of different ones don't meet."""
    return out / "results" / f"{label_of(size.preset)}-{size.episodes}-episodes"


def chosen(numbers: tuple[int, ...]) -> list[PaperFigure]:
    """The figures with these numbers, all if there are none.

    Raises:
      ValueError: unknown numbers.
    """
    check_numbers(numbers)
    return [figure for figure in FIGURES if not numbers or figure.number in numbers]


class _Drawn(NamedTuple):
    """A figure that has been written, and what the files about all of them need of it."""

    results: xr.Dataset
    """Of all learners that were run."""
    shown: xr.Dataset
    """Of those in the picture."""
    manifest: str
    files: list[Path]
    pictures: dict[str, Path]
    """PNG files by title."""


def make_figures(
    numbers: tuple[int, ...], size: Size, out: Path, console: Console, delta: Delta | None = None
) -> list[Path]:
    """Runs the sweeps that are missing, then writes all files of the figures with these numbers.

    Raises:
      ValueError: unknown figures, bad sizes, a bad delta, or results of another configuration in `out`.
    """
    wanted = {figure.name: figure for figure in chosen(numbers)}
    size.check()
    rules = Rules(delta=delta or Delta())
    rules.delta.check()
    out.mkdir(parents=True, exist_ok=True)
    folder = results_folder(out, size)
    record.remove(out)
    sweeps = [SWEEPS[name] for name in wanted]
    seconds = expected_seconds(plan(sweeps, size, folder), folder)
    console.print(
        f"figures: {len(wanted)}, seeds: {size.seeds}, episodes: {size.episodes}; "
        f"about {in_words(seconds)} in all, and what has to be compiled"
    )
    # A single thread draws, since matplotlib's settings are global, while what is left is run.
    with ThreadPoolExecutor(1, "drawing") as drawing:
        if "fig5b" in wanted:
            drawing.submit(_exact_front, size.preset)
        drawing_of = {
            sweep.name: drawing.submit(_draw, wanted[sweep.name], folder, size, out)
            for sweep in run_together(sweeps, size, folder, console)
        }
    drawn = {name: drawing_of[name].result() for name in wanted}
    return [
        *(file for each in drawn.values() for file in each.files),
        *_write_tables({name: each.shown for name, each in drawn.items()}, size, out),
        *_write_verdicts(drawn, rules, size, out, numbers),
        record.write(out, record.record_of(size, wanted, rules.delta)),
    ]


def _draw(figure: PaperFigure, folder: Path, size: Size, out: Path) -> _Drawn:
    """Writes a figure; with Fig. 5(b) what policies can reach in the target, which is no figure of the paper."""
    data = figure.results(folder, size.seeds)
    shown = figure.shown(data)
    table = figure.table(shown, slots_of(size.preset))
    written = {figure.title: _write(table, figure.draw(table, figure.title), out / figure.name)}
    if figure.name == "fig5b":
        table = front.table(environment_of("target", size.preset), data, _exact_front(size.preset))
        written[front.TITLE] = _write(table, front_plot.draw(table, front.TITLE), out / front.NAME)
    files = [file for of_one in written.values() for file in of_one]
    manifest = (folder / figure.name / store.MANIFEST).read_text(encoding="utf-8")
    return _Drawn(data, shown, manifest, files, {title: of_one[-1] for title, of_one in written.items()})


@functools.lru_cache
def _exact_front(preset: str) -> list[tuple]:
    """What of the front does not wait for learners."""
    return front.exact_rows(environment_of("target", preset))


def _write(table: pd.DataFrame, picture: Figure, stem: Path) -> list[Path]:
    return [style.save_table(table, stem.with_suffix(".csv")), *style.save(picture, stem)]


def _write_tables(results: dict[str, xr.Dataset], size: Size, out: Path) -> list[Path]:
    slots = slots_of(size.preset)
    tables = {
        "regret": [regret.table(data, name, slots) for name, data in results.items()],
        "seeds_needed": [ranking.needed_table(data, name) for name, data in results.items()],
    }
    return [style.save_table(pd.concat(parts), out / f"{name}.csv") for name, parts in tables.items()]


def judgements_of(results: dict[str, xr.Dataset], rules: Rules | None = None) -> list[Judgement]:
    """The judgements of all claims that rest on figures that were made."""
    return [judgement for judgement in claims_of(results, rules) if judgement.n_seeds]


def _write_verdicts(
    drawn: dict[str, _Drawn], rules: Rules, size: Size, out: Path, numbers: tuple[int, ...]
) -> list[Path]:
    results = {name: each.results for name, each in drawn.items()}
    judgements = judgements_of(results, rules)
    optima = [row for name, data in results.items() for row in report.optimum_rows(name, data)]
    diverged = [row for name, data in results.items() for row in divergence.rows(name, data)]
    pictures = {title: path for each in drawn.values() for title, path in each.pictures.items()}
    manifests = {name: each.manifest for name, each in drawn.items()}
    page = report.render(size, pictures, judgements, optima, diverged, manifests, numbers, rules.delta)
    claims = json.dumps(as_json(judgements), indent=2, allow_nan=False) + "\n"
    return [write_text(out / name, text) for name, text in {"claims.json": claims, "report.html": page}.items()]
