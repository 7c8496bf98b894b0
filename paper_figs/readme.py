"""The parts of texts that are made from published results: tables of verdicts, and sentences with numbers.

A text marks them, `<!-- made by python -m paper_figs.publish: NAME -->` to `<!-- end of NAME -->`, where NAME is one of
`BLOCKS`. What stands between is replaced by `renewed`, so no number in a text can differ from the results it quotes.
"""

from __future__ import annotations

import functools
import json
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from paper_figs import mechanisms_text, readings_text, reconstruction_text, trade_off_text, verdicts_text
from paper_figs.claims import words
from paper_figs.claims.judge import VERDICTS, Judgement, from_json
from paper_figs.claims.learning_table import LABELS
from paper_figs.claims.table import TITLES, number_of
from paper_figs.markdown import listed, percent, table, wrapped
from paper_figs.published import FIGURES

ROBUSTNESS, CALIBRATION = "robustness", "calibration"
"""Folders of published results: of the robustness study, and of `paper_figs.calibration`."""
_BEGIN = "<!-- made by python -m paper_figs.publish: {name} -->"
_END = "<!-- end of {name} -->"
_ROBUSTNESS_COMMAND = ".venv/bin/python -m sweeps run robustness"
_ANY = re.compile(r"<!-- made by python -m paper_figs\.publish: (\S+) -->\n(.*?)<!-- end of \1 -->", re.DOTALL)


def renewed(text: str, published: Path) -> str:
    """The text with all of its marked parts made anew.

    Args:
      text: of a Markdown file.
      published: folder of published results.

    Raises:
      ValueError: for a name that is not one of `BLOCKS`.
    """

    def made(match: re.Match) -> str:
        name = match[1]
        if name not in BLOCKS:
            raise ValueError(f"block: {name!r}; allowed: {', '.join(BLOCKS)}")
        return f"{_BEGIN.format(name=name)}\n{BLOCKS[name](published)}\n{_END.format(name=name)}"

    return _ANY.sub(made, text)


def judgements(published: Path) -> list[Judgement]:
    """The published verdicts."""
    return from_json(json.loads((published / FIGURES / "claims.json").read_text(encoding="utf-8")))


def _numbers(published: Path) -> dict[str, dict[str, Any]]:
    return json.loads((published / FIGURES / "numbers.json").read_text(encoding="utf-8"))


# --- verdicts ---------------------------------------------------------------------------------------------------------


def claims_table(found: list[Judgement], figure: str) -> str:
    """Verdicts that rest on one figure, "5a" or "6" with all its panels."""
    head = ("claim", "the paper's statement", "holds if", "measured (95 % interval)", "verdict")
    rows = [
        (j.claim, j.statement, words.criterion(j), words.measured(j), words.verdict(j))
        for j in found
        if j.figure.startswith(figure)
    ]
    return table(head, rows)


def _in_short(parts: list[Judgement]) -> str:
    """How many parts of a claim have which verdict: one word where all have the same."""
    counts = Counter(part.verdict for part in parts)
    if len(counts) == 1:
        return next(iter(counts))
    return ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])


def verdicts_table(published: Path) -> str:
    """One row per claim with the verdicts of its parts."""
    found = judgements(published)
    rows = []
    for number, title in TITLES.items():
        parts = [j for j in found if number_of(j.claim) == number]
        rows.append((number, title, _in_short(parts)))
    return table(("", "the paper says", f"here ({found[0].n_seeds} seeds)"), rows)


def supported_list(published: Path) -> str:
    """Which claims have which verdict, by name, and which differences are negligible."""
    found = judgements(published)
    sentences = [
        f"**{verdict.capitalize()}** ({len(named)} of {len(found)}): {'; '.join(named) or 'none'}."
        for verdict in VERDICTS
        for named in [[j.claim for j in found if j.verdict == verdict]]
    ]
    same = [j.claim for j in found if j.negligible]
    sentences.append(f"**Negligible differences**, interval included: {'; '.join(same) or 'none'}.")
    return listed(sentences)


# --- sentences --------------------------------------------------------------------------------------------------------


def _gaps_of(numbers: dict[str, Any], when: str, names: tuple[str, ...]) -> str:
    return ", ".join(f"{LABELS[name]} {percent(numbers[f'{when}_gap_{name}'])}" for name in names)


def source_list(published: Path) -> str:
    """What else is to be said of Fig. 5(a)."""
    n, names = _numbers(published)["fig5a"], ("ddqn", "q_learning")
    tolerances = ", ".join(
        f"at {percent(t)} C1 (reached) is {n[f'c1_at_{t:g}']} and C2 (Q-learning, source) {n[f'c2_at_{t:g}']}"
        for t in (0.01, 0.03, 0.05)
    )
    constant = (
        f"The best action that ignores the state earns {n['constant']:g} per slot, {percent(n['constant_gap'])} below "
        f"the optimum of {n['optimum']:g}, which transmits in {n['states_that_transmit']:g} of the 32 states."
    )
    explored = f"With the last random actions left in, the optimal policy earns {n['explored']:g}."
    early, late = (_gaps_of(n, when, names) for when in ("early", "late"))
    of_learners = f"Mean gaps in episodes 51 to 100: {early}; after episode 400: {late}."
    verdicts = f"The verdicts depend on the gap that counts as optimal: {tolerances}."
    noisy = (
        f"A single snapshot is noisy: values are near {n['mean_value']:g} and their differences some units. "
        f"{percent(n['snapshots_beyond'])} of DDQN's snapshots after episode 400 are more than 5 % below the optimum."
    )
    return listed([constant, explored, of_learners, verdicts, noisy])


def target_list(published: Path) -> str:
    """What else is to be said of Fig. 5(b)."""
    n, names = _numbers(published)["fig5b"], ("tlwd", "dpr", "ddqn", "q_learning")
    sent = ", ".join(f"{LABELS[name]} {n[f'packets_{name}']:.3g}" for name in names)
    missed = ", ".join(f"{LABELS[name]} {n[f'miss_{name}']:.3g}" for name in names)
    of_learners = (
        f"Mean gaps after the first episode: {_gaps_of(n, 'first', names)}; in episodes 51 to 100: "
        f"{_gaps_of(n, 'early', names)}; after episode 400: {_gaps_of(n, 'late', names)}."
    )
    constant = f"The best action that ignores the state has a gap of {percent(n['constant_gap'])}."
    return listed([of_learners, constant, f"Packets per episode: {sent}. Miss detection: {missed}."])


def points_list(figure: str, published: Path) -> str:
    """What else is to be said of one of Figs. 6 to 8, from its plotted numbers."""
    plotted = pd.read_csv(published / FIGURES / f"{figure}.csv")
    reward, miss = (
        plotted[plotted.panel == panel].pivot_table(index="x", columns="algorithm", values="mean") for panel in "ac"
    )
    rivals = reward[["tlwd", "dpr", "ddqn"]]
    best, worst = (Counter(rivals.columns[place(rivals.to_numpy(), axis=1)]) for place in (np.argmax, np.argmin))
    ranks = "; ".join(f"{LABELS[name]} at {best[name]} and {worst[name]}" for name in ("tlwd", "dpr", "ddqn"))
    lead = (reward.tlwd - reward[["dpr", "ddqn"]].max(axis=1)) / reward.optimum.abs()
    sentences = [
        f"Points of {len(rivals)} at which the mean reward is the highest and the lowest: {ranks}.",
        f"TLwD's lead over the better of the others lies between {percent(lead.min())} and {percent(lead.max())} "
        "of the optimum.",
        f"The best policy that ignores the state misses at most {percent((1 - miss.constant / miss.ddqn).max())} less "
        "than DDQN at any point.",
    ]
    return listed(sentences)


def headline(published: Path) -> str:
    """The first page's sentences on the default reading."""
    found = {j.claim: j for j in judgements(published)}
    numbers, verdict = _numbers(published)["fig5b"], {claim: words.verdict(j) for claim, j in found.items()}
    counts = Counter(j.verdict for j in found.values())
    tally = ", ".join(f"{counts[each]} {'is' if counts[each] == 1 else 'are'} {each}" for each in VERDICTS)
    text = (
        f"Of the {len(found)} statements that the paper's claims come down to, {tally} under the default reading. "
        f"That TLwD converges faster than DDQN is {verdict['C3 (TLwD)']}; that it earns most at every point of Fig. 6 "
        f"is {verdict['C5 (highest)']}, of Fig. 8 {verdict['C13 (highest)']}. After episode 400 the policies in the "
        f"target are below the exact optimum by: {_gaps_of(numbers, 'late', ('tlwd', 'dpr', 'ddqn'))}."
    )
    return wrapped(text)[2:].replace("\n  ", "\n")


def robustness_list(published: Path) -> str:
    """What many seeds say of the target."""
    folder = published / ROBUSTNESS
    regret, wrong = (pd.read_csv(folder / f"{name}.csv") for name in ("regret", "misranking"))
    better = pd.read_csv(folder / "improvement.csv").query("environment == 'target' and score == 'reward'")
    target = regret.query("figure == 'target'").set_index("algorithm")
    lost = ", ".join(
        f"{LABELS[name]} {target.regret[name]:.2f} ({target.regret_low[name]:.2f} to {target.regret_high[name]:.2f})"
        for name in ("tlwd", "dpr", "ddqn")
    )
    pairs = better.set_index(["algorithm", "other"])
    wins = ", ".join(
        f"{LABELS[a]} over {LABELS[b]} {percent(row.probability)} ({100 * row.low:.3g} to {100 * row.high:.3g})"
        for a, b in (("tlwd", "ddqn"), ("dpr", "ddqn"))
        for row in [pairs.loc[(a, b)]]
    )
    by_reward = wrong.query("environment == 'target' and score == 'reward'").set_index("study_seeds").misranking
    misled = ", ".join(f"{n} {'seeds' if n > 1 else 'seed'} {percent(by_reward[n])}" for n in by_reward.index)
    reached = ", ".join(f"{LABELS[name]} {percent(target.reached[name])}" for name in ("tlwd", "dpr", "ddqn"))
    stays = "median_episodes_low" in target  # tables of older versions count runs that leave again
    number = int(target.n_seeds.max())
    command = f"`{_ROBUSTNESS_COMMAND} --seeds {number}`"
    return f"{number} seeds ([tables](published/robustness)) of the target ({command}) say:\n\n" + listed(
        [
            *([f"Runs that get within 5 % of the optimum and stay there: {reached}."] if stays else []),
            f"Exact regret per slot of the last policy: {lost}.",
            f"Probability that a run earns more than another learner's: {wins}.",
            f"How often a smaller study ranks the four learners by reward differently than all seeds: {misled}.",
        ]
    )


def calibration_list(published: Path) -> str:
    """How frequent false verdicts are in simulated studies, and where they are more frequent than they should be."""
    rows = pd.read_csv(published / CALIBRATION / "calibration.csv", keep_default_na=False).query("what != 'verdicts'")
    rows = rows.assign(false=rows[["false_supported", "false_contradicted"]].max(axis=1))
    inside, wide, beyond = (
        rows.query("out_of_reach == 0"),
        rows.query("what == 'coverage'"),
        rows.query("what == 'errors'"),
    )
    sentences = [
        f"In {len(inside)} of {len(rows)} rows (a rule, a world, a number of seeds) false verdicts of a kind come in "
        f"at most {percent(inside.false.max())} of studies, and intervals hold the truth in "
        f"{percent(inside.coverage.min())} to {percent(inside.coverage.max())}.",
        f"In {len(wide)} rows intervals are wider than they need be; false verdicts come in at most "
        f"{percent(wide.false.max())}.",
    ]
    for rule, world in dict.fromkeys(zip(beyond.rule, beyond.world, strict=True)):
        here = beyond[(beyond.rule == rule) & (beyond.world == world)]
        worst = ", ".join(f"{n} seeds {percent(false)}" for n, false in zip(here.n_seeds, here.false, strict=True))
        since = f"in reach from {here.in_reach_from.iloc[0]} seeds"
        sentences.append(f"Out of reach: {rule}, {world}: {worst}; {here.reason.iloc[0]}; {since}.")
    return listed(sentences)


BLOCKS: dict[str, Callable[[Path], str]] = {
    "headline": headline,
    "verdicts": verdicts_table,
    "supported": supported_list,
    **{
        f"claims-{figure}": lambda published, figure=figure: claims_table(judgements(published), figure)
        for figure in ("5a", "5b", "6", "7", "8", "9")
    },
    "source": source_list,
    "target": target_list,
    **{figure: functools.partial(points_list, figure) for figure in ("fig6", "fig7", "fig8")},
    "robustness": robustness_list,
    "calibration": calibration_list,
    **readings_text.BLOCKS,
    **verdicts_text.BLOCKS,
    **mechanisms_text.BLOCKS,
    **reconstruction_text.BLOCKS,
    **trade_off_text.BLOCKS,
}
"""Name of a marked part to what makes it from the folder of published results."""
