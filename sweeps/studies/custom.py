"""A sweep of one's own: one parameter, addressed by its path, over any values, everything else as in a base."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import tyro

from jrcjax.checks import refuse
from jrcjax.config.paths import Parameter, parameter_at
from jrcjax.learners import LEARNERS
from jrcjax.learners.hparams import Config, HParams, check_hparams
from jrcjax.model.params import EnvParams, check_params
from jrcjax.model.presets import ENVIRONMENTS
from jrcjax.training.rollout import learner_for, spec_of
from jrcjax.types import choice
from sweeps.engine.program import Points
from sweeps.engine.sources import SOURCE
from sweeps.preset import environment_of
from sweeps.sweep import Sweep

CUSTOM = "custom"
"""What `run` calls it."""
_FOLDER = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class Options:
    """Only for `run custom`: what varies, and around what."""

    vary: Annotated[str, tyro.conf.arg(metavar="PATH=VALUES", help_behavior_hint="")] = ""
    """The parameter on the x axis and its values: start:stop:count, start:stop:count:log, or a list with commas.
    Such as env.speed.event_probability.high=0.1:0.9:9; the parameters are in jrcjax/config/CONFIGURATION.md."""
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="PATH=VALUE ...", help_behavior_hint="")] = ()
    """Other parameters that differ from the base, the same at all points."""
    learners: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME ...")] = ("ddqn",)
    """Any of round_robin, q_learning, ddqn, dpr, tlwd. The last two bring source agents, trained as in the paper."""
    base: Annotated[str, tyro.conf.arg(metavar="NAME|FILE")] = "target"
    """The environment around which to vary: source, target, or a TOML file."""
    folder: Annotated[str, tyro.conf.arg(name="name", metavar="NAME")] = CUSTOM
    """Name of the folder in OUT that the results go to."""


class Custom(NamedTuple):
    """A sweep of one's own and what its figure needs to know."""

    sweep: Sweep
    parameter: Parameter
    slots: int
    """Slots per episode."""


def custom_sweep(options: Options, preset: str, taken: tuple[str, ...] = ()) -> Custom:
    """The sweep that options describe.

    Args:
      options: what to vary, and around what.
      preset: the table of parameters of source and target.
      taken: names of sweeps that the results' folder may not have.

    Raises:
      ValueError: naming the option or path, the value and what is allowed.
    """
    if not _FOLDER.fullmatch(options.folder) or options.folder in taken:
        refuse("name", options.folder, f"letters, digits, dots, dashes and underscores, and none of {', '.join(taken)}")
    if len(set(options.learners)) < len(options.learners) or not options.learners:
        refuse("learners", " ".join(options.learners), "one or more different learners")
    for name in options.learners:
        choice("learners", name, tuple(LEARNERS))
    base = Points(_base(options.base, preset), HParams())
    for assignment in options.set:
        path, text = _split("set", assignment, "PATH=VALUE")
        parameter = parameter_at(path, base)
        base = parameter.set_in(base, parameter.value_of(text))
    path, text = _split("vary", options.vary, "PATH=VALUES, e.g. env.speed.event_probability.high=0.1:0.9:9")
    parameter = parameter_at(path, base)
    if path in [assignment.split("=")[0] for assignment in options.set]:
        refuse("set", path, "another parameter than the one that varies")
    values = parameter.values_of(text)
    points = dict(zip(values, _with_room([parameter.set_in(base, value) for value in values]), strict=True))
    for point in points.values():
        check_params(point.params)
        check_hparams(point.hparams)
    sweep = Sweep(
        name=options.folder,
        description=f"{', '.join(options.learners)} against {path}",
        learners=options.learners,
        x_name=path,
        x_values=values,
        params_at=lambda x, preset: points[x].params,
        hparams_at=lambda x: points[x].hparams,
        source=_source(options.learners, base.params, preset),
        recipe=replace(options, vary=f"{path}={','.join(map(parameter.text_of, values))}"),
    )
    return Custom(sweep, parameter, base.params.max_steps_in_episode)


def _split(option: str, text: str, allowed: str) -> tuple[str, str]:
    path, equals, values = text.partition("=")
    if not (path and equals and values):
        refuse(option, text, allowed)
    return path, values


def _base(base: str, preset: str) -> EnvParams:
    if base in ENVIRONMENTS:
        return environment_of(base, preset)
    if not base.endswith(".toml"):
        refuse("base", base, f"{', '.join(ENVIRONMENTS)}, or a file that ends in .toml")
    from jrcjax import load_params

    return load_params(Path(base))


def _source(learners: tuple[str, ...], params: EnvParams, preset: str) -> Sweep | None:
    """What trains the source agents, if learners need them: in the paper's source environment."""
    needing = [name for name in learners if learner_for(name, params, Config()).needs_source]
    source = spec_of(environment_of("source", preset))
    if needing and source[:2] != spec_of(params)[:2]:
        allowed = f"learners without transfer, for levels {params.shape} and {params.num_actions} actions"
        refuse("learners", " ".join(needing), allowed)
    return SOURCE if needing else None


def _with_room(points: list[Points]) -> list[Points]:
    """The points with as much room for objects as the densest needs, so that one program serves all."""
    room = tuple(int(most) for most in np.max([point.params.radar.max_objects for point in points], axis=0))
    roomy = [replace(point.params, radar=replace(point.params.radar, max_objects=room)) for point in points]
    return [point._replace(params=params) for point, params in zip(points, roomy, strict=True)]
