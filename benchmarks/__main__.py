"""Command line: `python -m benchmarks [NAME ...] [--json FILE] [--quick]`."""

from __future__ import annotations

import ast
import importlib
import json
import os
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import tyro

from benchmarks.measure import NotMeasured
from jrcjax.files import write_text
from sweeps.options import FLAGS, File

NAMES = ("throughput", "scaling", "limit", "canary", "start", "sum_tree", "paper", "vector", "accelerator")


def _claim_of(name: str) -> str:
    """The first sentence of a benchmark's file, without running it."""
    text = (Path(__file__).parent / f"{name}.py").read_text(encoding="utf-8")
    return " ".join(str(ast.get_docstring(ast.parse(text))).split()).split(". ")[0].rstrip(".")


def _names_in_words() -> str:
    return "\n".join(["Benchmarks to run. Default: throughput.", *(f"{name}: {_claim_of(name)}." for name in NAMES)])


@dataclass(frozen=True)
class Options:
    """Measures speed and memory on this machine, each benchmark against the claim at the top of its file."""

    names: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        tyro.conf.arg(metavar="[NAME ...]", help_behavior_hint="", help=_names_in_words()),
    ] = ()
    json: File = None
    """File for machine and results."""
    quick: bool = False
    """Shorter runs: two minutes for throughput."""


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status, 1 if a benchmark could not be measured."""
    options = tyro.cli(Options, prog="python -m benchmarks", args=args, config=FLAGS)
    from jrcjax.provenance import machine, versions

    unknown = [name for name in options.names if name not in NAMES]
    if unknown:
        print(f"error: names: {unknown[0]!r} is unknown; allowed: {', '.join(NAMES)}", file=sys.stderr)
        return 2
    if options.json is not None and not _is_writable(options.json):
        print(f"error: json: {str(options.json)!r}; allowed: a file in an existing folder", file=sys.stderr)
        return 2
    results, failed = [], 0
    for name in options.names or ("throughput",):
        module = importlib.import_module(f"benchmarks.{name}")
        print(f"\n== {name}: {_claim_of(name)}.", flush=True)
        try:
            results += module.run(options.quick)
        except NotMeasured as error:
            print(f"{name}: not measured: {error}", file=sys.stderr, flush=True)
            failed = 1
        if options.json is not None:  # after each, since the next may take long, or fail
            made = machine() | {"versions": versions()}
            content = {"machine": made, "results": [asdict(result) for result in results]}
            write_text(options.json, json.dumps(content, indent=2) + "\n")
    return failed


def _is_writable(file: Path) -> bool:
    return not file.is_dir() and file.parent.is_dir() and os.access(file if file.exists() else file.parent, os.W_OK)


if __name__ == "__main__":
    sys.exit(main())
