"""What a study's environments are made from: a table of the paper's parameters, or a file of what differs from it.

A file is what `jrcjax.load_params` reads, such as `python -m jrcjax.config.nuscenes` writes. Its numbers replace the
paper's in the target environment and in the source environment alike, but for the traffic density: the file gives the
target's, and the source has twice as much, as in Table I. A figure's own parameter replaces the file's.

A preset is a string: one of `PRESETS`, or the text of a file, so that workers and whoever verifies results have all
that it says.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import Any

from jrcjax.checks import is_positive, refuse, require
from jrcjax.config.toml import description_of, params_of, text_of
from jrcjax.model.params import EnvParams
from jrcjax.model.presets import ENVIRONMENTS, PRESETS, paper_params
from jrcjax.radar.paper import MAX_DENSITY

_ALLOWED = f"{', '.join(PRESETS)}, or a file that ends in .toml"
_SOURCE_DENSITY = 2.0
"""Over that of the target, Table I."""


def preset_of(option: str) -> str:
    """The preset that a command's option names.

    Args:
      option: one of `PRESETS`, or the path of a file.

    Raises:
      ValueError: naming the file, the field, the value and what is allowed.
      OSError: if the file can't be read.
    """
    if option in PRESETS:
        return option
    if not option.endswith(".toml"):
        refuse("preset", option, _ALLOWED)
    try:
        description = description_of(Path(option).read_text(encoding="utf-8"))
        if (environment := description.pop("environment", "target")) != "target":
            refuse("environment", environment, "'target', from which the source follows")
        preset = text_of(description)
        check_preset(preset)
    except ValueError as error:
        raise ValueError(f"preset: {option}: {error}") from error
    return preset


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


def environment_of(name: str, preset: str) -> EnvParams:
    """The source or target environment of a preset."""
    return paper_params(name, preset) if preset in PRESETS else _of_file(name, preset)


@lru_cache
def _of_file(name: str, text: str) -> EnvParams:
    description: dict[str, Any] = {"environment": name} | description_of(text)
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
