"""What a folder of figures says of itself: which figures one command wrote there, and of which run."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from jrcjax.checks import refuse
from jrcjax.files import write_text
from paper_figs.claims.delta import Delta
from sweeps.preset import label_of
from sweeps.sweep import Size

FILE = "made.json"


def record_of(size: Size, figures: Iterable[str], delta: Delta) -> dict[str, Any]:
    """What is told of figures, by their names, that show a run of this size."""
    run = {"preset": label_of(size.preset), "episodes": size.episodes, "seeds": size.seeds}
    return run | {"figures": list(figures), "delta": asdict(delta)}


def write(out: Path, record: dict[str, Any]) -> Path:
    """Writes a record into a folder of figures."""
    return write_text(out / FILE, json.dumps(record, indent=2) + "\n")


def remove(out: Path) -> None:
    """Removes the record of a folder that is about to change: an interrupted command may leave figures of two runs."""
    (out / FILE).unlink(missing_ok=True)


def seeds_in(out: Path, wanted: dict[str, Any]) -> int:
    """The seeds of the figures in a folder.

    Raises:
      ValueError: naming the field, if they are of another run than the one that is wanted, whatever its seeds.
    """
    found = json.loads((out / FILE).read_text(encoding="utf-8"))
    for field, value in wanted.items():
        if field != "seeds" and found[field] != value:
            refuse(f"{out / FILE}: {field}", str(found[field]), str(value))
    return found["seeds"]
