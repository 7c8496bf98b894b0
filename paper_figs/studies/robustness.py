"""What many seeds show that few hide: distributions, rankings, and what a study with n seeds would have concluded."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figs.analysis import divergence, ranking, regret
from paper_figs.analysis.convergence import TOLERANCE, episodes_before, gaps, sample_complexity
from paper_figs.analysis.intervals import interquartile_mean, probability_of_improvement, proportion_effect
from paper_figs.analysis.scores import mean_over_episodes
from paper_figs.analysis.statistics import CONFIDENCE, mean_over_seeds
from paper_figs.plots import style

STUDY_SIZES = (1, 3, 5, 10, 30, 100)
"""Seeds of the smaller studies that are drawn from the whole."""
_EARLY = 100
_RIVALS = ("tlwd", "dpr", "ddqn", "q_learning")


class Score(NamedTuple):
    """One number per seed by which learners are ranked."""

    of: Callable[[xr.Dataset, str], np.ndarray]
    """(results, algorithm) to [seeds]."""
    sign: int
    """1 if more is better, else -1."""


SCORES: dict[str, Score] = {
    "reward": Score(lambda data, name: mean_over_episodes(data, "reward", name)[:, 0], 1),
    f"reward of the first {_EARLY} episodes": Score(
        lambda data, name: mean_over_episodes(data, "reward", name, _EARLY)[:, 0], 1
    ),
    "throughput": Score(lambda data, name: mean_over_episodes(data, "throughput", name)[:, 0], 1),
    "miss_detection": Score(lambda data, name: mean_over_episodes(data, "miss_detection", name)[:, 0], -1),
    "exact gap of the last 100 episodes": Score(lambda data, name: gaps(data, name)[:, -_EARLY:].mean(axis=1), -1),
    "episodes before convergence": Score(episodes_before, -1),
}


def _distribution(values: np.ndarray) -> dict[str, float]:
    mean = mean_over_seeds(values)
    row = {"mean": mean.mean, "mean_low": mean.low, "mean_high": mean.high, "deviation": values.std()}
    middle = interquartile_mean(values)
    row |= {
        "interquartile_mean": middle.value,
        "interquartile_mean_low": middle.low,
        "interquartile_mean_high": middle.high,
    }
    quantiles = np.quantile(values, (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0))
    names = ("minimum", "q05", "q25", "median", "q75", "q95", "maximum")
    return {name: float(v) for name, v in (row | dict(zip(names, quantiles, strict=True))).items()}


def distributions(data: xr.Dataset, environment: str) -> pd.DataFrame:
    """The distribution over seeds of each score of each learner; intervals of mean and inter-quartile mean at 95 %."""
    rows = []
    for label, score in SCORES.items():
        for name in data["algorithm"].values:
            values = score.of(data, name)
            row = {"environment": environment, "score": label, "algorithm": name, "n_seeds": len(values)}
            rows.append(row | {"n_diverged": divergence.count(data, name)} | _distribution(values))
    return pd.DataFrame(rows)


def improvements(data: xr.Dataset, environment: str) -> pd.DataFrame:
    """Probability that a run of one learner is better than an independent run of another, ties counting half.

    Runs with the same seed are not compared.
    """
    rows = []
    for label, score in SCORES.items():
        of = {name: score.sign * score.of(data, name) for name in data["algorithm"].values}
        for a, b in itertools.combinations(of, 2):
            value, low, high = probability_of_improvement(of[a], of[b])
            rows.append((environment, label, a, b, value, low, high, len(of[a])))
    columns = ["environment", "score", "algorithm", "other", "probability", "low", "high", "n_seeds"]
    return pd.DataFrame(rows, columns=columns)


def misrankings(data: xr.Dataset, environment: str) -> pd.DataFrame:
    """How often smaller studies rank the learners (all but Round Robin) differently than the whole."""
    names = [name for name in _RIVALS if name in data["algorithm"].values]
    seeds = data.sizes["seed"]
    rows = []
    for label, score in SCORES.items():
        scores = np.stack([score.of(data, name) for name in names])
        for n in (n for n in STUDY_SIZES if 3 * n <= seeds):  # larger ones are too much like the whole
            rows.append((environment, label, n, ranking.misranking(scores, n), seeds))
    return pd.DataFrame(rows, columns=["environment", "score", "study_seeds", "misranking", "n_seeds"])


def profiles(data: xr.Dataset, environment: str) -> pd.DataFrame:
    """Performance profiles: the share of seeds whose policy ends within a gap of the optimum, and when it got there."""
    rows = []
    for name in data["algorithm"].values:
        late = SCORES["exact gap of the last 100 episodes"].of(data, name)
        grid = np.round(np.linspace(0.0, 0.3, 61), 3)
        share = proportion_effect((late[:, None] <= grid).sum(axis=0), len(late))
        rows += [(environment, "gap", name, *row, len(late)) for row in zip(grid, *share, strict=True)]
        sample = sample_complexity(data, name)
        steps = [*zip(sample.episodes, *sample.share, strict=True), (data.sizes["episode"], *sample.reached)]
        rows += [(environment, "converged", name, *row, len(late)) for row in steps]
    return pd.DataFrame(rows, columns=["environment", "profile", "algorithm", "x", "share", "low", "high", "n_seeds"])


def tables(environments: dict[str, xr.Dataset], slots: int) -> dict[str, pd.DataFrame]:
    """All tables of a study, by name; each has a column with the environment."""
    makers = {
        "distribution": distributions,
        "improvement": improvements,
        "misranking": misrankings,
        "profile": profiles,
        "regret": functools.partial(regret.table, slots=slots),
        "seeds_needed": ranking.needed_table,
    }
    return {
        name: pd.concat([make(data, environment) for environment, data in environments.items()], ignore_index=True)
        for name, make in makers.items()
    }


@style.styled
def draw(found: dict[str, pd.DataFrame]) -> Figure:
    """One row per environment: how good policies end, how soon they are good, and what few seeds would have said."""
    profile, wrong = found["profile"], found["misranking"]
    environments = list(dict.fromkeys(profile.environment))
    figure = Figure(figsize=(style.TWO_COLUMNS[0], 2.1 * len(environments) + 0.5))
    rows = figure.subplots(len(environments), 3, squeeze=False)
    for (final, soon, misled), environment in zip(rows, environments, strict=True):
        here = profile.query(f"environment == {environment!r}")
        _draw_shares(final, here.query("profile == 'gap'"), 100)
        final.axvline(100 * TOLERANCE, color="0.6", linewidth=0.8, linestyle=":")
        final.set_xlabel("gap to the optimum, last 100 episodes (%)")
        final.set_ylabel(f"{environment}\nshare of seeds")
        _draw_shares(soon, here.query("profile == 'converged'"), 1)
        soon.set_xlabel(f"episodes until within {100 * TOLERANCE:.0f} % of the optimum")
        soon.set_xscale("log")
        _draw_misrankings(misled, wrong.query(f"environment == {environment!r}"))
    rows[0, 2].legend(title="ranked by", fontsize=6, title_fontsize=6)
    handles = {h.get_label(): h for panel in rows[:, 0] for h in panel.get_lines() if not h.get_label().startswith("_")}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=6)
    seeds = int(profile.n_seeds.max())
    figure.suptitle(f"What {seeds} seeds show (bands: 95 % intervals), and how often fewer mislead")
    return figure


def _draw_shares(axes: Axes, profile: pd.DataFrame, scale: float) -> None:
    """Shares of seeds against x, a step function per learner; Round Robin's would be zero."""
    for name in _RIVALS:
        curve, look = profile.query(f"algorithm == {name!r}"), style.LOOKS[name]
        if curve.empty:
            continue
        line: dict[str, Any] = {"color": look.color, "label": look.label, "marker": look.marker, "markevery": 0.2}
        axes.step(scale * curve.x, curve.share, where="post", **line)
        axes.fill_between(scale * curve.x, curve.low, curve.high, step="post", color=look.color, alpha=0.2, linewidth=0)
    axes.set_ylim(-0.02, 1.02)
    axes.set_ylabel("share of seeds")


def _draw_misrankings(axes: Axes, wrong: pd.DataFrame) -> None:
    """How often studies of n seeds rank the learners differently, by what they are ranked by."""
    looks = {"reward": "-o", "throughput": "--s", "miss_detection": "-.^", "episodes before convergence": ":D"}
    for score, look in looks.items():
        curve = wrong.query(f"score == {score!r}")
        axes.plot(curve.study_seeds, curve.misranking, look, color="black", label=score.replace("_", " "))
    axes.axhline(1 - CONFIDENCE, color="0.6", linewidth=0.8, linestyle=":")
    axes.set_xscale("log")
    sizes = sorted(set(wrong.study_seeds))
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.minorticks_off()
    axes.set_ylim(-0.02, 1.02)
    axes.set_xlabel("seeds of a study")
    axes.set_ylabel("ranks learners wrongly")
