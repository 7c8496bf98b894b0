"""All claims of the paper as data, and their judgements from any results that hold some of its points."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from paper_figs.claims.judge import Claim, Judgement, judge, missing
from paper_figs.claims.learning_table import LEARNING_CLAIMS
from paper_figs.claims.results import AXES, Results, Rules
from paper_figs.claims.sweep_table import SWEEP_CLAIMS

TITLES = {
    "C1": "in the source DDQN reaches the optimal policy, after about 200 episodes, and is stable after 400",
    "C2": "Q-learning does not reach the optimal policy in source or target; Round Robin is the lower bound",
    "C3": "TLwD and DPR converge much faster than DDQN, from about episode 100",
    "C4": "TLwD earns more than DPR in the first 100 episodes, and more steadily",
    "C5": "over p_1^v TLwD's reward beats DPR's and DDQN's at every point; TLwD's and DPR's rise",
    "C6": "DDQN's reward falls from p_1^v = 0.6 to 0.9",
    "C7": "at p_1^v = 0.8 DDQN needs about 400 episodes, TLwD and DPR about 150",
    "C8": "DDQN has the highest throughput and miss detection, TLwD the lowest",
    "C9": "TLwD lowers miss detection by up to 67 % against DDQN",
    "C10": "rewards fall with tau_0; below 0.7 TLwD is slightly above DPR and far above DDQN",
    "C11": "at tau_0 = 0.9 DDQN's reward is the best",
    "C12": "from tau_0 = 0.7 on DDQN's throughput and miss detection jump, the others' hardly move",
    "C13": "rewards fall and miss detection rises with omega; TLwD's reward is always the highest",
    "C14": "over omega TLwD lowers miss detection by up to 22 % against DPR and 61 % against DDQN",
    "C15": "prioritised replay converges faster than uniform sampling",
}
"""What the parts of each number say together."""


def number_of(claim: str) -> str:
    """The number of a claim without its part: "C3" of "C3 (TLwD, much)"."""
    return claim.split(" ")[0]


def _in_order(claims: tuple[Claim, ...]) -> tuple[Claim, ...]:
    return tuple(sorted(claims, key=lambda claim: int(number_of(claim.claim).removeprefix("C"))))


CLAIMS = _in_order((*LEARNING_CLAIMS, *SWEEP_CLAIMS))
"""Every claim, in the order of the numbers."""


def claims_of_figure(figure: str, data: xr.Dataset, rules: Rules | None = None) -> list[Judgement]:
    """The judgements of all claims that rest on one figure.

    A claim that needs a point, a learner or an episode that is not there stays undecided and says so.

    Args:
      figure: "fig5a" to "fig9".
      data: its results; the points are found by their coordinate (see `AXES`), in any order.
      rules: what verdicts depend on; the defaults if None.
    """
    results = Results(data, AXES.get(figure), rules or Rules())
    return [judge(claim, results) for claim in CLAIMS if claim.sweep == figure]


def claims_of(figures: Mapping[str, xr.Dataset], rules: Rules | None = None) -> list[Judgement]:
    """The judgements of all claims, in their order; those of figures without results are undecided.

    Args:
      figures: "fig5a" to "fig9" to results at all of a figure's points, or at some.
      rules: what verdicts depend on; the defaults if None.
    """
    found = {j.claim: j for figure, data in figures.items() for j in claims_of_figure(figure, data, rules)}
    return [found.get(claim.claim) or missing(claim) for claim in CLAIMS]
