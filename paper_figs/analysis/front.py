"""The trade-off between throughput and miss detection: the exact front, and where the learners' policies lie.

Equation (7) is read in two ways. Over all slots, every slot without radar counts as missed, event or not. Over slots
with an event only, which is what the reward (11) punishes, it depends on where a policy transmits.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import xarray as xr

from jrcjax import exact, front
from jrcjax.config.paths import Points, parameter_at
from jrcjax.config.stacking import with_value
from jrcjax.learners.hparams import HParams
from jrcjax.model.params import EnvParams
from jrcjax.readings import MissConvention
from paper_figs.analysis.statistics import mean_over_seeds

NAME, TITLE = "front", "Throughput against miss detection: what policies can reach"
COLUMNS = (
    "figure", "panel", "convention", "algorithm", "value", "x", "x_low", "x_high", "mean", "ci_low", "ci_high",
    "n_seeds",
)  # fmt: skip
"""`x` is packets per slot, `mean` the miss detection, `value` that of the parameter that a panel varies."""
CONVENTIONS = ("all_slots", "event_slots")
VARIED = {
    "b": ("env.radar.density", (8.0, 24.0, 40.0)),
    "c": ("env.speed.event_probability.1", (0.1, 0.5, 0.9)),
    "d": ("env.all.prior.0", (0.1, 0.5, 0.9)),
}
"""Panel to the parameter that varies, and its values: ends and middle of Figs. 8, 6 and 7."""
WORTH = tuple(2.0 ** np.linspace(-4, 4, 33))
"""Factors of rho_1, what a packet earns, over which the optimum of equation (11) is followed."""
_SETTLED = 0.1  # of the episodes, the last, over which a learner's exact policy is averaged


def _exact_row(panel: str, params: EnvParams, name: str, value: float, x, y) -> tuple:
    convention = MissConvention.names()[int(params.miss_convention)]
    return (NAME, panel, convention, name, value, *[float(x)] * 3, *[float(y)] * 3, 0)


def front_rows(panel: str, params: EnvParams, value: float = np.nan) -> list[tuple]:
    """The distinct corners of an environment's front."""
    corners = np.unique(np.stack(front.front(params), axis=1), axis=0)
    return [_exact_row(panel, params, "front", value, *corner) for corner in corners]


@jax.jit
def _optima(params: EnvParams) -> exact.LongRun:
    """What is optimal for equation (11) where packets are worth WORTH times as much, [33]."""

    def optimum(factor: jax.Array) -> exact.LongRun:
        weights = params.reward_weights * jnp.array([factor, 1.0, 1.0, 1.0])
        changed = dataclasses.replace(params, reward_weights=weights)
        return exact.evaluate_policy(changed, exact.optimal_policy(changed))

    return jax.vmap(optimum)(jnp.asarray(WORTH, jnp.float32))


def reward_rows(params: EnvParams) -> list[tuple]:
    """The optimum of equation (11) for packets that are worth less and more, in that order, and as it is."""
    runs = _optima(params)
    numbers = list(zip(WORTH, runs.throughput, runs.miss_detection, strict=True))
    weighted = [_exact_row("a", params, "weighted", *row) for row in numbers]
    return [*weighted, _exact_row("a", params, "optimum", *numbers[WORTH.index(1.0)])]


def random_row(params: EnvParams) -> tuple:
    """The policy that takes each action equally often, as Round Robin does too in the long run."""
    even = jnp.full((params.num_states, params.num_actions), 1.0 / params.num_actions)
    run = exact.evaluate_policy(params, even)
    return _exact_row("a", params, "round_robin", np.nan, run.throughput, run.miss_detection)


def learner_rows(params: EnvParams, data: xr.Dataset) -> list[tuple]:
    """The exact policies of the learners in the last tenth of their episodes, with intervals over seeds."""
    last = data.isel(point=0, episode=slice(-max(1, int(_SETTLED * data.sizes["episode"])), None)).mean("episode")
    convention = MissConvention.names()[int(params.miss_convention)]
    rows = []
    for name in map(str, data["algorithm"].values):
        if name == "round_robin":  # see `random_row`
            continue
        policies = last.sel(algorithm=name)
        both = [mean_over_seeds(policies[f"policy_{metric}"].values) for metric in ("throughput", "miss_detection")]
        bounds = [float(number) for mean in both for number in (mean.mean, mean.low, mean.high)]
        rows.append((NAME, "a", convention, name, np.nan, *bounds, both[0].n_seeds))
    return rows


def exact_rows(params: EnvParams) -> list[tuple]:
    """All numbers but the learners'."""
    rows = []
    for target in _conventions(params):
        rows += [*front_rows("a", target), *reward_rows(target), random_row(target)]
    point = Points(params, HParams())
    for panel, (path, values) in VARIED.items():
        varied = parameter_at(path, point)
        for value in values:
            for moved in _conventions(with_value(point, varied, value).params):
                rows += front_rows(panel, moved, value)
    return rows


def table(params: EnvParams, data: xr.Dataset, exact: list[tuple] | None = None) -> pd.DataFrame:
    """The plotted numbers.

    Args:
      params: the target environment.
      data: results of the learners there, those of Fig. 5(b), in the convention of `params`.
      exact: `exact_rows` of this environment, if they are known.
    """
    rows = [*learner_rows(params, data), *(exact_rows(params) if exact is None else exact)]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _conventions(params: EnvParams) -> list[EnvParams]:
    return [dataclasses.replace(params, miss_convention=name) for name in CONVENTIONS]
