"""What each learner's policy is worth: exact long-run figures of the greedy policy beside the simulated ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from paper_figs.analysis import divergence
from paper_figs.analysis.convergence import sample_complexity
from paper_figs.analysis.statistics import mean_over_seeds

LAST = 100
"""Episodes at the end over which the simulated figures are averaged."""
_METRICS = ("reward", "throughput", "miss_detection")


def table(data: xr.Dataset, figure: str, slots: int) -> pd.DataFrame:
    """One row per learner and point: the last policy, the last simulated episodes, and how soon it was good.

    `policy_*` are exact, per slot in the long run, of the greedy policy after the last episode; `simulated_*` are means
    over the last episodes, exploration included, per slot as well. `regret` is the exact optimum less the policy's
    reward, `simulated_regret` the reward per slot lost against it over all episodes. `median_episodes` says when half
    of the seeds' policies are within 5 % of the optimum and stay there, infinite where they never do; `reached` is the
    share of seeds that ever do. Each number has its 95 % interval over seeds.

    Args:
      data: results of a sweep.
      figure: what the rows are called.
      slots: of an episode.
    """
    rows = []
    for point in range(data.sizes["point"]):
        for name in data["algorithm"].values:
            here = data.sel(algorithm=name).isel(point=point).transpose("seed", "episode", ...)
            row: dict[str, Any] = {"figure": figure, "point": point, "algorithm": name, "n_seeds": here.sizes["seed"]}
            row["n_diverged"] = divergence.count(data, name, point)
            row |= {f"optimum_{metric}": float(here[f"optimum_{metric}"]) for metric in _METRICS}
            for label, values in _worth(here, slots).items():
                mean = mean_over_seeds(np.asarray(values.values, float))
                row |= {label: mean.mean, f"{label}_low": mean.low, f"{label}_high": mean.high}
            sample = sample_complexity(data, name, point)
            for label, (value, low, high) in (("median_episodes", sample.median), ("reached", sample.reached)):
                row |= {label: value, f"{label}_low": low, f"{label}_high": high}
            rows.append(row)
    return pd.DataFrame(rows)


def _worth(here: xr.Dataset, slots: int) -> dict[str, xr.DataArray]:
    """What one learner's seeds are worth at one point, [seeds] each."""
    late, last = here.isel(episode=slice(-LAST, None)), here.isel(episode=-1)
    numbers = {f"policy_{metric}": last[f"policy_{metric}"] for metric in _METRICS}
    numbers |= {f"simulated_{metric}": late[metric].mean("episode") for metric in _METRICS}
    numbers["simulated_throughput"] = numbers["simulated_throughput"] / slots
    numbers["regret"] = here["optimum_reward"] - last["policy_reward"]
    numbers["simulated_regret"] = here["optimum_reward"] - here["reward"].mean("episode")
    return numbers
