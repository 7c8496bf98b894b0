"""From nothing to all files: runs the sweeps that are missing, then draws, judges and writes."""

from __future__ import annotations

import contextlib
import json
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure
from rich.console import Console

from jrcjax.files import write_text
from paper_figs import report
from paper_figs.analysis import divergence, front, ranking, regret
from paper_figs.claims.delta import Delta
from paper_figs.claims.judge import Judgement, as_json
from paper_figs.claims.results import Rules
from paper_figs.claims.table import claims_of
from paper_figs.figures import FIGURES, NUMBERS, PaperFigure
from paper_figs.plots import front as front_plot
from paper_figs.plots import style
from sweeps.engine.estimate import in_words
from sweeps.engine.run import compile_ahead, expected_seconds, run_sweep
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
    unknown = sorted(set(numbers) - set(NUMBERS))
    if unknown:
        raise ValueError(f"only: {unknown}; allowed: {', '.join(map(str, NUMBERS))}")
    return [figure for figure in FIGURES if not numbers or figure.number in numbers]


@dataclass
class _Written:
    """What has been written of all figures, and what the files about all of them need."""

    files: list[Path] = field(default_factory=list)
    pictures: dict[str, Path] = field(default_factory=dict)
    manifests: dict[str, str] = field(default_factory=dict)


def make_figures(
    numbers: tuple[int, ...], size: Size, out: Path, console: Console, delta: Delta | None = None
) -> list[Path]:
    """Runs the sweeps that are missing, then writes all files of the figures with these numbers.

    Raises:
      ValueError: unknown figures, bad sizes, a bad delta, or results of another configuration in `out`.
    """
    wanted = chosen(numbers)
    size.check()
    rules = Rules(delta=delta or Delta())
    rules.delta.check()
    out.mkdir(parents=True, exist_ok=True)
    folder = results_folder(out, size)
    sweeps = [SWEEPS[figure.name] for figure in wanted]
    written, results, slots = _Written(), {}, slots_of(size.preset)
    drawn: list[Future] = []
    # A single thread draws, since matplotlib's settings are global, while the next figure's sweep runs.
    with ThreadPoolExecutor(1, "drawing") as drawing, contextlib.closing(compile_ahead(sweeps, size, folder)) as ahead:
        seconds = expected_seconds(sweeps, size, folder)
        console.print(
            f"figures: {len(wanted)}, seeds: {size.seeds}, episodes: {size.episodes}; "
            f"about {in_words(seconds)} in all, and what has to be compiled"
        )
        for figure in wanted:
            found = run_sweep(SWEEPS[figure.name], size, folder, console, resume=True, ahead=ahead)
            results[figure.name] = store.load(found, size.seeds)
            drawn.append(drawing.submit(_write_figure, figure, results[figure.name], slots, out, written))
            written.manifests[figure.name] = (found / store.MANIFEST).read_text(encoding="utf-8")
            if figure.name == "fig5b":
                drawn.append(drawing.submit(_write_front, results[figure.name], size, out, written))
        for each in drawn:
            each.result()
    _write_tables(results, slots, out, written)
    _write_verdicts(results, rules, size, out, written)
    return written.files


def _write_figure(figure: PaperFigure, data: xr.Dataset, slots: int, out: Path, written: _Written) -> None:
    table = figure.table(data, slots)
    _write(table, figure.draw(table, figure.title), figure.name, figure.title, out, written)


def _write_front(data: xr.Dataset, size: Size, out: Path, written: _Written) -> None:
    """What policies can reach in the target, with its learners; no figure of the paper."""
    table = front.table(environment_of("target", size.preset), data)
    _write(table, front_plot.draw(table, front.TITLE), front.NAME, front.TITLE, out, written)


def _write(table: pd.DataFrame, picture: Figure, name: str, title: str, out: Path, written: _Written) -> None:
    path = style.save_table(table, out / f"{name}.csv")
    files = style.save(picture, out / name)
    written.files += [path, *files]
    written.pictures[title] = files[-1]


def _write_tables(results: dict[str, xr.Dataset], slots: int, out: Path, written: _Written) -> None:
    tables = {
        "regret": [regret.table(data, name, slots) for name, data in results.items()],
        "seeds_needed": [ranking.needed_table(data, name) for name, data in results.items()],
    }
    for name, parts in tables.items():
        written.files.append(style.save_table(pd.concat(parts), out / f"{name}.csv"))


def judgements_of(results: dict[str, xr.Dataset], rules: Rules | None = None) -> list[Judgement]:
    """The judgements of all claims that rest on figures that were made."""
    return [judgement for judgement in claims_of(results, rules) if judgement.n_seeds]


def _write_verdicts(results: dict[str, xr.Dataset], rules: Rules, size: Size, out: Path, written: _Written) -> None:
    judgements = judgements_of(results, rules)
    optima = [row for name, data in results.items() for row in report.optimum_rows(name, data)]
    diverged = [row for name, data in results.items() for row in divergence.rows(name, data)]
    page = report.render(size, written.pictures, judgements, optima, diverged, written.manifests)
    claims = json.dumps(as_json(judgements), indent=2, allow_nan=False) + "\n"
    for name, text in {"claims.json": claims, "report.html": page}.items():
        written.files.append(write_text(out / name, text))
