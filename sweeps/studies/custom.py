"""A sweep of one's own: a grid, a sample or a table of points, everything else as in a base."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import tyro

from jrcjax.checks import refuse, require_integer
from jrcjax.config.paths import Parameter, Points, parameter_at
from jrcjax.config.toml import from_toml
from jrcjax.learners import LEARNERS
from jrcjax.learners.hparams import Config
from jrcjax.model.presets import ENVIRONMENTS
from jrcjax.training.rollout import learner_for, spec_of
from jrcjax.types import choice
from sweeps import design
from sweeps.design import Design
from sweeps.preset import SOURCES, base_of, set_in
from sweeps.studies.source import ALWAYS_SHARED, is_the_sources, source_for
from sweeps.sweep import Sweep

CUSTOM = "custom"
"""What `run` calls it."""
_FOLDER = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
_MOST_POINTS = 100_000
_LANES = 256  # seeds times points in a part, as far as points allow

_Texts = Annotated[tuple[str, ...], tyro.conf.UseAppendAction]


@dataclass(frozen=True)
class Options:
    """Only for `run custom`: what varies, and around what."""

    vary: Annotated[_Texts, tyro.conf.arg(metavar="PATH=VALUES", help_behavior_hint="(repeatable)")] = ()
    """A parameter and its values: start:stop:count, start:stop:count:log, or a list with commas, such as
    env.speed.event_probability.high=0.1:0.9:9. Several give the grid. With --sample the range to draw from: low:high,
    low:high:log, or a list. The parameters are in jrcjax/config/CONFIGURATION.md."""
    sample: Annotated[int | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Draw so many points from the ranges, a scrambled Sobol' sequence, in place of the grid."""
    sample_seed: Annotated[int, tyro.conf.arg(name="seed", metavar="S")] = 0
    """Seed of the sample."""
    table: Annotated[Path | None, tyro.conf.arg(metavar="FILE", help_behavior_hint="")] = None
    """Take the points from a CSV file: a column per path, a row per point; an empty cell is as in the base."""
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="PATH=VALUE ...", help_behavior_hint="")] = ()
    """Other parameters that differ from the base, the same at all points."""
    source: Annotated[str, tyro.conf.arg(metavar="same|table1")] = SOURCES[0]
    """Hyperparameters and settings of the source agents: the same as at the point, or Table I's."""
    learners: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("ddqn",)
    """Any of round_robin, q_learning, ddqn, dpr, tlwd. The last two bring source agents, see --source."""
    base: Annotated[str, tyro.conf.arg(metavar="NAME|FILE")] = "target"
    """The environment around which to vary: source, target, or a TOML file."""
    folder: Annotated[str, tyro.conf.arg(name="name", metavar="NAME")] = CUSTOM
    """Name of the folder in OUT that the results go to."""


def custom_sweep(options: Options, preset: str, taken: tuple[str, ...] = ()) -> Sweep:
    """The sweep that options describe.

    Args:
      options: what to vary, and around what.
      preset: the table of parameters of source and target.
      taken: names of sweeps that the results' folder may not have.

    Raises:
      ValueError: naming the option or path, the value and what is allowed.
      OSError: if a file can't be read.
    """
    if not _FOLDER.fullmatch(options.folder) or options.folder in taken:
        refuse("name", options.folder, f"letters, digits, dots, dashes and underscores, and none of {', '.join(taken)}")
    if len(set(options.learners)) < len(options.learners) or not options.learners:
        refuse("learners", " ".join(options.learners), "one or more different learners")
    for name in options.learners:
        choice("learners", name, tuple(LEARNERS))
    environment = _environment(options.base)
    base = base_of(environment, preset).points
    points = _design(options, base)
    fixed = tuple(_fixed(options.set, base, points.parameters(base)))
    sweep = Sweep(
        name=options.folder,
        description=f"{', '.join(options.learners)} against {', '.join(column.path for column in points.columns)}",
        learners=options.learners,
        environment=environment,
        design=points,
        fixed=fixed,
        own=True,
        seeds_per_part=max(1, min(Sweep.seeds_per_part, _LANES // len(points))),
    )
    choice("source", options.source, SOURCES)
    return _with_source(sweep, base, preset, options.source)


def _environment(base: str) -> str:
    """A name, or the text of a file, which results keep."""
    if base in ENVIRONMENTS:
        return base
    if not base.endswith(".toml"):
        refuse("base", base, f"{', '.join(ENVIRONMENTS)}, or a file that ends in .toml")
    text = Path(base).read_text(encoding="utf-8")
    try:
        from_toml(text)
    except ValueError as error:
        raise ValueError(f"{base}: {error}") from error
    return text


def _design(options: Options, base: Points) -> Design:
    """The points: those of a table, a sample, or a grid."""
    if options.sample is None and options.sample_seed != Options.sample_seed:
        refuse("seed", options.sample_seed, "a seed beside --sample, for which alone it is; of runs it is --seeds")
    if options.table is not None:
        if options.vary or options.sample is not None:
            refuse("table", str(options.table), "a table alone, without --vary and --sample")
        return _table(options.table, base)
    wanted = "PATH=VALUES, e.g. env.speed.event_probability.high=0.1:0.9:9"
    texts: dict[str, str] = {}
    for assignment in options.vary or ("",):
        path, text = _split("vary", assignment, wanted)
        if path in texts:
            refuse("vary", path, "each path once")
        texts[path] = text
    parameters = {path: parameter_at(path, base) for path in texts}
    if options.sample is not None:
        require_integer("sample", options.sample, 2, _MOST_POINTS)
        require_integer("seed", options.sample_seed, 0)
        ranges = {path: (parameter, parameter.range_of(texts[path])) for path, parameter in parameters.items()}
        return _checked(design.sample(ranges, options.sample, options.sample_seed), base)
    values = {path: parameter.values_of(texts[path]) for path, parameter in parameters.items()}
    number = 1
    for of_path in values.values():
        number *= len(of_path)
    if number > _MOST_POINTS:
        refuse("vary", f"a grid of {number} points", f"at most {_MOST_POINTS} points")
    return _checked(design.grid(values), base)


def _checked(points: Design, base: Points) -> Design:
    points.parameters(base)
    return points


def _table(path: Path, base: Points) -> Design:
    with path.open(encoding="utf-8-sig", newline="") as file:
        rows = [row for row in csv.reader(file) if row]  # without blank lines; empty cells are a point like the base
    if len(rows) < 2 or any(len(row) != len(rows[0]) for row in rows):
        refuse("table", str(path), "a line of paths and a line of as many values for each point")
    if len(rows) - 1 > _MOST_POINTS:
        refuse("table", f"{len(rows) - 1} points", f"at most {_MOST_POINTS} points")
    names = [name.strip() for name in rows[0]]
    if len(set(names)) < len(names):
        refuse("table", ", ".join(names), "each column once")
    parameters = [parameter_at(name, base) for name in names]
    values = [
        {p.path: p.value_of(cell.strip()) for p, cell in zip(parameters, row, strict=True) if cell.strip()}
        for row in rows[1:]
    ]
    return _checked(design.table(values, {name: name for name in names}), base)


def _fixed(assignments: tuple[str, ...], base: Points, varied: dict[str, Parameter]) -> Iterator[tuple[str, float]]:
    taken = list(varied.values())
    for assignment in assignments:
        path, text = _split("set", assignment, "PATH=VALUE")
        parameter = parameter_at(path, base)
        if any(parameter.overlaps(other) for other in taken):
            refuse("set", path, "another parameter than those that vary or are set already")
        taken.append(parameter)
        yield path, parameter.value_of(text)


def _split(option: str, text: str, allowed: str) -> tuple[str, str]:
    path, equals, values = text.partition("=")
    if not (path and equals and values):
        refuse(option, text, allowed)
    return path, values


def _with_source(sweep: Sweep, base: Points, preset: str, setting: str) -> Sweep:
    """The sweep with what trains its source agents, if learners need them: in the paper's source environment."""
    needing = [name for name in sweep.learners if learner_for(name, base.params, Config()).needs_source]
    if not needing and setting != SOURCES[0]:
        refuse("source", setting, f"{SOURCES[0]} with learners that have no source agents, {', '.join(sweep.learners)}")
    if not needing:
        return sweep
    if spec_of(base_of("source", preset).points.params)[:2] != spec_of(base.params)[:2]:
        allowed = f"learners without transfer, for levels {base.params.shape} and {base.params.num_actions} actions"
        refuse("learners", " ".join(needing), allowed)
    own = set_in(preset)
    if setting == "table1" != own.get("source"):  # what such a preset sets would hold in the source all the same
        for path in filter(is_the_sources, sorted(own.keys() - ALWAYS_SHARED)):
            refuse("source", setting, f'{SOURCES[0]}, or "source" = "table1" beside "{path}" in the preset\'s [set]')
    of_table1 = "table1" in (setting, own.get("source"))
    source, points = source_for(sweep, of_table1)
    return replace(sweep, source=source, source_points=points)
