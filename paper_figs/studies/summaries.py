"""The summaries of studies: small CSV and JSON files and figures, from results alone."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd

from jrcjax.files import write_text
from paper_figs.cores import on_cores
from paper_figs.plots import readings, style
from paper_figs.studies import multiverse, robustness
from sweeps.preset import slots_of
from sweeps.results import store
from sweeps.studies.multiverse import verdicts_file
from sweeps.studies.robustness import SOURCE, TARGET
from sweeps.sweep import Size, Sweep

_OF_MANY = ("sensitivity", "interactions", "known", "specification")
"""Names of a multiverse's files that need more readings than some runs have."""


def _write(folder: Path, tables: dict[str, pd.DataFrame]) -> list[Path]:
    return [style.save_table(table, folder / f"{name}.csv") for name, table in tables.items()]


def _manifests(folder: Path, sweeps: tuple[Sweep, ...], out: Path, keep: bool = False) -> Path:
    """What reproduces the summary: the manifests of all results that it rests on; those that it has may be kept."""
    path = folder / "manifests.json"
    all_sweeps = [part for sweep in sweeps for part in (sweep, sweep.source) if part]
    found = json.loads(path.read_text(encoding="utf-8")) if keep else {}
    for sweep in all_sweeps:
        found[sweep.name] = json.loads((out / sweep.name / store.MANIFEST).read_text(encoding="utf-8"))
    return write_text(path, json.dumps(found, indent=1, sort_keys=True) + "\n")


def summarise_robustness(sweeps: tuple[Sweep, ...], size: Size, out: Path) -> list[Path]:
    """Tables and the figure of a robustness study, in OUT/robustness/summary."""
    folder = out / "robustness" / "summary"
    folder.mkdir(parents=True, exist_ok=True)
    results = {"source": store.load(out / SOURCE.name, size.seeds), "target": store.load(out / TARGET.name, size.seeds)}
    tables = robustness.tables(results, slots_of(size.preset))
    pictures = style.save(robustness.draw(tables), folder / "robustness")
    return [*_write(folder, tables), *pictures, _manifests(folder, sweeps, out)]


def summarise_multiverse(sweeps: tuple[Sweep, ...], size: Size, out: Path, keep: bool = False) -> list[Path]:
    """Tables and figures of a multiverse, in OUT/multiverse/summary.

    Args:
      sweeps: the blocks of readings that were run.
      size: of the runs.
      out: the folder of all results.
      keep: whether what the summary says of other readings, or of these from other numbers of seeds, is kept.
    """
    path = verdicts_file(out)
    folder = path.parent
    folder.mkdir(parents=True, exist_ok=True)
    known = [pd.read_csv(path)] if keep else []
    found = multiverse.together([*known, *on_cores(_of_block, ((sweep, size, out) for sweep in sweeps))])
    style.save_table(found, path)
    found = pd.read_csv(path)  # so that conclusions are the same whether readings came from this run or an earlier one
    tables = {
        "readings": multiverse.readings(found.reading.unique().tolist()),
        "claims": multiverse.shares(found),
        **multiverse.decisive(found, size.episodes),
    }
    pictures = style.save(readings.draw_shares(tables["claims"]), folder / "claims")
    if "sensitivity" in tables:
        pictures += style.save(readings.draw_decisive(tables["sensitivity"]), folder / "sensitivity")
        pictures += style.save(multiverse.specification(found, tables["sensitivity"]), folder / "specification")
    written = [path, *_write(folder, tables), *pictures]
    _remove_others(folder, written)
    return [*written, _manifests(folder, sweeps, out, keep)]


def _remove_others(folder: Path, written: list[Path]) -> None:
    """Removes what an earlier run of more readings left, which would say something else than the verdicts beside it."""
    for path in (folder / f"{name}{suffix}" for name in _OF_MANY for suffix in (".csv", ".pdf", ".png")):
        if path not in written:
            path.unlink(missing_ok=True)


def _of_block(sweep: Sweep, size: Size, out: Path) -> pd.DataFrame:
    """The verdicts in a block's readings, of the claims whose figures were run."""
    assert sweep.source
    source, target = (store.load(out / part.name, size.seeds) for part in (sweep.source, sweep))
    found = multiverse.verdicts(list(multiverse.of_readings(source, target)))
    return found.loc[found.n_seeds > 0]
