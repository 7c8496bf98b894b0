"""Results of sweeps with known means, made up instead of computed."""

import numpy as np
import xarray as xr


def swept(x_name, x_values, reward, packets=None, miss=None, seeds=6, episodes=600, slow=()):
    """Results of a sweep with known means per algorithm and point and noise between seeds.

    Learners converge in episode 11, those in `slow` in episode 401.
    """
    rng = np.random.default_rng(3)
    algorithms, points_ = list(reward), len(x_values)
    dims = ("algorithm", "point", "seed", "episode")
    shape = (len(algorithms), points_, seeds, episodes)
    noise = 1e-3 * rng.standard_normal(shape)
    late = np.arange(episodes) >= 10
    found = {"reward": reward, "throughput": packets or reward, "miss_detection": miss or reward}
    variables = {
        name: (dims, np.array([values[a] for a in algorithms], float)[:, :, None, None] + noise)
        for name, values in found.items()
    }
    gap = np.array([np.where(np.arange(episodes) >= 400 if a in slow else late, 0.01, 0.5) for a in algorithms])
    variables["policy_reward"] = (dims, 4.0 * (1 - gap[:, None, None, :]) + noise)
    variables["first_diverged"] = (dims[:3], np.full(shape[:3], -1))
    for metric in ("reward", "throughput", "miss_detection"):
        variables[f"optimum_{metric}"] = (("point",), np.full(points_, 4.0))
        variables[f"constant_{metric}"] = (("point",), np.full(points_, 3.0))
        variables[f"explored_{metric}"] = (("point", "episode"), np.full((points_, episodes), 3.5))
    coords = {
        "algorithm": algorithms,
        x_name: ("point", list(x_values)),
        "seed": range(seeds),
        "episode": range(1, episodes + 1),
    }
    return xr.Dataset(variables, coords)
