"""Worlds at the edge of a claim: the truth is exactly the claim's limit, so any verdict but "undecided" is false.

All learners of a study share their seeds, and what a seed does to all of them is drawn once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import stats

from paper_figs.analysis import censored, intervals, pointwise
from paper_figs.analysis.intervals import Interval
from paper_figs.calibration import laws
from paper_figs.calibration.laws import Law

POINTS = 9
"""Points of a figure."""
_CLEAR = 100.0  # deviations by which a point is off the edge
_NEVER = 0.1  # share of runs that never converge

Draw = Callable[[np.random.Generator, int, int], tuple[np.ndarray, ...]]


class World(NamedTuple):
    """A law of studies, and what is asked of each."""

    rule: str
    name: str
    interval: Callable[..., Interval]
    """The rule itself, of arrays [n, ..., studies]."""
    draw: Draw
    """(generator, seeds, studies) to the rule's arguments."""
    truth: float
    """What the interval should cover."""
    relation: str = ">"
    limit: float | tuple[float, float] | None = None
    """Of the claim; the truth if None."""
    columns: int = 1
    """Numbers per seed and study, which say how many studies fit into memory."""


def _of_mean(name: str, law: Law) -> World:
    return World("mean", name, intervals.mean_effect, lambda rng, n, studies: (law(rng, (n, studies)),), 0.0)


def _difference(rng: np.random.Generator, n: int, studies: int) -> tuple[np.ndarray, ...]:
    """Two learners with skewed results and a common effect of the seed."""
    seed = laws.lognormal(rng, (n, studies))
    return (seed + laws.exponential(rng, (n, studies)) - (seed + laws.exponential(rng, (n, studies))),)


def _ratio(law: Law) -> Draw:
    """Two learners whose results have the ratio 2, and a common factor of the seed."""

    def draw(rng: np.random.Generator, n: int, studies: int) -> tuple[np.ndarray, ...]:
        seed = 1 + 0.1 * law(rng, (n, studies))
        a, b = (mean * seed * (1 + 0.2 * law(rng, (n, studies))) for mean in (2.0, 1.0))
        return a, b

    return draw


def _leads(law: Law, clear: float) -> Draw:
    """Leads of a learner over two rivals at each point, 0 at one of them and `clear` elsewhere."""

    def draw(rng: np.random.Generator, n: int, studies: int) -> tuple[np.ndarray, ...]:
        mine, first, second = (law(rng, (n, POINTS, studies)) for _ in range(3))
        leads = np.concatenate([mine - first, mine - second], axis=1)
        leads[:, 1:] += clear
        return (leads,)

    return draw


def _reductions(law: Law, clear: float) -> Draw:
    """Two learners whose results at each point have the ratio 0.33 at one of them and `clear` more elsewhere."""

    def draw(rng: np.random.Generator, n: int, studies: int) -> tuple[np.ndarray, ...]:
        seed = 1 + 0.05 * law(rng, (n, 1, studies))
        a, b = (seed * (1 + 0.1 * law(rng, (n, POINTS, studies))) for _ in range(2))
        ratio = np.full((POINTS, 1), 0.33 + clear)
        ratio[0] = 0.33
        return ratio * a, b

    return draw


def _steps(law: Law, clear: float) -> Draw:
    """A curve over the points that is flat from the first to the second, and rises by `clear` elsewhere."""

    def draw(rng: np.random.Generator, n: int, studies: int) -> tuple[np.ndarray, ...]:
        seed = law(rng, (n, 1, studies))
        rise = clear * np.maximum(np.arange(POINTS) - 1.0, 0.0)[:, None]
        return (seed + law(rng, (n, POINTS, studies)) + rise,)

    return draw


def _episodes(never: float, rounded: float = 0.0) -> Callable[[np.random.Generator, int, int], np.ndarray]:
    """Skewed episodes of median 1, of which a share is infinite, in multiples of `rounded` if that is not 0."""

    def draw(rng: np.random.Generator, n: int, studies: int) -> np.ndarray:
        episodes = np.exp(rng.standard_normal((n, studies)))
        episodes = np.ceil(episodes / rounded) * rounded if rounded else episodes
        return np.where(rng.random((n, studies)) < never, np.inf, episodes)

    return draw


def _two(never: float, rounded: float = 0.0) -> Draw:
    of_one = _episodes(never, rounded)
    return lambda rng, n, studies: (of_one(rng, n, studies), of_one(rng, n, studies))


def _shared(rng: np.random.Generator, n: int, studies: int) -> tuple[np.ndarray, ...]:
    """Episodes of two learners, most of whose variation is the seed's."""
    seed = laws.lognormal(rng, (n, studies))
    a, b = (seed + 0.5 * laws.exponential(rng, (n, studies)) for _ in range(2))
    return a, b


def _one(never: float) -> Draw:
    of_one = _episodes(never)
    return lambda rng, n, studies: (of_one(rng, n, studies),)


def _shares(share: float) -> Draw:
    return lambda rng, n, studies: (np.where(rng.random((n, studies)) < share, 1.0, np.inf),)


def _converged(episodes: np.ndarray) -> Interval:
    return censored.reached_by(episodes, 0.0, 1.0)


def _runs(law: Law, common: float) -> Draw:
    """Two learners of one law, with so much of it in common."""

    def draw(rng: np.random.Generator, n: int, studies: int) -> tuple[np.ndarray, ...]:
        seed = common * law(rng, (n, studies))
        a, b = (seed + law(rng, (n, studies)) for _ in range(2))
        return a, b

    return draw


_MIDDLE = float(2 * stats.expon.expect(lb=stats.expon.ppf(0.25), ub=stats.expon.ppf(0.75))) - 1.0
_MEDIAN_OF_ALL = float(np.exp(stats.norm.ppf(0.5 / (1 - _NEVER))))


def _means() -> list[World]:
    of_laws = [_of_mean(name, law) for name, law in laws.LAWS.items()]
    within = World("negligible", "normal", intervals.mean_effect, of_laws[0].draw, 0.0, "within", (-10.0, 0.0))
    return [
        *of_laws,
        World("mean", "two skewed learners that share seeds", intervals.mean_effect, _difference, 0.0),
        _of_mean("one run in ten is a catastrophe", laws.catastrophe),
        within,
        within._replace(name="exponential", draw=of_laws[1].draw),
        *(World("ratio", name, intervals.ratio_effect, _ratio(law), 2.0) for name, law in laws.LAWS.items()),
    ]


def _points() -> list[World]:
    found = []
    for rule, interval, draw, names, clear, truth in (
        ("every point", pointwise.every_point, _leads, ("one worst", "all equal"), _CLEAR, 0.0),
        ("up to", pointwise.up_to, _reductions, ("one best", "all equal"), 0.6, 0.67),
        ("rises", pointwise.trend, _steps, ("one flat step", "all flat"), _CLEAR, 0.0),
    ):
        for law in ("normal", "exponential", "t with 3 degrees of freedom"):
            for name, apart in zip(names, (clear, 0.0), strict=True):
                studies = draw(laws.LAWS[law], apart)
                found.append(World(rule, f"{law}, {name}", interval, studies, truth, columns=3 * POINTS))
    return found


def _convergence() -> list[World]:
    earlier, typical = censored.earlier, censored.typical
    return [
        World("earlier", "without ties", earlier, _two(0.0), 0.5),
        World("earlier", "with ties", earlier, _two(0.0, 0.5), 0.5),
        World("earlier", "one run in ten never converges", earlier, _two(_NEVER), 0.5),
        World("earlier", "learners that share seeds", earlier, _shared, 0.5),
        World("typical episode", "at the upper end of the band", typical, _one(0.0), 1.0, "within", (1 / 3, 1.0)),
        World("typical episode", "at the lower end of the band", typical, _one(0.0), 1.0, "within", (1.0, 3.0)),
        World(
            "typical episode",
            "one run in ten never converges",
            typical,
            _one(_NEVER),
            _MEDIAN_OF_ALL,
            "within",
            (_MEDIAN_OF_ALL / 3, _MEDIAN_OF_ALL),
        ),
        World("share of runs", "half", _converged, _shares(0.5), 0.5),
        World("share of runs", "nine in ten", _converged, _shares(0.9), 0.9),
    ]


def _descriptions() -> list[World]:
    middle, improvement = intervals.interquartile_mean, intervals.probability_of_improvement
    return [
        World("inter-quartile mean", "normal", middle, lambda rng, n, b: (laws.normal(rng, (n, b)),), 0.0),
        World(
            "inter-quartile mean", "exponential", middle, lambda rng, n, b: (laws.exponential(rng, (n, b)),), _MIDDLE
        ),
        World("improvement", "normal", improvement, _runs(laws.normal, 0.0), 0.5, columns=2),
        World("improvement", "lognormal", improvement, _runs(laws.lognormal, 0.0), 0.5, columns=2),
        World("improvement", "learners that share seeds", improvement, _runs(laws.normal, 1.0), 0.5, columns=2),
    ]


WORLDS: tuple[World, ...] = (*_means(), *_points(), *_convergence(), *_descriptions())
