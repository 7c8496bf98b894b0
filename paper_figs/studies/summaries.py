"""The summaries of studies: small CSV and JSON files and figures, from results alone."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd

from jrcjax.files import write_text
from paper_figs.plots import readings, style
from paper_figs.studies import multiverse, robustness
from sweeps.preset import slots_of
from sweeps.results import store
from sweeps.studies.robustness import SOURCE, TARGET
from sweeps.sweep import Size, Sweep


def _write(folder: Path, tables: dict[str, pd.DataFrame]) -> list[Path]:
    return [style.save_table(table, folder / f"{name}.csv") for name, table in tables.items()]


def _manifests(folder: Path, sweeps: tuple[Sweep, ...], out: Path) -> Path:
    """What reproduces the summary: the manifests of all results that it rests on."""
    all_sweeps = [part for sweep in sweeps for part in (sweep, sweep.source) if part]
    found = {
        sweep.name: json.loads((out / sweep.name / store.MANIFEST).read_text(encoding="utf-8")) for sweep in all_sweeps
    }
    return write_text(folder / "manifests.json", json.dumps(found, indent=1) + "\n")


def summarise_robustness(sweeps: tuple[Sweep, ...], size: Size, out: Path) -> list[Path]:
    """Tables and the figure of a robustness study, in OUT/robustness/summary."""
    folder = out / "robustness" / "summary"
    folder.mkdir(parents=True, exist_ok=True)
    results = {"source": store.load(out / SOURCE.name, size.seeds), "target": store.load(out / TARGET.name, size.seeds)}
    tables = robustness.tables(results, slots_of(size.preset))
    pictures = style.save(robustness.draw(tables), folder / "robustness")
    return [*_write(folder, tables), *pictures, _manifests(folder, sweeps, out)]


def summarise_multiverse(sweeps: tuple[Sweep, ...], size: Size, out: Path) -> list[Path]:
    """Tables and figures of a multiverse, in OUT/multiverse/summary."""
    folder = out / "multiverse" / "summary"
    folder.mkdir(parents=True, exist_ok=True)
    judged = []
    for sweep in sweeps:
        assert sweep.source
        source, target = (store.load(out / part.name, size.seeds) for part in (sweep.source, sweep))
        judged += multiverse.of_readings(source, target)
    found = multiverse.verdicts(judged)
    tables = {
        "readings": multiverse.readings([number for number, _ in judged]),
        "verdicts": found,
        "claims": multiverse.shares(found),
        **multiverse.decisive(found),
    }
    pictures = style.save(readings.draw_shares(tables["claims"]), folder / "claims")
    if "sensitivity" in tables:
        pictures += style.save(readings.draw_decisive(tables["sensitivity"]), folder / "sensitivity")
        pictures += style.save(multiverse.specification(found, tables["sensitivity"]), folder / "specification")
    return [*_write(folder, tables), *pictures, _manifests(folder, sweeps, out)]
