"""Runs parameter sweeps: all points and seeds of one as a single compiled program, results as netCDF files."""

from __future__ import annotations

import contextlib
import functools
import importlib
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import tyro

from jrcjax.checks import refuse, require_integer
from sweeps import interrupts
from sweeps.command import begin
from sweeps.options import FLAGS, Count, Preset
from sweeps.preset import preset_of
from sweeps.studies.custom import CUSTOM, Options, custom_sweep
from sweeps.sweep import Study, size_of

_UNDECIDED = "paper_figs.studies.multiverse:undecided"
_FINISHED = "paper_figs.studies.multiverse:finished"


@dataclass(frozen=True)
class List:
    """List the sweeps."""


@dataclass(frozen=True)
class Run:
    """Run one sweep or study; results go to OUT/NAME, with what a study concludes in OUT/NAME/summary."""

    name: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="NAME")]
    """A sweep's or study's name, as `list` shows it; custom for one of your own."""
    seeds: Count = None
    """Independent seeds. Default: 10 (multiverse and reconstruction 2), or 2 with --smoke."""
    episodes: Count = None
    """Episodes per seed. Default: 1000 (multiverse and reconstruction 450), or 20 with --smoke."""
    preset: Preset = "paper"
    """The paper's parameters: paper, paper_table, the name of a file in sweeps/presets, or a TOML file of what differs
    from them, such as one from jrcjax.config.nuscenes."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("out/results")
    """Folder for results."""
    resume: bool = False
    """Continue where an earlier run with the same configuration stopped."""
    smoke: bool = False
    """A tiny version of the sweep."""
    save_agents: bool = False
    """Save the trained agents beside the results, for jrcjax.load_agent."""
    scheduler: str | None = None
    """Address of a Dask scheduler whose workers compute, such as tcp://host:8786."""
    workers: int | None = None
    """Compute in so many processes on this machine, as a local Dask cluster."""
    wait: Annotated[int, tyro.conf.arg(metavar="SECONDS")] = 300
    """How long to wait for workers of a cluster that has none."""
    readings: Count = None
    """Of the multiverse and of the reconstruction, how many readings of the paper. Default: 512 and 304, or 2 and 4
    with --smoke."""
    first: int = 0
    """Of the multiverse, the first reading to run, a multiple of 64."""
    per_block: int = 64
    """Of the multiverse, so many readings of each block of 64, within which all have the same answers to what decides
    code: a random sample, always the same; with few, more seeds go to readings from everywhere in the space."""
    keep: bool = False
    """Of the multiverse, keep what the summary in OUT/multiverse/summary, which an earlier run wrote, says of other
    readings, and of the same ones with other numbers of seeds; what it has of these with so many seeds is not run
    again."""
    undecided: Annotated[str | None, tyro.conf.arg(metavar="CLAIM")] = None
    """Of the multiverse, with --keep: only readings that the summary has no verdict of this claim for, such as
    "C5 (highest)", and fewer seeds than --seeds, at the points of the claim's figure alone."""
    confirm: Count = None
    """Of the reconstruction, how many fresh seeds confirm what it found. Default: 100, or 1 with --smoke."""
    custom: tyro.conf.OmitArgPrefixes[Options] = field(default_factory=Options)


@dataclass(frozen=True)
class Verify:
    """Compute parts of results anew and compare them bit for bit; exit status 1 if anything differs."""

    folder: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="DIR")]
    """Folder of one sweep's parts, such as out/results/fig6."""
    parts: Count = None
    """How many parts, evenly spread. Default: all."""


Command = (
    Annotated[List, tyro.conf.subcommand("list")]
    | Annotated[Run, tyro.conf.subcommand("run")]
    | Annotated[Verify, tyro.conf.subcommand("verify")]
)


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    command = tyro.cli(Command, prog="python -m sweeps", args=args, description=__doc__, config=FLAGS)
    try:
        return _run(command)
    except KeyboardInterrupt:
        flags = ("--resume",) if isinstance(command, Run) else ()
        print(interrupts.how_to_go_on(*flags), file=sys.stderr)
        return interrupts.STATUS
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def _run(command: Command) -> int:
    """Does what the command says; returns the exit status."""
    from sweeps.studies.registry import STUDIES  # after parsing, so that --help and errors come at once

    if isinstance(command, List):
        for study in STUDIES.values():
            print(f"{study.name:12s} {study.description}")
        print(f"{CUSTOM:12s} one of your own: run custom --vary PATH=VALUES")
        return 0
    console = begin()
    from jrcjax.types import choice
    from sweeps.engine.run import run_sweep
    from sweeps.studies.reconstruction import effort_of

    if isinstance(command, Verify):
        return _verify(command)
    choice("name", command.name, (*STUDIES, CUSTOM))
    preset = preset_of(command.preset)
    study = _study(command, preset)
    size = size_of(command.seeds, command.episodes, preset, command.smoke, study)
    size.check()
    sweeps = study.smoke_sweeps if command.smoke and study.smoke_sweeps else study.sweeps
    require_integer("wait", command.wait, 0)
    if command.wait != Run.wait and not _has_cluster(command):
        refuse("wait", command.wait, "a number of seconds beside --scheduler or --workers, for which alone it is")
    options = {"resume": command.resume, "save_agents": command.save_agents, "patience": command.wait}
    with interrupts.terminable(), _client(command) as client:
        run = functools.partial(run_sweep, size=size, out=command.out, console=console, **options, client=client)
        if study.search:
            effort = effort_of(command.readings, command.confirm, command.smoke)
            written = _found(study.search)(effort, size, command.out, run)
        else:
            written = [run(sweep) for sweep in sweeps]
        if study.summary:
            also = {"keep": True} if command.keep else {}
            written += _found(study.summary)(sweeps, size, command.out, **also)
    print("\n".join(map(str, written)))
    return 0


def _found(name: str) -> Callable[..., Any]:
    """The function that is named as module:function, of a package that imports this one."""
    module, function = name.split(":")
    return getattr(importlib.import_module(module), function)


def _study(command: Run, preset: str) -> Study:
    """The study of a name; options that are only for another one are refused."""
    from sweeps.studies import multiverse, reconstruction
    from sweeps.studies.registry import EVERY_SWEEP, STUDIES

    of_readings = (multiverse.MULTIVERSE.name, reconstruction.NAME)
    limited = {"readings": of_readings, "confirm": of_readings[1:]} | dict.fromkeys(
        ("first", "per_block", "keep", "undecided"), of_readings[:1]
    )
    for option, names in limited.items():
        if getattr(command, option) != getattr(Run, option) and command.name not in names:
            refuse("name", command.name, f"{' or '.join(names)}, for which alone --{option.replace('_', '-')} is")
    if command.name == CUSTOM:
        sweep = custom_sweep(command.custom, preset, (*STUDIES, *EVERY_SWEEP))
        return Study(CUSTOM, sweep.description, (sweep,), summary="paper_figs.studies.custom:summarise")
    given = [name for name, value in vars(command.custom).items() if value != getattr(Options(), name)]
    if given:
        refuse("name", command.name, f"{CUSTOM}, for which alone --{given[0].replace('_', '-')} is")
    if command.name == multiverse.MULTIVERSE.name:
        return _multiverse(command)
    return STUDIES[command.name]


def _multiverse(command: Run) -> Study:
    """The readings asked for: all, or with --keep those that the summary does not have, or is undecided about.

    Without --keep a summary that is there is replaced, so it may not tell of more than this run does.
    """
    from sweeps.studies import multiverse

    which, selection = (command.readings, command.smoke, command.first), multiverse.Selection(command.per_block)
    size = size_of(command.seeds, command.episodes, "paper", command.smoke, multiverse.MULTIVERSE)
    if not command.keep:
        if command.undecided is not None:
            refuse("keep", False, "True beside --undecided, which adds seeds to what a summary says of other readings")
        study = multiverse.study_of(*which, selection)
        multiverse.require_nothing_lost(command.out, study.sweeps, size)
        return study
    if command.undecided is None:
        multiverse.require_summary(command.out, size)
        finished = _found(_FINISHED)(command.out, size.seeds)
        return multiverse.study_of(*which, selection._replace(without=finished))
    asked, figure = _found(_UNDECIDED)(command.out, command.undecided, size.seeds)
    multiverse.require_summary(command.out, size)
    study = multiverse.study_of(*which, selection._replace(asked=asked, figure=figure))
    if not study.sweeps:
        allowed = f"a claim with undecided readings of fewer than {size.seeds} seeds among these"
        refuse("undecided", command.undecided, allowed)
    return study


def _has_cluster(command: Run) -> bool:
    """Whether a cluster's workers compute."""
    return command.scheduler is not None or command.workers is not None


def _client(command: Run) -> contextlib.AbstractContextManager:
    """The client of the cluster that the command asks for, None if it asks for none."""
    if not _has_cluster(command):
        return contextlib.nullcontext()
    from sweeps.engine.distributed import client_of

    return client_of(command.scheduler, command.workers)


def _verify(command: Verify) -> int:
    """Prints what differs; returns the exit status."""
    from sweeps.engine import verify
    from sweeps.studies.registry import EVERY_SWEEP

    differ = 0
    for part, differences in verify.verify(command.folder, command.parts, EVERY_SWEEP):
        differ += bool(differences)
        print(f"{part.path}: {'differs' if differences else 'the same, bit for bit'}", flush=True)
        for line in differences and [*differences, *verify.made_elsewhere(part)]:
            print(f"  {line}", flush=True)
    return min(differ, 1)


if __name__ == "__main__":
    sys.exit(main())
