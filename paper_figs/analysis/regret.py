"""What each learner's policy is worth: exact long-run figures of the greedy policy beside the simulated ones."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from jrcjax.model.params import EnvParams
from paper_figs.analysis import divergence
from paper_figs.analysis.convergence import WINDOW, sample_complexity
from paper_figs.analysis.statistics import mean_over_seeds

LAST = 100
"""Episodes at the end over which the simulated figures are averaged."""


def table(data: xr.Dataset, figure: str) -> pd.DataFrame:
    """One row per learner and point: the last policy, the last simulated episodes, and how soon it was good.

    `policy_*` are exact, per slot in the long run, of the greedy policy after the last episode; `simulated_*` are means
    over the last episodes, exploration included, per slot as well. `regret` is the exact optimum less the policy's
    reward, `simulated_regret` the reward per slot lost against it over all episodes. `median_episodes` and
    `restricted_mean_episodes` say when policies are within 5 % of the optimum; `reached` is the share of seeds that
    ever are. Each number has its 95 % interval over seeds, but for the median.
    """
    slots = EnvParams.max_steps_in_episode
    rows = []
    for point in range(data.sizes["point"]):
        for name in data["algorithm"].values:
            here = data.sel(algorithm=name).isel(point=point).transpose("seed", "episode", ...)
            late, last = here.isel(episode=slice(-LAST, None)), here.isel(episode=-1)
            optimum = {
                metric: float(here[f"optimum_{metric}"]) for metric in ("reward", "throughput", "miss_detection")
            }
            numbers = {
                "policy_reward": last["policy_reward"],
                "policy_throughput": last["policy_throughput"],
                "policy_miss_detection": last["policy_miss_detection"],
                "simulated_reward": late["reward"].mean("episode"),
                "simulated_throughput": late["throughput"].mean("episode") / slots,
                "simulated_miss_detection": late["miss_detection"].mean("episode"),
                "regret": optimum["reward"] - last["policy_reward"],
                "simulated_regret": optimum["reward"] - here["reward"].mean("episode"),
            }
            row: dict[str, object] = {
                "figure": figure,
                "point": point,
                "algorithm": name,
                "n_seeds": here.sizes["seed"],
            }
            row["n_diverged"] = divergence.count(data, name, point)
            row |= {f"optimum_{metric}": value for metric, value in optimum.items()}
            for label, values in numbers.items():
                mean = mean_over_seeds(np.asarray(values.values, float))
                row |= {label: mean.mean, f"{label}_low": mean.low, f"{label}_high": mean.high}
            if here.sizes["episode"] >= WINDOW:
                sample = sample_complexity(data, name, point)
                row["median_episodes"] = sample.median
                for label, interval in (
                    ("reached", sample.reached),
                    ("restricted_mean_episodes", sample.restricted_mean),
                ):
                    row |= {label: interval.value, f"{label}_low": interval.low, f"{label}_high": interval.high}
            rows.append(row)
    return pd.DataFrame(rows)
