"""Command line: `python -m paper_figs.calibration` writes how often intervals and verdicts are right."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from sweeps.command import undisturbed
from sweeps.options import FLAGS, Folder

_SMOKE_STUDIES = 200


@dataclass(frozen=True)
class Options:
    """Simulates studies at the edge of each claim, and writes how often intervals and verdicts are right."""

    out: Folder = None
    """Folder for the files. Default: out/calibration, or out/smoke/calibration."""
    smoke: bool = False
    """A tiny version: few studies per row."""


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    options = tyro.cli(Options, prog="python -m paper_figs.calibration", args=args, config=FLAGS)
    undisturbed()
    from paper_figs.calibration import draw, simulate
    from paper_figs.plots import style

    out = options.out or Path("out/smoke/calibration" if options.smoke else "out/calibration")
    console, found = Console(stderr=True), []
    try:
        out.mkdir(parents=True, exist_ok=True)
        for row in simulate.rows(most=_SMOKE_STUDIES if options.smoke else None):
            found.append(row)
            console.print(_line(row), markup=False, highlight=False, soft_wrap=True)
        numbers = simulate.table(found)
        files = [
            style.save_table(numbers, out / "calibration.csv"),
            *style.save(draw.draw(numbers), out / "calibration"),
        ]
    except OSError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print("\n".join(map(str, files)))
    return 0


def _line(row: dict) -> str:
    """A row of the table, in percent."""
    rates = (row["coverage"], row["false_supported"], row["false_contradicted"])
    numbers = " ".join(f"{100 * rate:6.2f}" for rate in rates)
    return f"{row['rule']:20} {row['world']:38} {row['n_seeds']:5} {numbers}  {row['reason']}".rstrip()


if __name__ == "__main__":
    sys.exit(main())
