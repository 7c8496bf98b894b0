"""The single numbers that texts quote beside the verdicts and the plotted ones, from the results of Fig. 5."""

from __future__ import annotations

import functools
from collections.abc import Mapping

import numpy as np
import xarray as xr

from jrcjax import exact
from paper_figs.analysis.convergence import TOLERANCE, gaps
from paper_figs.analysis.scores import mean_over_episodes
from paper_figs.claims.results import Rules
from paper_figs.claims.table import claims_of_figure
from sweeps.preset import environment_of
from sweeps.sweep import Size

TOLERANCES = (0.01, 0.03, 0.05)
"""Gaps that could count as optimal, to show how far verdicts depend on the choice."""
Numbers = dict[str, float | str]


def numbers_of(figures: Mapping[str, xr.Dataset], preset: str = Size.preset) -> dict[str, Numbers]:
    """The quoted numbers of each figure that is there, by name; `preset` is what they were run with."""
    makers = {"fig5a": functools.partial(of_source, preset=preset), "fig5b": of_target}
    return {name: makers[name](data) for name, data in figures.items() if name in makers}


def _means(values: np.ndarray) -> float:
    return float(f"{values.mean():.4g}")


def _of_learners(data: xr.Dataset) -> Numbers:
    found: Numbers = {}
    for name in map(str, data["algorithm"].values):
        gap = gaps(data, name)
        found[f"first_gap_{name}"] = _means(gap[:, 0])
        found[f"early_gap_{name}"] = _means(gap[:, 50:100])
        found[f"late_gap_{name}"] = _means(gap[:, 400:])
        found[f"packets_{name}"] = _means(mean_over_episodes(data, "throughput", name))
        found[f"miss_{name}"] = _means(mean_over_episodes(data, "miss_detection", name))
    return found


def _of_environment(data: xr.Dataset) -> Numbers:
    optimum, constant = (float(data[f"{line}_reward"].isel(point=0)) for line in ("optimum", "constant"))
    explored = float(data["explored_reward"].isel(point=0, episode=-1))
    return {
        "optimum": float(f"{optimum:.4g}"),
        "explored": float(f"{explored:.4g}"),
        "constant": float(f"{constant:.4g}"),
        "constant_gap": float(f"{1 - constant / optimum:.3g}"),
    }


def of_source(data: xr.Dataset, preset: str = Size.preset) -> Numbers:
    """Fig. 5(a): the environment, the learners, and verdicts at other tolerances."""
    params = environment_of("source", preset)
    best = exact.optimal_policy(params)
    late = gaps(data, "ddqn")[:, 400:]
    found = _of_environment(data) | _of_learners(data)
    found["states_that_transmit"] = float(best[:, : params.num_rates].sum())
    found["mean_value"] = float(f"{exact.value_iteration(params).max(axis=1).mean():.3g}")
    found["snapshots_beyond"] = float(f"{(late > TOLERANCE).mean():.3g}")
    for tolerance in TOLERANCES:
        verdicts = {j.claim: j.verdict for j in claims_of_figure("fig5a", data, Rules(tolerance=tolerance))}
        for label, claim in (("c1", "C1 (reached)"), ("c2", "C2 (Q-learning, source)")):
            found[f"{label}_at_{tolerance:g}"] = verdicts[claim]
    return found


def of_target(data: xr.Dataset) -> Numbers:
    """Fig. 5(b): the environment and the learners."""
    return _of_environment(data) | _of_learners(data)
