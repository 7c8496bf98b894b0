"""What claims ask of results: one figure's data, by the names and values of the paper."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import xarray as xr

from paper_figs.analysis.convergence import TOLERANCE, convergence_episode, curve_gaps, gaps
from paper_figs.analysis.scores import mean_over_episodes
from paper_figs.claims.delta import Delta


class Axis(NamedTuple):
    """What varies along the points of a figure."""

    coordinate: str
    """Its name in results."""
    symbol: str
    """Its name in the paper."""


AXES = {
    "fig6": Axis("high_speed_event_probability", "p_1^v"),
    "fig7": Axis("favourable_probability", "tau_0"),
    "fig8": Axis("density", "omega"),
    "fig9": Axis("prioritised", "prioritised"),
}
"""By the figure's name, where it has several points."""


class Unknown(LookupError):
    """These results cannot answer a claim's question; the text says why."""


@dataclass(frozen=True)
class Rules:
    """The numbers that verdicts depend on."""

    tolerance: float = TOLERANCE
    """Gap to the optimum, as a share of it, up to which a policy counts as optimal."""
    delta: Delta = field(default_factory=Delta)
    """What is negligible."""
    least_seeds: int = 5
    """With fewer there are estimates and no verdicts."""


class Agent(NamedTuple):
    """A learner at one point of a figure."""

    name: str
    x: float | None = None
    """The point's value; None in a figure with a single point."""


@dataclass(frozen=True)
class Results:
    """The results of one figure."""

    data: xr.Dataset
    axis: Axis | None = None
    """What varies along its points; None for a single point."""
    rules: Rules = Rules()

    @property
    def n_seeds(self) -> int:
        """Seeds."""
        return self.data.sizes["seed"]

    @property
    def episodes(self) -> int:
        """Episodes of each run."""
        return self.data.sizes["episode"]

    def score(self, metric: str, algorithm: str, episodes: int | None = None) -> np.ndarray:
        """Mean of a metric over the first episodes (all if None), [seeds, points]."""
        self._require(algorithm)
        return mean_over_episodes(self.data, metric, algorithm, episodes)

    def rewards(self, agent: Agent) -> np.ndarray:
        """Simulated reward per slot of each episode, [seeds, episodes]."""
        self._require(agent.name)
        reward = self.data["reward"].sel(algorithm=agent.name).isel(point=self.point(agent.x))
        return reward.transpose("seed", "episode").values.astype(float)

    def optimum(self) -> np.ndarray:
        """The exact optimal reward per slot at each point, [points]."""
        return self.data["optimum_reward"].values.astype(float)

    def point(self, x: float | None) -> int:
        """Number of the point with this value.

        Raises:
          Unknown: where there is none.
        """
        if x is None or self.axis is None:
            return 0
        found = np.flatnonzero(np.isclose(self._x(), x))
        if not found.size:
            raise Unknown(f"no point at {self.axis.symbol} = {x:g}")
        return int(found[0])

    def points(self, low: float = -np.inf, high: float = np.inf, least: int = 1) -> np.ndarray:
        """Numbers of the points with values from `low` to `high`, in ascending order of the values.

        Raises:
          Unknown: where there are fewer than `least`.
        """
        if self.axis is None:
            return np.arange(1)
        x = self._x()
        order = np.argsort(x, kind="stable")
        edge = 1e-6
        found = order[(x[order] >= low - edge) & (x[order] <= high + edge)]
        if len(found) < least:
            raise Unknown(f"{len(found)} points of {self.axis.symbol}, {least} needed")
        return found

    def _x(self) -> np.ndarray:
        assert self.axis
        if self.axis.coordinate not in self.data.coords:
            raise Unknown(f"{self.axis.symbol} does not vary")
        return self.data[self.axis.coordinate].values.astype(float)

    def gap(self, agent: Agent, curve: bool) -> np.ndarray:
        """Gap of the curve, or of the exact policy, [seeds, episodes]."""
        self._require(agent.name)
        return (curve_gaps if curve else gaps)(self.data, agent.name, self.point(agent.x))

    def converged(self, agent: Agent, curve: bool) -> np.ndarray:
        """Episode in which each run converges, [seeds]; infinite where it never does."""
        self._require(agent.name)
        point, tolerance = self.point(agent.x), self.rules.tolerance
        return convergence_episode(self.data, agent.name, point, curve=curve, tolerance=tolerance)

    def require_convergence(self, x: float | None, curve: bool) -> None:
        """Raises Unknown where no run of any learner converges at a point: such a study says nothing about when."""
        names = [str(name) for name in self.data["algorithm"].values]
        if not any(np.isfinite(self.converged(Agent(name, x), curve)).any() for name in names):
            raise Unknown(f"nobody converges within {self.episodes} episodes")

    def require_episodes(self, least: int) -> None:
        """Raises Unknown where runs are shorter."""
        if self.episodes < least:
            raise Unknown(f"{self.episodes} episodes, {least} needed")

    def _require(self, algorithm: str) -> None:
        if algorithm not in self.data["algorithm"].values:
            raise Unknown(f"no results of {algorithm}")
