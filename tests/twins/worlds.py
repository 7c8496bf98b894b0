"""Whole studies whose truth is known: results of every figure as the paper's text has them, and their opposite."""

import numpy as np
import xarray as xr

TENTHS = tuple(round(0.1 * i, 1) for i in range(1, 10))
DENSITIES = tuple(range(8, 41, 4))
NEVER = np.inf
EPSILON_EPISODES = 100
COST = 8.0
"""Reward per slot that fully random play costs."""


class Learner:
    """One learner's truth at each of some points: a gap until it converges, and another afterwards."""

    def __init__(self, converges, before, after=0.01, throughput=100.0, miss=0.3, rough=0.0, swing=0.0):
        self.converges, self.before, self.after = converges, before, after
        self.throughput, self.miss, self.rough, self.swing = throughput, miss, rough, swing

    def gap(self, points, seeds, episodes):
        """[points, seeds, episodes]; seeds converge within two episodes of each other."""
        e = np.arange(1, episodes + 1)
        converges, before, after = (
            np.broadcast_to(np.asarray(x, float), (points,))[:, None, None]
            for x in (self.converges, self.before, self.after)
        )
        arrival = converges + (np.arange(seeds) % 3 - 1)[:, None]
        swing = self.swing * np.where(e // 50 % 2, 1.0, -1.0)
        return np.where(e >= arrival, after, before) + swing


def study(learners, optimum, x_name="environment", x=(0.0,), seeds=10, episodes=1000, noise=1e-3):
    """Results of a figure whose learners have these truths. Rewards, exploration included, follow from the gaps."""
    rng, points = np.random.default_rng(3), len(x)
    optimum = np.broadcast_to(np.asarray(optimum, float), (points,))
    shape, dims = (points, seeds, episodes), ("algorithm", "point", "seed", "episode")
    epsilon = np.clip(1 - np.arange(episodes) / EPSILON_EPISODES, 0.01, 1.0)
    explored = optimum[:, None] - COST * epsilon
    alternating = np.where(np.arange(episodes) % 2, 1.0, -1.0)
    arrays = {name: [] for name in ("reward", "throughput", "miss_detection", "policy_reward")}
    for learner in learners.values():
        loss = learner.gap(points, seeds, episodes) * np.abs(optimum)[:, None, None]
        own = np.broadcast_to(noise * rng.standard_normal(shape), shape)
        arrays["reward"].append(explored[:, None] - loss + own + learner.rough * alternating)
        arrays["policy_reward"].append(optimum[:, None, None] - loss + own)
        for metric, level in (("throughput", learner.throughput), ("miss_detection", learner.miss)):
            arrays[metric].append(np.broadcast_to(np.asarray(level, float), (points,))[:, None, None] + own)
    variables = {name: (dims, np.array(values)) for name, values in arrays.items()}
    variables |= {f"policy_{m}": variables[m] for m in ("throughput", "miss_detection")}
    variables["first_diverged"] = (dims[:3], np.full((len(learners), points, seeds), -1))
    variables["explored_reward"] = (("point", "episode"), explored)
    variables |= {f"{line}_reward": (("point",), optimum) for line in ("optimum", "constant")}
    for metric in ("throughput", "miss_detection"):
        variables |= {f"{line}_{metric}": (("point",), np.full(points, 0.5)) for line in ("optimum", "constant")}
        variables[f"explored_{metric}"] = (("point", "episode"), np.full((points, episodes), 0.5))
    coords = {"algorithm": list(learners), "point": range(points), x_name: ("point", np.array(x, float))}
    return xr.Dataset(variables, coords | {"seed": range(seeds), "episode": range(1, episodes + 1)})


def ramp(first, last, points=9):
    return np.linspace(first, last, points)


def late(early, jumped):
    """A level below 0.7, and its rise at 0.7, 0.8 and 0.9."""
    return np.array([early] * 6 + [early + (jumped - early) * i / 3 for i in (1, 2, 3)])


def as_the_paper_says(**size):
    """The results of all figures in a world in which every claim is true."""
    falling = np.array([0.5] * 6 + [1.2, 1.9, 2.6])
    ddqn_below_07 = np.array([0.3] * 6 + [0.15, 0.1, 0.005])
    return {
        "fig5a": study(
            {"ddqn": Learner(200, 0.5), "q_learning": Learner(NEVER, 0.3), "round_robin": Learner(NEVER, 2.0)},
            4.0, **size,
        ),
        "fig5b": study(
            {
                "tlwd": Learner(100, 0.3), "dpr": Learner(100, 0.5, rough=0.3), "ddqn": Learner(400, 0.5),
                "q_learning": Learner(NEVER, 0.6), "round_robin": Learner(NEVER, 2.0),
            },
            5.0, **size,
        ),
        "fig6": study(
            {
                "tlwd": Learner(150, 0.3, throughput=50.0, miss=0.2 - 0.01 * np.arange(9)),
                "dpr": Learner(150, 0.4, throughput=60.0, miss=0.25),
                "ddqn": Learner(400, falling, throughput=200.0, miss=0.365),
            },
            ramp(2.0, 4.0), "high_speed_event_probability", TENTHS, **size,
        ),
        "fig7": study(
            {
                "tlwd": Learner(1, 0.02, 0.02, late(100.0, 104.0), late(0.3, 0.305)),
                "dpr": Learner(1, 0.05, 0.05, late(110.0, 116.0), late(0.32, 0.33)),
                "ddqn": Learner(1, ddqn_below_07, ddqn_below_07, late(120.0, 400.0), late(0.4, 0.8)),
            },
            ramp(10.0, 2.0), "favourable_probability", TENTHS, **size,
        ),
        "fig8": study(
            {
                "tlwd": Learner(1, 0.02, 0.02, miss=0.39 * ramp(0.2, 0.8)),
                "dpr": Learner(1, 0.05, 0.05, miss=0.5 * ramp(0.2, 0.8)),
                "ddqn": Learner(1, 0.1, 0.1, miss=ramp(0.2, 0.8)),
            },
            ramp(6.0, 4.0), "density", DENSITIES, **size,
        ),
        "fig9": study(
            {"tlwd": Learner([100, 300], [0.3, 0.5])}, 5.0, "prioritised", (1.0, 0.0), **size,
        ),
    }  # fmt: skip


def opposite(**size):
    """The results of all figures in a world in which every claim is false."""
    falling = np.array([0.5] * 6 + [1.2, 1.9, 2.6])
    worst_at_09 = np.array([0.02] * 8 + [0.5])
    down = ramp(0.8, 0.2)
    return {
        "fig5a": study(
            {
                "ddqn": Learner(NEVER, 0.5, swing=0.3), "q_learning": Learner(50, 0.5),
                "round_robin": Learner(1, 0.0, 0.0),
            },
            4.0, **size,
        ),
        "fig5b": study(
            {
                "tlwd": Learner(400, 0.5, rough=0.3), "dpr": Learner(400, 0.3), "ddqn": Learner(100, 0.5),
                "q_learning": Learner(50, 0.5), "round_robin": Learner(1, 0.0, 0.0),
            },
            5.0, **size,
        ),
        "fig6": study(
            {
                "tlwd": Learner(400, falling, throughput=200.0, miss=0.4), "dpr": Learner(20, 20 * falling, miss=0.3),
                "ddqn": Learner(150, 0.3, throughput=50.0, miss=0.2),
            },
            ramp(2.0, 4.0), "high_speed_event_probability", TENTHS, **size,
        ),
        "fig7": study(
            {
                "tlwd": Learner(1, 0.3, 0.3, late(100.0, 400.0), late(0.3, 0.8)),
                "dpr": Learner(1, 0.05, 0.05, late(100.0, 400.0), late(0.3, 0.8)),
                "ddqn": Learner(1, worst_at_09, worst_at_09, late(100.0, 104.0), late(0.3, 0.3)),
            },
            ramp(2.0, 10.0), "favourable_probability", TENTHS, **size,
        ),
        "fig8": study(
            {"tlwd": Learner(1, 0.1, 0.1, miss=down), "dpr": Learner(1, 0.05, 0.05, miss=0.9 * down),
             "ddqn": Learner(1, 0.02, 0.02, miss=0.8 * down)},
            ramp(4.0, 6.0), "density", DENSITIES, **size,
        ),
        "fig9": study(
            {"tlwd": Learner([300, 100], [0.5, 0.3])}, 5.0, "prioritised", (1.0, 0.0), **size,
        ),
    }  # fmt: skip


def indistinguishable(converges=100, **size):
    """All learners are the same agent at every point, seed by seed."""
    same = as_the_paper_says(**size)
    found = {}
    for figure, data in same.items():
        one = study({"any": Learner(converges, 0.5)}, 4.0, **size)
        copies = one.isel(algorithm=[0] * data.sizes["algorithm"], point=[0] * data.sizes["point"])
        coords = {name: data[name] for name in data.coords}
        found[figure] = copies.drop_vars("environment").assign_coords(coords)
    return found
