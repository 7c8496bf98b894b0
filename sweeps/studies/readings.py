"""The space of readings: all that the paper leaves open, with the range in which each is searched.

Reading 0 is the default. Reading i > 0 is point i of a scrambled Sobol' sequence through the ranges, the same whatever
the number of readings. What decides code, and so needs a program of its own, changes from one block of readings to the
next and is the same within a block: a split-plot design.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from jrcjax.config.paths import Points, Range, number_at, parameter_at
from jrcjax.learners.hparams import OPTIMISERS
from jrcjax.model.params import EnvParams
from sweeps.design import in_range, sobol
from sweeps.preset import SOURCES, base_of

SEED = 0
"""Of the sequences."""
PER_BLOCK = 64
"""Readings in a block: a power of two, so that a block's points fill the ranges evenly."""
SOURCE = "source"
"""Name of the reading that says what source agents are trained with."""
_SLOTS = EnvParams.max_steps_in_episode
_SGD_STEP = 1e-2  # its steps over those of the others, whose gradients are normalised


class Reading(NamedTuple):
    """One question that the paper leaves open."""

    path: str
    """What answers it, see `jrcjax.config.paths`."""
    label: str
    """In figures and tables."""
    where: Range | None = None
    """The range; all of its readings, by their index, if None."""
    learners: tuple[str, ...] = ()
    """Who reads it; everybody if empty."""
    metrics: tuple[str, ...] = ()
    """What it changes the count of; if empty, it changes what happens, and so everything."""


def _levels(*values: float) -> Range:
    return Range(0.0, 0.0, levels=values)


_DEEP = ("ddqn", "dpr", "tlwd")
_TRANSFER = ("dpr", "tlwd")
_TLWD = ("tlwd",)
_TABLE = ("q_learning",)
_EXPLORING = (*_TABLE, *_DEEP)


READINGS: tuple[Reading, ...] = (
    Reading("hparams.learning_rate", "step size (SGD: a hundredth)", Range(1e-6, 1e-2, is_log=True), _DEEP),
    Reading("config.optimiser", "optimiser", learners=_DEEP),
    Reading(
        "hparams.epsilon_slots", "slots of exploration", Range(20.0 * _SLOTS, 600.0 * _SLOTS, is_log=True), _EXPLORING
    ),
    Reading("hparams.exploration", "fall of epsilon", learners=_EXPLORING),
    Reading("hparams.initialiser", "initialiser", learners=_DEEP),
    Reading("hparams.loss", "loss", learners=_DEEP),
    Reading("config.gradient_clipping", "clipping of gradients", learners=_DEEP),
    Reading("config.target_update", "target network", learners=_DEEP),
    Reading("env.event_model", "events"),
    Reading("env.reward_state", "state of the reward"),
    Reading("env.speed.event_probability.low", "p_0^v", _levels(0.005, 0.05)),
    Reading("env.count_event_packets", "packets with an event count", _levels(1.0, 0.0), metrics=("throughput",)),
    Reading("env.miss_convention", "miss detection on data", metrics=("miss_detection",)),
    Reading("env.radar.distance", "distance of objects"),
    Reading("env.radar.counting_rule", "counting rule"),
    Reading("env.radar.count_model", "number of objects"),
    Reading("env.all.persistence", "persistence of factors", Range(0.0, 0.95)),
    Reading("env.terminal_time_limit", "time limit is terminal", _levels(0.0, 1.0), _EXPLORING),
    Reading("hparams.step_exponent", "Q-learning's exponent", Range(0.51, 1.0), _TABLE),
    Reading("hparams.step_constant", "Q-learning's constant step", _levels(0.0, 0.01, 0.1), _TABLE),
    Reading("hparams.initial_weights", "TLwD's initial weights", learners=_TLWD),
    Reading(SOURCE, "source's hyperparameters", learners=_TRANSFER),
    Reading("config.n_step", "n of returns", _levels(10.0, 1.0, 5.0, 20.0), _TLWD),
    Reading("hparams.margin", "margin", Range(0.1, 100.0, is_log=True), _TLWD),
    Reading("hparams.margin_weight", "weight of the margin", Range(0.1, 100.0, is_log=True), _TLWD),
    Reading("hparams.demonstration_constant", "demonstrations' priority", Range(0.0, 10.0), _TLWD),
    Reading("hparams.demonstration_rewards", "demonstrations' rewards", learners=_TLWD),
    Reading("hparams.importance_start", "first beta", Range(0.0, 1.0), _TLWD),
    Reading("hparams.importance_over", "updates that beta rises over", learners=_TLWD),
)
"""All questions, and where their answers are searched."""


@functools.cache
def _parameters() -> dict:
    base: Points = base_of("target", "paper").points
    return {reading.path: parameter_at(reading.path, base) for reading in READINGS if reading.path != SOURCE}


def choices(reading: Reading) -> tuple[str, ...]:
    """Names of a reading's values, if they are indices."""
    return SOURCES if reading.path == SOURCE else _parameters()[reading.path].readings


def as_text(path: str, value: float) -> str | float:
    """A reading's value as people and presets write it: the name of an index, or the number."""
    if path == SOURCE:
        return SOURCES[int(value)]
    parameter = _parameters()[path]
    return parameter.readings[int(value)] if parameter.readings else value


def range_of(reading: Reading) -> Range:
    """Where a reading is searched."""
    return reading.where or _levels(*(float(i) for i in range(len(choices(reading)))))


def default_unit() -> np.ndarray:
    """The place of the default reading in the unit cube; of several levels it is the first."""
    base, places = base_of("target", "paper").points, []
    for reading in READINGS:
        where = range_of(reading)
        if where.levels:
            places.append(0.5 / len(where.levels))
            continue
        ends = np.array([where.low, where.high, number_at(_parameters()[reading.path], base)])
        low, high, value = np.log(ends) if where.is_log else ends
        places.append((value - low) / (high - low))
    return np.array(places)


def is_static(reading: Reading) -> bool:
    """Whether a reading decides code."""
    return reading.path.startswith("config.")


def unit_of(number: int, first: int = 0) -> np.ndarray:
    """Readings `first` to `first + number` in the unit cube, [number, readings]; reading 0 has NaN."""
    static = np.array([is_static(reading) for reading in READINGS])
    blocks = np.arange(first, first + number) // PER_BLOCK
    cube = np.empty((number, len(READINGS)))
    cube[:, ~static] = sobol(int((~static).sum()), number, SEED, skip=first)
    cube[:, static] = sobol(int(static.sum()), int(blocks[-1]) + 1, SEED + 1)[blocks]
    if first == 0:
        cube[0] = np.nan
    return cube


def values_at(unit: np.ndarray) -> dict[str, float]:
    """A reading's values by path from its place in the unit cube; none, so all as by default, for NaN."""
    if np.isnan(unit).any():
        return {}
    found = {}
    for reading, u in zip(READINGS, unit, strict=True):
        parameter = _parameters().get(reading.path)
        found[reading.path] = float(
            in_range(np.array([u]), parameter is not None and parameter.is_whole, range_of(reading))[0]
        )
    if OPTIMISERS[int(found["config.optimiser"])] == "sgd":
        found["hparams.learning_rate"] = float(f"{_SGD_STEP * found['hparams.learning_rate']:.6g}")
    return found
