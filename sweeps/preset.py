"""What a study's environments are made from: a table of the paper's parameters, or a file of what differs from it.

A file is what `jrcjax.load_params` reads, such as `python -m jrcjax.config.nuscenes` writes. Its numbers replace the
paper's in the target environment and in the source environment alike, but for the traffic density: the file gives the
target's, and the source has twice as much, as in Table I. A figure's own parameter replaces the file's.

A file's table [set] sets single numbers by their dotted path (`jrcjax.config.paths`), those of the hyperparameters and
of the settings among them, in the source and in the target alike:

    [set]
    "hparams.learning_rate" = 3e-5
    "config.optimiser" = "rmsprop"
    "source" = "table1"

With the last line the source agents have Table I's hyperparameters and settings instead.

A file in the folder `presets` beside this module is named without its suffix: `best` is the reading in which most of
the paper's text holds, of all that the published search tried.

A preset is a string: one of `PRESETS`, or the text of a file, so that workers and whoever verifies results have all
that it says.
"""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from jrcjax.checks import is_positive, refuse, require
from jrcjax.config.paths import Points, parameter_at
from jrcjax.config.stacking import Values, settings, stacked
from jrcjax.config.toml import description_of, from_toml, params_of, text_of
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model.params import EnvParams
from jrcjax.model.presets import ENVIRONMENTS, PRESETS, paper_params
from jrcjax.radar.paper import MAX_DENSITY

NAMED = {path.stem: path for path in sorted((Path(__file__).parent / "presets").glob("*.toml"))}
"""Files that a name stands for."""
_ALLOWED = f"{', '.join((*PRESETS, *NAMED))}, or a file that ends in .toml"
_SOURCE_DENSITY = 2.0
"""Over that of the target, Table I."""
_SET = "set"
"""Table of a file with numbers by their path."""
SOURCES = ("same", "table1")
"""What source agents are trained with: the target's hyperparameters and settings, or Table I's."""


def preset_of(option: str) -> str:
    """The preset that a command's option names.

    Args:
      option: one of `PRESETS` or `NAMED`, or the path of a file.

    Raises:
      ValueError: naming the file, the field, the value and what is allowed.
      OSError: if the file can't be read.
    """
    if option in PRESETS:
        return option
    path = NAMED.get(option) or Path(option)
    if path.suffix != ".toml":
        refuse("preset", option, _ALLOWED)
    try:
        description = description_of(path.read_text(encoding="utf-8-sig"), also=(_SET,))
        if (environment := description.pop("environment", "target")) != "target":
            refuse("environment", environment, "'target', from which the source follows")
        preset = preset_text(description, description.pop(_SET, {}))
        check_preset(preset)
    except ValueError as error:
        raise ValueError(f"preset: {option}: {error}") from error
    return preset


def preset_text(description: dict[str, Any], own: dict[str, Any]) -> str:
    """The text of a file: what differs from the paper's environments, and numbers by their path."""
    if not isinstance(own, dict) or not all(isinstance(value, str | int | float) for value in own.values()):
        refuse(_SET, str(own), 'a table of numbers and names by path, such as "hparams.learning_rate" = 3e-5')
    lines = [f"{json.dumps(path)} = {json.dumps(value)}" for path, value in own.items()]
    return text_of(description) + "\n".join(["", f"[{_SET}]", *lines, ""] * bool(own))


def check_preset(preset: str) -> None:
    """Raises ValueError naming the field, the value and what is allowed."""
    if not isinstance(preset, str) or (preset not in PRESETS and "\n" not in preset):
        refuse("preset", str(preset), _ALLOWED)
    if preset in PRESETS:
        return
    for name in ENVIRONMENTS:
        params, paper = environment_of(name, preset), paper_params(name)
        if (params.shape, params.num_actions) != (paper.shape, paper.num_actions):
            found = f"levels {params.shape} and {params.num_actions} actions"
            refuse("preset", found, f"the paper's, {paper.shape} and {paper.num_actions}, that the figures are about")


class Base(NamedTuple):
    """What a sweep's points differ from."""

    points: Points
    """One environment with hyperparameters, without a leading axis."""
    config: Config
    """Static settings, but for those that the size of a run decides."""


@lru_cache
def base_of(environment: str, preset: str) -> Base:
    """What points in an environment differ from.

    Args:
      environment: "source" or "target" of the preset, or the text of a file that `jrcjax.load_params` reads.
      preset: see `preset_of`.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    if environment in ENVIRONMENTS:
        params = paper_params(environment, preset) if preset in PRESETS else _of_file(environment, preset)
    else:
        params = from_toml(environment)
    base, own = Base(Points(params, HParams()), Config()), set_in(preset)
    setting = own.pop("source", SOURCES[0])
    if setting not in SOURCES:
        refuse("source", str(setting), ", ".join(SOURCES))
    if environment == "source" and setting == "table1":
        # n is shared in any case, since demonstrations come with their returns.
        own = {path: value for path, value in own.items() if path.startswith("env.") or path == "config.n_step"}
    return with_set(base, own)


def set_in(preset: str) -> dict[str, Any]:
    """The numbers and names that a preset sets by their path."""
    return {} if preset in PRESETS else dict(description_of(preset, also=(_SET,)).get(_SET, {}))


def with_set(base: Base, own: dict[str, Any]) -> Base:
    """A base with single numbers set by their path, each a number or the name of a reading."""
    if not own:
        return base
    columns = []
    for path, value in own.items():
        parameter = parameter_at(path, base.points)
        if any(parameter.overlaps(column.parameter) for column in columns):
            refuse(_SET, path, "numbers that do not overlap")
        columns.append(Values(parameter, np.array([parameter.value_of(str(value))])))
    points = jax.tree.map(lambda leaf: leaf[0], stacked(base.points, columns, 1))
    return Base(points, settings(base.config, columns, 1)[0])


def environment_of(name: str, preset: str) -> EnvParams:
    """The source or target environment of a preset."""
    return base_of(name, preset).points.params


@lru_cache
def _of_file(name: str, text: str) -> EnvParams:
    description: dict[str, Any] = {"environment": name} | description_of(text, also=(_SET,))
    description.pop(_SET, None)
    if "radar" in description:
        description["radar"] = _radar(name, dict(description["radar"]))
    return params_of(description)


def _radar(name: str, table: dict[str, Any]) -> dict[str, Any]:
    """The description of a radar, with the density of the environment of that name."""
    table.pop("max_objects", None)  # as many as the densities of a study need
    table["max_density"] = MAX_DENSITY
    if "density" in table:
        require("radar.density", table["density"], (), is_positive, "a number of objects > 0 per 45 m x 45 m")
        densest = table["density"] * _SOURCE_DENSITY
        table["max_density"] = max(MAX_DENSITY, densest)
        if name == "source":
            table["density"] = densest
    return table


def slots_of(preset: str) -> int:
    """Slots of an episode, in the source as in the target."""
    return environment_of("target", preset).max_steps_in_episode


def label_of(preset: str) -> str:
    """A short name of a preset, for folders and titles."""
    return preset if preset in PRESETS else f"file-{hashlib.sha256(preset.encode()).hexdigest()[:8]}"
