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
from typing import Annotated, NamedTuple

import tyro

from jrcjax.checks import refuse
from jrcjax.files import write_text, write_whole
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
SUMMARIES = {"robustness": "manifests.json", "multiverse": "manifests.json", "reconstruction": PRESET_FILE}
"""A file that each study's summary has. They are published as they are."""
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


class Publication(NamedTuple):
    """What goes to one folder: found whole and in order before anything of any is written."""

    folder: Path
    files: dict[str, bytes]
    """By name in `folder`."""
    alone: bool = False
    """Whether no other file stays there."""

    def write(self) -> list[Path]:
        """Writes the files, and returns them."""
        fresh = self.folder.with_name(f"{self.folder.name}.new") if self.alone else self.folder
        if self.alone:
            shutil.rmtree(fresh, ignore_errors=True)  # of an interrupted run
        for name, content in self.files.items():
            (fresh / name).parent.mkdir(parents=True, exist_ok=True)
            write_whole(fresh / name, content)
        if self.alone:
            shutil.rmtree(self.folder, ignore_errors=True)
            fresh.rename(self.folder)
        return [self.folder / name for name in self.files]


def figures_from(out: Path, folder: Path, preset: str = Size.preset) -> Publication:
    """Figures, tables, verdicts and manifests, and the numbers that texts quote.

    Args:
      out: what `make figures` wrote.
      folder: of published figures.
      preset: of these figures.

    Raises:
      ValueError: naming what is missing, or is of another run than the manifests describe.
      OSError: if results are missing.
    """
    figures = [figure.name for figure in FIGURES]
    results = results_folder(out, Size(preset=preset))
    copies = [out / name for name in TABLES]
    copies += [out / f"{name}{suffix}" for name in (*figures, front.NAME) for suffix in (".pdf", ".png", ".csv")]
    manifests = {name: results / name / store.MANIFEST for name in (*figures, "source")}
    _require_files(out, [*copies, *manifests.values(), out / record.FILE])
    seeds = record.seeds_in(out, record.record_of(Size(preset=preset), figures, Delta()))
    for path in manifests.values():
        _require_seeds(path, seeds)
    numbers = numbers_of({figure.name: figure.results(results, seeds) for figure in FIGURES}, preset)
    files = {path.name: path.read_bytes() for path in copies}
    files |= {f"{name}.manifest.json": _without_place(path) for name, path in manifests.items()}
    files["numbers.json"] = (json.dumps(numbers, indent=2, allow_nan=False) + "\n").encode()
    return Publication(folder, files)


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


def _without_place(manifest: Path) -> bytes:
    """What says where results come from, but for where they lay on the machine that made them."""
    return _OUT.sub("", manifest.read_text(encoding="utf-8")).encode()


def study_from(summary: Path, folder: Path) -> Publication:
    """A study's summary, in place of the one that is published.

    Raises:
      ValueError: naming what is missing.
    """
    name = SUMMARIES[folder.name]
    if not (summary / name).is_file():
        refuse(folder.name, str(summary), f"the folder of a summary, with {name}")
    paths = [path for path in sorted(summary.rglob("*")) if path.is_file()]
    files = {path.relative_to(summary).as_posix(): path.read_bytes() for path in paths}
    if (manifests := summary / "manifests.json").is_file():
        files[manifests.name] = _without_place(manifests)
    return Publication(folder, files, alone=True)


def sweep_from(results: Path, folder: Path) -> Publication:
    """Tables, figures and manifest of a custom sweep.

    Raises:
      OSError: if there is no manifest.
    """
    summary = [path for path in sorted(results.glob(f"{results.name}*")) if path.suffix in (".csv", ".pdf", ".png")]
    files = {path.name: path.read_bytes() for path in summary}
    return Publication(folder, files | {store.MANIFEST: _without_place(results / store.MANIFEST)})


def publications(options: Options, root: Path) -> list[Publication]:
    """All that the options ask for.

    Raises:
      ValueError: naming what is missing, or does not fit.
      OSError: if files can't be read.
    """
    published, presets = root / "published", root / "sweeps" / "presets"
    found = [figures_from(options.figures, published / "figures")] if options.figures else []
    found += [study_from(folder, published / name) for name in SUMMARIES if (folder := getattr(options, name))]
    best = presets / PRESET_FILE
    if options.reconstruction:
        best = options.reconstruction / PRESET_FILE
        found.append(Publication(presets, {PRESET_FILE: best.read_bytes()}))
    if options.best:
        found.append(figures_from(options.best, published / BEST, preset_of(str(best))))
    return [*found, *(sweep_from(folder, published / folder.name) for folder in options.custom)]


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
    try:
        written = [path for publication in publications(options, root) for path in publication.write()]
        written += renew_texts(root)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print("\n".join(map(str, written)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
