"""What the paper says of its learning curves, Figs. 5 and 9: claims C1 to C4 and C15."""

from __future__ import annotations

import numpy as np
import xarray as xr

from paper_figs.analysis.convergence import TOLERANCE, convergence_episode, gaps
from paper_figs.claims.judge import Judgement, first, judge

_EARLY = 100  # episodes of which the paper compares the beginning


def _mean(episodes: np.ndarray) -> np.ndarray:
    """Mean over the episodes of [seeds, episodes]; NaN where there are none."""
    return episodes.mean(axis=1) if episodes.shape[1] else np.full(len(episodes), np.nan)


def _reference_claims(data: xr.Dataset, where: str, figure: str, tolerance: float) -> list[Judgement]:
    """C2 in one environment."""
    of = {name: first(data, "reward", name)[:, 0] for name in data["algorithm"].values}
    below = of["round_robin"] - np.min([reward for name, reward in of.items() if name != "round_robin"], axis=0)
    return [
        judge(
            f"C2 (Q-learning, {where})",
            f"Q-learning does not reach the optimal policy in the {where}",
            "mean gap after episode 400",
            _mean(gaps(data, "q_learning")[:, 400:]),
            ">=",
            tolerance,
            figure,
        ),
        judge(
            f"C2 (Round Robin, {where})",
            f"Round Robin is the lower bound in the {where}",
            "reward per slot minus that of the worst learner",
            below,
            "<=",
            0.0,
            figure,
        ),
    ]


def source_claims(data: xr.Dataset, tolerance: float = TOLERANCE) -> list[Judgement]:
    """C1 and the source's part of C2, from the results of Fig. 5(a).

    The statements are about what happens after episodes 200 and 400; a shorter run leaves them undecided, without a
    value. Another `tolerance` shows how far verdicts depend on it.
    """
    ddqn = gaps(data, "ddqn")
    return [
        judge(
            "C1 (reached)",
            "DDQN has reached the optimal policy after about 200 episodes",
            "mean gap in episodes 201 to 400",
            _mean(ddqn[:, 200:400]),
            "<=",
            tolerance,
            "5a",
        ),
        judge(
            "C1 (stable)",
            "DDQN is stable at the optimal policy after 400 episodes",
            "mean gap after episode 400",
            _mean(ddqn[:, 400:]),
            "<=",
            tolerance,
            "5a",
        ),
        *_reference_claims(data, "source", "5a", tolerance),
    ]


def _roughness(data: xr.Dataset, algorithm: str, point: int = 0) -> np.ndarray:
    """Standard deviation of the change of reward from one to the next of the first episodes, [seeds]."""
    reward = data["reward"].sel(algorithm=algorithm).isel(point=point, episode=slice(_EARLY))
    return np.diff(reward.transpose("seed", "episode").values, axis=1).std(axis=1)


def target_claims(data: xr.Dataset) -> list[Judgement]:
    """C3, C4 and the target's part of C2, from the results of Fig. 5(b)."""
    converged = {name: convergence_episode(data, name) for name in ("tlwd", "dpr", "ddqn")}
    early = {name: first(data, "reward", name, _EARLY)[:, 0] for name in ("tlwd", "dpr")}
    return [
        *_reference_claims(data, "target", "5b", TOLERANCE),
        *(
            judge(
                f"C3 ({label})",
                f"{label} converges faster than DDQN",
                f"DDQN's convergence episode minus that of {label}",
                converged["ddqn"] - converged[name],
                ">=",
                0.0,
                "5b",
            )
            for name, label in (("tlwd", "TLwD"), ("dpr", "DPR"))
        ),
        *(
            judge(
                f"C3 ({label}, much)",
                f"{label} converges much faster than DDQN",
                f"DDQN's mean convergence episode over that of {label}",
                np.stack([converged["ddqn"], converged[name]], axis=1),
                ">=",
                2.0,
                "5b",
                lambda means: means[0] / means[1],
                least=0.0,
            )
            for name, label in (("tlwd", "TLwD"), ("dpr", "DPR"))
        ),
        *(
            judge(
                f"C3 ({label}, episode 100)",
                f"{label} has converged from about episode 100",
                f"convergence episode of {label}",
                converged[name],
                "<=",
                120.0,
                "5b",
                least=1.0,
            )
            for name, label in (("tlwd", "TLwD"), ("dpr", "DPR"))
        ),
        judge(
            "C4 (reward)",
            "TLwD earns more than DPR in the first 100 episodes",
            "reward per slot in episodes 1 to 100, TLwD minus DPR",
            early["tlwd"] - early["dpr"],
            ">=",
            0.0,
            "5b",
        ),
        judge(
            "C4 (steadiness)",
            "TLwD is steadier than DPR in the first 100 episodes",
            "deviation of the reward's change between episodes, TLwD minus DPR",
            _roughness(data, "tlwd") - _roughness(data, "dpr"),
            "<=",
            0.0,
            "5b",
        ),
    ]


def replay_claims(data: xr.Dataset) -> list[Judgement]:
    """C15, from the results of Fig. 9; point 0 is prioritised, point 1 uniform."""
    converged = [convergence_episode(data, "tlwd", point) for point in (0, 1)]
    early = first(data, "reward", "tlwd", _EARLY)
    return [
        judge(
            "C15 (episodes)",
            "prioritised replay converges faster than uniform sampling",
            "convergence episode, uniform minus prioritised",
            converged[1] - converged[0],
            ">=",
            0.0,
            "9",
        ),
        judge(
            "C15 (reward)",
            "prioritised replay earns more at first",
            "reward per slot in episodes 1 to 100, prioritised minus uniform",
            early[:, 0] - early[:, 1],
            ">=",
            0.0,
            "9",
        ),
    ]
