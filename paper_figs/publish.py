"""Publishes results: copies what a run wrote to `published/`, and renews the texts that quote it.

    python -m paper_figs.publish --figures out --robustness OUT/robustness/summary

and the same for --multiverse and --reconstruction, for folders of custom sweeps that texts quote, --custom, and for
what `make figures` wrote with --preset best, --best.

Without options the texts alone are renewed.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from jrcjax.checks import refuse
from jrcjax.files import write_text
from paper_figs import record
from paper_figs.analysis import front
from paper_figs.claims.delta import Delta
from paper_figs.figures import FIGURES
from paper_figs.numbers import numbers_of
from paper_figs.pipeline import results_folder
from paper_figs.readme import renewed
from paper_figs.studies.reconstruction import BEST, PRESET_FILE
from sweeps.options import FLAGS, Folder
from sweeps.preset import preset_of
from sweeps.results import store
from sweeps.sweep import Size

ROOT = Path(__file__).parents[1]
TABLES = ("claims.json", "regret.csv", "seeds_needed.csv")
STUDIES = ("robustness", "multiverse", "reconstruction")
"""Whose summaries are published as they are."""
_OUT = re.compile(r" --out [^ \"]+")  # of a command in a manifest
_TEXTS = ("*.md", "paper_figs/*.md", "docs/**/*.md")


@dataclass(frozen=True)
class Options:
    """Copies results to published/ and renews the texts that quote them."""

    figures: Folder = None
    """Folder that `make figures` wrote, with all figures at the paper's size."""
    robustness: Folder = None
    """Folder with the summary of a robustness study."""
    multiverse: Folder = None
    """Folder with the summary of a multiverse."""
    reconstruction: Folder = None
    """Folder with the summary of a reconstruction, whose best reading becomes the preset `best`."""
    best: Folder = None
    """Folder that `make figures` wrote with that preset."""
    custom: Annotated[tuple[Path, ...], tyro.conf.UseAppendAction] = ()
    """Folder of a custom sweep, whose name it keeps; for those that texts quote see docs/explanation/readings.md."""
    root: Folder = ROOT
    """Folder of the project."""


def texts(root: Path) -> list[Path]:
    """The project's texts that may quote results."""
    return sorted({path for pattern in _TEXTS for path in root.glob(pattern)})


def publish_figures(out: Path, target: Path, preset: str = Size.preset) -> list[Path]:
    """Copies figures, tables, verdicts and manifests, and writes the numbers that texts quote.

    Nothing is written unless all is there, and of the run that the manifests describe.

    Args:
      out: what `make figures` wrote.
      target: folder of published figures.
      preset: of these figures.

    Returns:
      The files in `target`.

    Raises:
      ValueError: naming what is missing, or is of another run.
      OSError: if results are missing.
    """
    figures = [figure.name for figure in FIGURES]
    folder = results_folder(out, Size(preset=preset))
    copies = [out / name for name in TABLES]
    copies += [out / f"{name}{suffix}" for name in (*figures, front.NAME) for suffix in (".pdf", ".png", ".csv")]
    manifests = {name: folder / name / store.MANIFEST for name in (*figures, "source")}
    _require_files(out, [*copies, *manifests.values(), out / record.FILE])
    seeds = record.seeds_in(out, record.record_of(Size(preset=preset), figures, Delta()))
    for path in manifests.values():
        _require_seeds(path, seeds)
    results = {figure.name: figure.results(folder, seeds) for figure in FIGURES}
    numbers = json.dumps(numbers_of(results, preset), indent=2, allow_nan=False) + "\n"
    target.mkdir(parents=True, exist_ok=True)
    return [
        *(Path(shutil.copyfile(path, target / path.name)) for path in copies),
        *(_publish_manifest(path, target / f"{name}.manifest.json") for name, path in manifests.items()),
        write_text(target / "numbers.json", numbers),
    ]


def _require_files(out: Path, paths: list[Path]) -> None:
    """Refuses a folder in which files are missing."""
    missing = [str(path.relative_to(out)) for path in paths if not path.is_file()]
    if missing:
        refuse("folder", str(out), f"one to which `make figures` has written all figures: {', '.join(missing)}")


def _require_seeds(manifest: Path, seeds: int) -> None:
    """Refuses figures of other seeds than a manifest tells of."""
    there = json.loads(manifest.read_text(encoding="utf-8"))["seeds"]
    if there != list(range(seeds)):
        refuse("seeds", seeds, f"figures of all that {manifest} tells of, {store.in_words(set(there))}")


def _publish_manifest(path: Path, target: Path) -> Path:
    """Copies what says where results come from, but for where they lay on the machine that made them."""
    return write_text(target, _OUT.sub("", path.read_text(encoding="utf-8")))


def publish_study(summary: Path, target: Path) -> Path:
    """Copies a study's summary in place of the one that is published, of which no file stays."""
    fresh = target.with_name(f"{target.name}.new")
    shutil.rmtree(fresh, ignore_errors=True)
    shutil.copytree(summary, fresh)
    manifests = fresh / "manifests.json"
    if manifests.is_file():
        _publish_manifest(manifests, manifests)
    shutil.rmtree(target, ignore_errors=True)
    return fresh.rename(target)


def publish_preset(file: Path, target: Path) -> Path:
    """Copies a preset to where its name stands for it."""
    target.mkdir(parents=True, exist_ok=True)
    return Path(shutil.copyfile(file, target / file.name))


def publish_sweep(folder: Path, target: Path) -> list[Path]:
    """Copies tables, figures and manifest of a custom sweep; returns the files in `target`."""
    target.mkdir(parents=True, exist_ok=True)
    summary = [path for path in sorted(folder.glob(f"{folder.name}*")) if path.suffix in (".csv", ".pdf", ".png")]
    written = [Path(shutil.copyfile(path, target / path.name)) for path in summary]
    return [*written, _publish_manifest(folder / store.MANIFEST, target / store.MANIFEST)]


def renew_texts(root: Path) -> list[Path]:
    """Makes the marked parts of all texts anew; returns the texts that changed."""
    changed = []
    for path in texts(root):
        before = path.read_text(encoding="utf-8")
        after = renewed(before, root / "published")
        if after != before:
            write_text(path, after)
            changed.append(path)
    return changed


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    options = tyro.cli(Options, prog="python -m paper_figs.publish", args=args, config=FLAGS)
    root = options.root or ROOT
    written = []
    try:
        if options.figures:
            written += publish_figures(options.figures, root / "published" / "figures")
        for name in STUDIES:
            if summary := getattr(options, name):
                written.append(publish_study(summary, root / "published" / name))
        if options.reconstruction:
            written.append(publish_preset(options.reconstruction / PRESET_FILE, root / "sweeps" / "presets"))
        if options.best:
            preset = preset_of(str(root / "sweeps" / "presets" / PRESET_FILE))
            written += publish_figures(options.best, root / "published" / BEST, preset)
        for folder in options.custom:
            written += publish_sweep(folder, root / "published" / folder.name)
        written += renew_texts(root)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print("\n".join(map(str, written)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
