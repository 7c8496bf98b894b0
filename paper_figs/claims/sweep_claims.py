"""What the paper says of its parameter sweeps, Figs. 6 to 8: claims C5 to C14."""

from __future__ import annotations

import numpy as np
import xarray as xr

from paper_figs.analysis.convergence import convergence_episode
from paper_figs.claims.judge import Judgement, first, judge

_LABELS = {"tlwd": "TLwD", "dpr": "DPR", "ddqn": "DDQN"}


def _all(data: xr.Dataset, metric: str) -> dict[str, np.ndarray]:
    """Means over all episodes by algorithm, [seeds, points] each."""
    return {name: first(data, metric, name) for name in _LABELS}


def _at(data: xr.Dataset, x_name: str, x: float) -> int:
    """Number of the point with this value."""
    return int(np.abs(data[x_name].values - x).argmin())


def _average(means: np.ndarray) -> np.ndarray:
    """Over all axes but the last, which counts resamples."""
    return means.reshape(-1, means.shape[-1]).mean(axis=0)


def _reduction(means: np.ndarray) -> np.ndarray:
    """1 - a / b at each point, of means [2, points, n] of a and b."""
    return 1.0 - means[0] / means[1]


def _highest_reward(claim: str, reward: dict[str, np.ndarray], over: str, figure: str) -> Judgement:
    lead = np.stack([reward["tlwd"] - reward["dpr"], reward["tlwd"] - reward["ddqn"]], axis=1)
    return judge(
        claim,
        "TLwD's reward is higher than DPR's and DDQN's at every point",
        f"smallest lead over either, over {over}",
        lead,
        ">=",
        0.0,
        figure,
        extreme=np.min,
    )


def _up_to(claim: str, paper: float, over: str, miss: dict[str, np.ndarray], other: str, figure: str) -> Judgement:
    return judge(
        claim,
        f"TLwD lowers miss detection by up to {paper:.0%} against {_LABELS[other]}",
        f"largest relative reduction over {over}",
        np.stack([miss["tlwd"], miss[other]], axis=1),
        ">=",
        paper,
        figure,
        _reduction,
        np.max,
    )


def speed_claims(data: xr.Dataset) -> list[Judgement]:
    """C5 to C9, from the results of Fig. 6."""
    reward, packets, miss = (_all(data, metric) for metric in ("reward", "throughput", "miss_detection"))
    at = lambda x: _at(data, "high_speed_event_probability", x)  # noqa: E731
    converged = {name: convergence_episode(data, name, at(0.8)) for name in _LABELS}

    def extreme(metric, name, sign):
        others = [values for other, values in metric.items() if other != name]
        return np.stack([sign * (metric[name] - other).mean(axis=1) for other in others], axis=1)

    return [
        _highest_reward("C5 (highest)", reward, "p_1^v", "6a"),
        *(
            judge(
                f"C5 (rise, {_LABELS[name]})",
                f"{_LABELS[name]}'s reward rises with p_1^v",
                "reward at 0.9 minus reward at 0.1",
                reward[name][:, at(0.9)] - reward[name][:, at(0.1)],
                ">=",
                0.0,
                "6a",
            )
            for name in ("tlwd", "dpr")
        ),
        judge(
            "C6",
            "DDQN's reward falls significantly from p_1^v = 0.6 to 0.9",
            "reward at 0.9 minus reward at 0.6",
            reward["ddqn"][:, at(0.9)] - reward["ddqn"][:, at(0.6)],
            "<=",
            0.0,
            "6a",
        ),
        judge(
            "C7 (DDQN)",
            "at p_1^v = 0.8 DDQN needs about 400 episodes",
            "convergence episode",
            converged["ddqn"],
            ">=",
            300.0,
            "6a",
            least=1.0,
        ),
        *(
            judge(
                f"C7 ({_LABELS[name]})",
                f"at p_1^v = 0.8 {_LABELS[name]} needs about 150 episodes",
                "convergence episode",
                converged[name],
                "<=",
                200.0,
                "6a",
                least=1.0,
            )
            for name in ("tlwd", "dpr")
        ),
        *(
            judge(
                f"C8 ({label}, {_LABELS[name]})",
                f"{_LABELS[name]} has the {'highest' if sign > 0 else 'lowest'} {label}",
                "distance to the nearer of the others, mean over p_1^v",
                extreme(metric, name, sign),
                ">=",
                0.0,
                figure,
                extreme=np.min,
            )
            for label, metric, figure in (("throughput", packets, "6b"), ("miss detection", miss, "6c"))
            for name, sign in (("ddqn", 1.0), ("tlwd", -1.0))
        ),
        _up_to("C9", 0.67, "p_1^v", miss, "ddqn", "6c"),
    ]


def favourable_claims(data: xr.Dataset) -> list[Judgement]:
    """C10 to C12, from the results of Fig. 7."""
    reward = _all(data, "reward")
    at = lambda x: _at(data, "favourable_probability", x)  # noqa: E731
    falls = np.stack([values[:, at(0.9)] - values[:, at(0.1)] for values in reward.values()], axis=1)
    low = slice(0, at(0.7))
    rivals = np.stack([reward["ddqn"] - reward[name] for name in ("tlwd", "dpr")], axis=1)[:, :, at(0.9)]

    def jump(metric, name):
        values = first(data, metric, name)
        return values[:, at(0.9)] - values[:, at(0.6)]

    return [
        judge(
            "C10 (fall)",
            "all rewards fall as tau_0 rises",
            "largest of the three changes from 0.1 to 0.9",
            falls,
            "<=",
            0.0,
            "7a",
            extreme=np.max,
        ),
        judge(
            "C10 (DPR)",
            "TLwD's reward is slightly higher than DPR's below tau_0 = 0.7",
            "TLwD minus DPR, mean over tau_0 < 0.7",
            (reward["tlwd"] - reward["dpr"])[:, low],
            ">=",
            0.0,
            "7a",
            _average,
        ),
        judge(
            "C10 (DDQN)",
            "TLwD's reward is much higher than DDQN's below tau_0 = 0.7",
            "(TLwD - DDQN) / DDQN, mean over tau_0 < 0.7",
            np.stack([reward["tlwd"][:, low], reward["ddqn"][:, low]], axis=1),
            ">=",
            0.1,
            "7a",
            lambda means: _average(means[0] / means[1] - 1.0),
        ),
        judge(
            "C11",
            "at tau_0 = 0.9 DDQN's reward is the best of the three",
            "smaller lead over TLwD and DPR",
            rivals,
            ">=",
            0.0,
            "7a",
            extreme=np.min,
        ),
        *(
            judge(
                f"C12 ({label})",
                f"from tau_0 = 0.7 on DDQN's {label} jumps, those of TLwD and DPR hardly move",
                "rise from 0.6 to 0.9, DDQN's minus the larger of the others",
                np.stack([jump(metric, "ddqn") - jump(metric, name) for name in ("tlwd", "dpr")], axis=1),
                ">=",
                0.0,
                figure,
                extreme=np.min,
            )
            for label, metric, figure in (
                ("throughput", "throughput", "7b"),
                ("miss detection", "miss_detection", "7c"),
            )
        ),
    ]


def density_claims(data: xr.Dataset) -> list[Judgement]:
    """C13 and C14, from the results of Fig. 8."""
    reward, miss = _all(data, "reward"), _all(data, "miss_detection")
    change = lambda metric: np.stack([values[:, -1] - values[:, 0] for values in metric.values()], axis=1)  # noqa: E731
    return [
        judge(
            "C13 (reward)",
            "all rewards fall as omega goes from 8 to 40",
            "largest of the three changes",
            change(reward),
            "<=",
            0.0,
            "8a",
            extreme=np.max,
        ),
        judge(
            "C13 (miss detection)",
            "all miss-detection probabilities rise as omega goes from 8 to 40",
            "smallest of the three changes",
            change(miss),
            ">=",
            0.0,
            "8c",
            extreme=np.min,
        ),
        _highest_reward("C13 (highest)", reward, "omega", "8a"),
        _up_to("C14 (DPR)", 0.22, "omega", miss, "dpr", "8c"),
        _up_to("C14 (DDQN)", 0.61, "omega", miss, "ddqn", "8c"),
    ]
