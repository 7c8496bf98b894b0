"""What is measured for a claim: functions of one figure's results, as small classes whose fields stand in the tables.

Each is called with `Results` and returns `Measured`, or raises `Unknown` where these results can't answer the question.
All differences are paired: learners share their seeds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from paper_figs.analysis.censored import earlier, typical
from paper_figs.analysis.convergence import WINDOW, window_means
from paper_figs.analysis.intervals import Interval, mean_effect, ratio_effect
from paper_figs.analysis.pointwise import every_point, trend, up_to
from paper_figs.claims.results import Agent, Results

EARLY = 100
"""Episodes of which the paper compares the beginning."""


class Measured(NamedTuple):
    """An effect with its interval, and how far two learners are apart."""

    interval: Interval
    quantity: str = ""
    """What is compared, a field of `Delta`; empty where nothing is."""
    differences: tuple[Interval, ...] = ()
    """Differences between learners, in the unit of `Delta`, which are negligible if all of their limits are."""
    held: str = ""
    """At how many of the points the claim is supported, where it is about all of them."""


Effect = Callable[[Results], Measured]


def learners_of(effect: Effect) -> frozenset[str]:
    """Names of the learners that an effect compares."""
    fields = [getattr(effect, name, ()) for name in ("of", "over", "against", "than")]
    agents = [one for field in fields for one in (field if type(field) is tuple else (field,))]  # an Agent is a tuple
    names = [one.name if isinstance(one, Agent) else one for one in agents]
    return frozenset(name for name in names if isinstance(name, str))  # `over` may be a point's value


def metric_of(effect: Effect) -> str:
    """What an effect is about: reward, by which convergence is judged, too, throughput or miss detection."""
    return getattr(effect, "metric", "reward")


def _scaled(results: Results, metric: str, a: np.ndarray, b: np.ndarray, points: np.ndarray) -> tuple[Interval, ...]:
    """Mean differences a - b of [seeds, points] in the unit of `Delta`, one for each point."""
    scale = {
        "reward": np.abs(results.optimum()[points]),
        "throughput": np.abs(b.mean(axis=0)),
        "miss_detection": np.ones(len(points)),
    }[metric]
    with np.errstate(divide="ignore", invalid="ignore"):
        return tuple(mean_effect(column) for column in ((a - b) / scale).T)


@dataclass(frozen=True)
class EveryLead:
    """The smallest lead of a learner over others, at all points or at one."""

    metric: str
    of: str
    over: tuple[str, ...]
    sign: float = 1.0
    """-1 where less is better."""
    at: float | None = None
    """The point's value; all points if None."""

    def __call__(self, results: Results) -> Measured:
        points = results.points(least=2) if self.at is None else np.array([results.point(self.at)])
        mine = results.score(self.metric, self.of)[:, points]
        others = [results.score(self.metric, name)[:, points] for name in self.over]
        leads = [self.sign * (mine - other) for other in others]
        differences = [d for other in others for d in _scaled(results, self.metric, mine, other, points)]
        ahead = np.all([mean_effect(lead).low > 0 for lead in leads], axis=0)
        held = f"{ahead.sum()} of {len(points)}" if self.at is None else ""
        return Measured(every_point(np.concatenate(leads, axis=1)), self.metric, tuple(differences), held)


@dataclass(frozen=True)
class MeanLead:
    """The lead of a learner's reward over another's, as a share of the optimum, averaged over points below a value."""

    of: str
    over: str
    below: float

    def __call__(self, results: Results) -> Measured:
        points = results.points(high=self.below - 1e-3)
        mine, other = (results.score("reward", name)[:, points] for name in (self.of, self.over))
        lead = (mine - other) / np.abs(results.optimum()[points])
        return Measured(mean_effect(lead.mean(axis=1)), "reward", _scaled(results, "reward", mine, other, points))


@dataclass(frozen=True)
class Trend:
    """The smallest step of a metric, in the claimed direction, from one point to the next."""

    metric: str
    of: str
    sign: float
    """1 for a rise, -1 for a fall."""
    low: float = -np.inf
    high: float = np.inf

    def __call__(self, results: Results) -> Measured:
        points = results.points(self.low, self.high, least=2)
        values = self.sign * results.score(self.metric, self.of)[:, points]
        rising = mean_effect(np.diff(values, axis=1)).low > 0
        return Measured(trend(values), held=f"{rising.sum()} of {len(rising)} steps")


@dataclass(frozen=True)
class LargestReduction:
    """The largest relative reduction of miss detection against another learner at any point."""

    of: str
    against: str
    metric: ClassVar[str] = "miss_detection"

    def __call__(self, results: Results) -> Measured:
        points = results.points()
        mine, other = (results.score(self.metric, name)[:, points] for name in (self.of, self.against))
        differences = _scaled(results, self.metric, mine, other, points)
        return Measured(up_to(mine, other), self.metric, differences)


@dataclass(frozen=True)
class RelativeLevel:
    """A metric at one value over the same learner's at another."""

    metric: str
    of: str
    at: float
    over: float

    def __call__(self, results: Results) -> Measured:
        values = results.score(self.metric, self.of)
        return Measured(ratio_effect(values[:, results.point(self.at)], values[:, results.point(self.over)]))


@dataclass(frozen=True)
class HardlyMoves:
    """The room that a learner's change between two values leaves below two bounds, as a share of its level.

    The bounds are a share of its own level and the same share of another's rise; the change is one in either direction.
    """

    metric: str
    of: str
    than: str
    at: float
    over: float
    share: float

    def __call__(self, results: Results) -> Measured:
        end, start = results.point(self.at), results.point(self.over)
        mine, other = (results.score(self.metric, name) for name in (self.of, self.than))
        change, rise, level = mine[:, end] - mine[:, start], other[:, end] - other[:, start], mine[:, start]
        bounds = (self.share * level, self.share * rise)
        room = np.stack([bound + sign * change for bound in bounds for sign in (-1.0, 1.0)], axis=1)
        return Measured(every_point(room / np.abs(level.mean())))


@dataclass(frozen=True)
class EarlyLead:
    """The reward per slot of the first 100 episodes less another's."""

    of: Agent
    than: Agent

    def __call__(self, results: Results) -> Measured:
        results.require_episodes(EARLY)
        points = [results.point(agent.x) for agent in (self.of, self.than)]
        mine, other = (
            results.score("reward", agent.name, EARLY)[:, [point]]
            for agent, point in zip((self.of, self.than), points, strict=True)
        )
        differences = _scaled(results, "reward", mine, other, np.array(points[:1]))
        return Measured(mean_effect((mine - other)[:, 0]), "reward", differences)


@dataclass(frozen=True)
class Roughness:
    """How much the reward changes from one of the first 100 episodes to the next, less another's.

    It is the standard deviation of the change.
    """

    of: str
    than: str

    def __call__(self, results: Results) -> Measured:
        results.require_episodes(EARLY)
        mine, other = (self._of(results, name) for name in (self.of, self.than))
        differences = _scaled(results, "reward", mine[:, None], other[:, None], np.arange(1))
        return Measured(mean_effect(mine - other), "reward", differences)

    def _of(self, results: Results, name: str) -> np.ndarray:
        return np.diff(results.rewards(Agent(name))[:, :EARLY], axis=1).std(axis=1)


@dataclass(frozen=True)
class LateGap:
    """The mean gap to the optimum, as a share of it, after an episode."""

    of: Agent
    after: int
    curve: bool = False

    def __call__(self, results: Results) -> Measured:
        results.require_episodes(self.after + 1)
        results.require_convergence(self.of.x, self.curve)
        return Measured(mean_effect(results.gap(self.of, self.curve)[:, self.after :].mean(axis=1)))


@dataclass(frozen=True)
class Movement:
    """How much a curve still moves after an episode, as a share of the optimum, whatever its level.

    It is the standard deviation of the means over 20 episodes each.
    """

    of: Agent
    after: int
    curve: bool = False

    def __call__(self, results: Results) -> Measured:
        results.require_episodes(self.after + 2 * WINDOW)
        late = results.gap(self.of, self.curve)[:, self.after :]
        return Measured(mean_effect(window_means(late)[:, ::WINDOW].std(axis=1, ddof=1)))


@dataclass(frozen=True)
class TypicalEpisode:
    """The median episode in which runs converge; infinite where fewer than half do."""

    of: Agent
    curve: bool = False

    def __call__(self, results: Results) -> Measured:
        results.require_convergence(self.of.x, self.curve)
        value, low, high = typical(results.converged(self.of, self.curve))
        return Measured(Interval(value, np.minimum(low, results.episodes), high))


@dataclass(frozen=True)
class EarlierConvergence:
    """The probability that a run converges before another learner's with the same seed."""

    of: Agent
    than: Agent
    factor: float = 1.0
    """How many times as many episodes the other must need."""
    curve: bool = False

    def __call__(self, results: Results) -> Measured:
        for agent in (self.of, self.than):
            results.point(agent.x)
        mine, other = (results.converged(agent, self.curve) for agent in (self.of, self.than))
        if not np.isfinite(np.minimum(mine, other)).any():
            results.require_convergence(self.of.x, self.curve)
        multiple = np.where(self.factor * mine > results.episodes, np.inf, self.factor * mine)  # beyond what is seen
        known = np.isfinite(mine) | np.isfinite(other)
        with np.errstate(invalid="ignore"):
            apart = (other - mine)[known]
        differences = (typical(apart),) if known.any() else ()
        return Measured(earlier(multiple, other), "episodes" if known.any() else "", differences)
