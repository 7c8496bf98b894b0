"""Command line: `python -m sweeps list` and `python -m sweeps run NAME`."""

from __future__ import annotations

import contextlib
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from sweeps import interrupts
from sweeps.sweep import size_of


@dataclass(frozen=True)
class List:
    """List the sweeps."""


@dataclass(frozen=True)
class Run:
    """Run one sweep; results go to OUT/NAME."""

    name: tyro.conf.Positional[str]
    """A sweep's name, as `list` shows it."""
    seeds: int | None = None
    """Independent seeds. Default: 10, or 2 with --smoke."""
    episodes: int | None = None
    """Episodes per seed. Default: 1000, or 20 with --smoke."""
    preset: str = "paper"
    """Table of parameters: paper or paper_table."""
    out: Path = Path("out/results")
    """Folder for results."""
    resume: bool = False
    """Continue where an earlier run with the same configuration stopped."""
    smoke: bool = False
    """A tiny version of the sweep."""
    scheduler: str | None = None
    """Address of a Dask scheduler whose workers compute, such as tcp://host:8786."""
    workers: int | None = None
    """Compute in so many processes on this machine, as a local Dask cluster."""


@dataclass(frozen=True)
class Verify:
    """Compute parts of results anew and compare them bit for bit; exit status 1 if anything differs."""

    folder: tyro.conf.Positional[Path]
    """Folder of one sweep's parts, such as out/results/fig6."""
    parts: int | None = None
    """How many parts, evenly spread. Default: all."""


Command = (
    Annotated[List, tyro.conf.subcommand("list")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Verify, tyro.conf.subcommand("verify")]
)


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    command = tyro.cli(Command, prog="python -m sweeps", args=args)
    from jrcjax import parallel  # after parsing, so that --help and errors come at once
    from jrcjax.types import choice

    parallel.use_all_cores()
    parallel.keep_compiled()
    from sweeps.registry import SWEEPS
    from sweeps.run import run_sweep

    console = Console(stderr=True)
    if isinstance(command, List):
        for sweep in SWEEPS.values():
            print(f"{sweep.name:12s} {sweep.description}")
        return 0
    try:
        if isinstance(command, Verify):
            return _verify(command)
        choice("name", command.name, tuple(SWEEPS))
        size = size_of(command.seeds, command.episodes, command.preset, command.smoke)
        size.check()
        with interrupts.terminable(), _client(command) as client:
            folder = run_sweep(SWEEPS[command.name], size, command.out, console, resume=command.resume, client=client)
    except KeyboardInterrupt:
        print(interrupts.how_to_go_on("--resume"), file=sys.stderr)
        return interrupts.STATUS
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(folder)
    return 0


def _client(command: Run) -> contextlib.AbstractContextManager:
    """The client of the cluster that the command asks for, None if it asks for none."""
    if command.scheduler is None and command.workers is None:
        return contextlib.nullcontext()
    from sweeps.distributed import client_of

    return client_of(command.scheduler, command.workers)


def _verify(command: Verify) -> int:
    """Prints what differs; returns the exit status."""
    from sweeps import verify
    from sweeps.registry import SWEEPS
    from sweeps.sources import SOURCE

    differ = 0
    for part, differences in verify.verify(command.folder, command.parts, SWEEPS | {SOURCE.name: SOURCE}):
        differ += bool(differences)
        print(f"{part.path}: {'differs' if differences else 'the same, bit for bit'}")
        for line in differences and [*differences, *verify.made_elsewhere(part)]:
            print(f"  {line}")
    return min(differ, 1)


if __name__ == "__main__":
    sys.exit(main())
