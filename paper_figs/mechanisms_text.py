"""The parts of texts made from published sweeps that show why a reading decides: all else in them is as by default."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from paper_figs.claims import words
from paper_figs.claims.learning_table import LABELS
from paper_figs.markdown import listed, paragraph, percent, table
from paper_figs.plots import style
from paper_figs.published import csv_of, short

HUBER = "huber"
"""The published sweep of the Huber loss."""
STEP_SIZE = "step_size"
"""The published grid of step sizes and p_1^v."""
_RATE, _FAST = "hparams.learning_rate", "env.speed.event_probability.high"
_AT = 0.8  # value of p_1^v at which the paper counts episodes
_LEARNERS = ("ddqn", "dpr", "tlwd")


def huber_list(published: Path) -> str:
    """What the Huber loss does to the learners of the target, by where it turns linear."""
    means = csv_of(published, HUBER, HUBER).pivot_table(index=["x", "algorithm"], columns="panel", values="mean")

    def what_of(name: str, x: float) -> str:
        reward, packets, missed = means.loc[(x, name)]
        return f"{short(reward)} per slot, {short(packets)} packets per episode, miss detection {percent(missed)}"

    deltas = means.index.get_level_values("x").to_numpy(float)
    first, last = float(deltas.min()), float(deltas.max())
    sentences = []
    for x in (first, last):
        learners = (f"{style.LOOKS[name].label} {what_of(name, x)}" for name in _LEARNERS)
        sentences.append(f"delta = {x:g}: {'; '.join(learners)}.")
    explored = short(means.loc[(first, "explored")].iloc[0])
    optimum = f"The optimal policy: {what_of('optimum', first)}; with the learners' exploration {explored}."
    return listed([*sentences, optimum])


def step_sizes_table(published: Path) -> str:
    """One row per step size, at p_1^v = 0.8: when policies converge, TLwD's leads, how often significant."""
    rows = []
    for rate, (here, leads) in _by_step_size(published).items():
        cells = [f"{words.number(here.loc[n, 'median'])} ({percent(here.loc[n, 'reached'])})" for n in _LEARNERS]
        cells += [_lead_at(leads[n]) for n in leads]
        rows.append((f"{rate:.3g}", *cells))
    head = (*(f"{LABELS[n]} converges in" for n in _LEARNERS), "TLwD's lead over DDQN", "over DPR")
    return f"{table(('step size', *head), rows)}\n\n{paragraph(_step_sizes_in_words(published) + '.')}"


def _lead_at(leads: pd.DataFrame) -> str:
    """A lead at p_1^v = 0.8, and at how many values of p_1^v it is significant, on either side."""
    (at,) = leads.loc[np.isclose(leads[_FAST], _AT)].to_dict("records")
    more, less = (leads.ci_low > 0).sum(), (leads.ci_high < 0).sum()
    return f"{at['lead']:.2f} ({at['ci_low']:.2f} to {at['ci_high']:.2f}); +{more} -{less} of {len(leads)}"


def step_sizes_in_short(published: Path) -> str:
    """With which step sizes TLwD earns more than Double DQN, and when Double DQN converges, for the first page."""
    return f"{_step_sizes_in_words(published)} ([why](docs/explanation/readings.md#why-small-steps))."


def _step_sizes_in_words(published: Path) -> str:
    grid = _by_step_size(published)
    leads = {f"{rate:.3g}": of["ddqn"] for rate, (_, of) in grid.items()}
    ahead = [rate for rate, lead in leads.items() if (lead.ci_low > 0).all()]
    behind = [rate for rate, lead in leads.items() if (lead.ci_high < 0).mean() > 0.5]
    ddqn = {f"{rate:.3g}": here.loc["ddqn"] for rate, (here, _) in grid.items()}
    in_all = {rate: f"{of['median']:.0f}" for rate, of in ddqn.items() if of["reached"] == 1}
    median = f" (median episode {', '.join(in_all.values())})" if in_all else ""
    others = [of["reached"] for of in ddqn.values() if of["reached"] < 1]
    ends = dict.fromkeys(map(percent, (min(others), max(others)))) if others else ()
    in_some = f", in {' to '.join(ends)} with the others" if ends else ""
    seeds = max(int(here.n_seeds.max()) for here, _ in grid.values())
    return (
        f"All else as by default ({seeds} seeds), TLwD earns more than DDQN at every p_1^v with step sizes of "
        f"{_or_none(ahead)}, less at most of them with {_or_none(behind)}; DDQN converges at p_1^v = {_AT} in all runs "
        f"with {_or_none([*in_all])}{median}{in_some}"
    )


def _or_none(items: list[str]) -> str:
    return ", ".join(items) or "none"


def _by_step_size(published: Path) -> dict[float, tuple[pd.DataFrame, dict[str, pd.DataFrame]]]:
    """By step size: when each learner converges at p_1^v = 0.8, and TLwD's leads at all values of p_1^v."""
    converged = csv_of(published, STEP_SIZE, f"{STEP_SIZE}-convergence")
    between = csv_of(published, STEP_SIZE, f"{STEP_SIZE}-differences").query("panel == 'a'")
    at = converged.loc[np.isclose(converged[_FAST], _AT)]
    return {
        float(rate): (of_rate.set_index("algorithm"), _leads(between.loc[between[_RATE] == rate]))
        for rate, of_rate in at.groupby(_RATE)
    }


def _leads(between: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """TLwD's lead in reward over each of the others at all values of p_1^v; tables hold the pair in either order."""
    turned = between.assign(
        algorithm=between.other,
        other=between.algorithm,
        mean=-between["mean"],
        ci_low=-between.ci_high,
        ci_high=-between.ci_low,
    )
    of_tlwd = pd.concat([between, turned]).query("algorithm == 'tlwd'").rename(columns={"mean": "lead"})
    return {other: of_tlwd.loc[of_tlwd.other == other] for other in ("ddqn", "dpr")}


BLOCKS: dict[str, Callable[[Path], str]] = {"huber": huber_list, "step_sizes": step_sizes_table}
"""Name of a marked part to what makes it from the folder of published results."""
