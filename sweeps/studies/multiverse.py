"""The claims under other readings of the paper: universes, each a choice for every decision that it leaves open.

All combinations are 2592. An orthogonal array of strength two takes 72 of them, in which every level of a reading
occurs equally often, and every pair of levels of any two readings equally often. The effects of single readings can
thus be told from each other, though not from interactions of others.
"""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax.learners.hparams import HParams
from jrcjax.model.params import EnvParams
from jrcjax.readings import EventModel, MissConvention
from jrcjax.training.transfer import TARGET_LEARNERS
from jrcjax.types import INITIAL_WEIGHTS, choice
from sweeps.preset import environment_of
from sweeps.studies import fig6, fig7, fig8, fig9
from sweeps.sweep import Size, Study, Sweep

SIZE = Size(seeds=4, episodes=500)
"""The claims speak of episodes up to 400."""
SMOKE = Size(seeds=2, episodes=20, pretraining=50, demonstrations=400)


class Optimiser(NamedTuple):
    """A level of the reading `optimiser`."""

    name: str
    learning_rate: float


class Universe(NamedTuple):
    """One choice for every reading; the default everywhere is the first level."""

    event_model: str
    low_speed_event_probability: float
    miss_convention: str
    resolution: tuple[str, str]
    """Distance between objects, and counting rule."""
    time_limit: str
    epsilon_episodes: int
    optimiser: Optimiser
    initial_weights: str
    """Of TLwD."""


LEVELS: dict[str, tuple[Any, ...]] = {
    "event_model": EventModel.names(),
    "low_speed_event_probability": (0.005, 0.05),
    "miss_convention": MissConvention.names(),
    "resolution": (("footprint_gap", "resolved"), ("centre_to_centre", "resolved"), ("footprint_gap", "clusters")),
    "time_limit": ("truncation", "terminal"),
    "epsilon_episodes": (100, 50, 400),
    # Plain gradient descent diverges from 1e-4 on: values are near 500, and so are its first errors.
    "optimiser": (Optimiser("adam", 1e-3), Optimiser("adam", 1e-4), Optimiser("rmsprop", 1e-3), Optimiser("sgd", 1e-5)),
    "initial_weights": INITIAL_WEIGHTS,
}
"""The levels of each reading."""


def orthogonal_array() -> np.ndarray:
    """Numbers of levels [72, 8] in the order of `Universe`; the first row is the default.

    The product of two arrays: 9 rows with four columns of three levels (Latin squares modulo 3), and 8 rows with one
    column of four levels and three of two (sums modulo 2).
    """
    rows = []
    for a, b, x, y in itertools.product(range(3), range(3), range(4), range(2)):
        three = (a, b, (a + b) % 3, (a + 2 * b) % 3)
        two = (y, y ^ (x & 1), y ^ (x >> 1))
        rows.append((three[0], two[0], three[1], three[2], two[1], three[3], x, two[2]))
    return np.array(rows)


UNIVERSES: tuple[Universe, ...] = tuple(
    Universe(*(levels[i] for levels, i in zip(LEVELS.values(), row, strict=True))) for row in orthogonal_array()
)
"""Those of the array."""


class Point(NamedTuple):
    """An environment in which a claim of the paper is judged: a figure's sweep at one of its values."""

    sweep: Sweep
    x: float


BASE_AT = {fig6.FIG6.name: 0.4, fig7.FIG7.name: 0.7, fig8.FIG8.name: 27.0, fig9.FIG9.name: 1.0}
"""Where the target environment as it is, with prioritised replay, lies in each figure."""
POINTS = (
    Point(fig9.FIG9, BASE_AT["fig9"]),
    *(Point(fig6.FIG6, x) for x in (0.1, 0.6, 0.8, 0.9)),
    *(Point(fig7.FIG7, x) for x in (0.1, 0.6, 0.9)),
    *(Point(fig8.FIG8, x) for x in (8.0, 40.0)),
    Point(fig9.FIG9, 0.0),
)
"""The points of every universe; the first belongs to all figures (BASE_AT)."""


def read_as(params: EnvParams, universe: Universe) -> EnvParams:
    """An environment of the paper in a universe."""
    distance, rule = universe.resolution
    probability = params.speed.event_probability.at[0].set(universe.low_speed_event_probability)
    return dataclasses.replace(
        params,
        speed=dataclasses.replace(params.speed, event_probability=probability),
        radar=params.radar.replace(distance=distance, counting_rule=rule),
        event_model=universe.event_model,
        miss_convention=universe.miss_convention,
        terminal_time_limit=universe.time_limit == "terminal",
    )


def hparams_of(hparams: HParams, universe: Universe) -> HParams:
    """Hyperparameters in a universe."""
    changes: dict[str, Any] = {
        "epsilon_slots": float(universe.epsilon_episodes * EnvParams.max_steps_in_episode),
        "learning_rate": universe.optimiser.learning_rate,
        "initial_weights": choice("initial_weights", universe.initial_weights, INITIAL_WEIGHTS),
    }
    return dataclasses.replace(
        hparams,
        **{name: jnp.asarray(value, jax.dtypes.result_type(getattr(hparams, name))) for name, value in changes.items()},
    )


def sweep_of(optimiser: str, universes: tuple[Universe, ...]) -> Sweep:
    """All points of all universes with one optimiser, as one program; `x` counts them, universe by universe."""

    def at(x: float) -> tuple[Universe, Point]:
        universe, point = divmod(int(x), len(POINTS))
        return universes[universe], POINTS[point]

    def params_at(x: float, preset: str) -> EnvParams:
        universe, point = at(x)
        return read_as(point.sweep.params_at(point.x, preset), universe)

    def hparams_at(x: float) -> HParams:
        universe, point = at(x)
        return hparams_of(point.sweep.hparams_at(point.x), universe)

    number, of = len(universes), f"{len(universes)} universes with {optimiser}"
    source = Sweep(
        name=f"multiverse/{optimiser}-source",
        description=f"source agents of {of}",
        learners=("ddqn", "q_learning", "round_robin"),
        x_name="universe",
        x_values=tuple(map(float, range(number))),
        params_at=lambda x, preset: read_as(environment_of("source", preset), universes[int(x)]),
        hparams_at=lambda x: hparams_of(HParams(), universes[int(x)]),
        optimiser=optimiser,
        seeds_per_part=1,
    )
    return Sweep(
        name=f"multiverse/{optimiser}",
        description=f"the claims' points in {of}",
        learners=TARGET_LEARNERS,
        x_name="number",
        x_values=tuple(map(float, range(number * len(POINTS)))),
        params_at=params_at,
        hparams_at=hparams_at,
        source=source,
        source_points=tuple(np.repeat(range(number), len(POINTS)).tolist()),
        optimiser=optimiser,
        seeds_per_part=1,
    )


def grouped(universes: tuple[Universe, ...]) -> dict[str, tuple[Universe, ...]]:
    """Universes by the name of their optimiser, the one reading that is not a number."""
    names = dict.fromkeys(universe.optimiser.name for universe in universes)
    return {name: tuple(u for u in universes if u.optimiser.name == name) for name in names}


MULTIVERSE = Study(
    name="multiverse",
    description=f"all claims in {len(UNIVERSES)} combinations of readings of the paper",
    sweeps=tuple(sweep_of(name, universes) for name, universes in grouped(UNIVERSES).items()),
    size=SIZE,
    smoke_sweeps=(sweep_of("adam", UNIVERSES[:2]),),
    smoke_size=SMOKE,
    presets=("paper",),  # where they differ is a reading itself
)
