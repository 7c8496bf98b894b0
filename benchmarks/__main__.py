"""Command line: `python -m benchmarks [NAME ...] [--json FILE] [--quick]`."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

NAMES = ("throughput", "sum_tree")


@dataclass(frozen=True)
class Options:
    """Measures speed and memory on this machine."""

    names: Annotated[tuple[str, ...], tyro.conf.Positional] = ()
    """Benchmarks to run: throughput, sum_tree. Default: all."""
    json: Path | None = None
    """File for machine and results."""
    quick: bool = False
    """Shorter runs, two minutes in all."""


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    options = tyro.cli(Options, prog="python -m benchmarks", args=args)
    from benchmarks import sum_tree, throughput
    from jrcjax.provenance import machine, versions

    unknown = [name for name in options.names if name not in NAMES]
    if unknown:
        print(f"error: names: {unknown[0]!r} is unknown; allowed: {', '.join(NAMES)}", file=sys.stderr)
        return 2
    if options.json is not None and not options.json.parent.is_dir():
        print(f"error: json: {str(options.json)!r}; allowed: a file in an existing folder", file=sys.stderr)
        return 2
    chosen = options.names or NAMES
    results = throughput.run(options.quick) if "throughput" in chosen else []
    results += sum_tree.run(options.quick) if "sum_tree" in chosen else []
    if options.json is not None:
        content = {"machine": machine() | {"versions": versions()}, "results": results}
        options.json.write_text(json.dumps(content, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
