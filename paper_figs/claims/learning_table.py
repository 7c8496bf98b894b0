"""What the paper says of its learning curves, Figs. 5 and 9, and of convergence in Fig. 6: C1 to C4, C7 and C15.

What is said of convergence is judged twice: on the exact value of the policies, and on the curve that the paper shows,
exploration included (`with_curves`). "About" an episode is from half of it to one and a half.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator

from paper_figs.analysis.convergence import TOLERANCE
from paper_figs.claims.effects import (
    EarlierConvergence,
    EarlyLead,
    EveryLead,
    LateGap,
    Movement,
    Roughness,
    TypicalEpisode,
)
from paper_figs.claims.judge import Claim
from paper_figs.claims.results import Agent

LABELS = {"tlwd": "TLwD", "dpr": "DPR", "ddqn": "DDQN", "q_learning": "Q-learning", "round_robin": "Round Robin"}
MUCH_FASTER = 2.0
"""Who converges much faster needs less than half of the episodes."""
SETTLED = 400
"""Episode after which the paper calls the source agent's curve stable."""
PRIORITISED, UNIFORM = Agent("tlwd", 1.0), Agent("tlwd", 0.0)
TRANSFER, SWEEPS, REPLAY = "VII-B.1", "VII-B.2", "VII-B.3"
"""The paper's sections on Fig. 5, on Figs. 6 to 8, and on Fig. 9."""
_OF_OPTIMUM, _REWARD = "share of the optimum", "reward per slot"


def about(episode: float) -> tuple[float, float]:
    """The band of episodes that "about" this one stands for."""
    return 0.5 * episode, 1.5 * episode


def with_curves(claims: Iterable[Claim]) -> Iterator[Claim]:
    """Each claim, and behind those that are judged on exact policies their twins judged on curves."""
    for claim in claims:
        yield claim
        if hasattr(claim.measure, "curve"):
            yield dataclasses.replace(
                claim,
                claim=f"{claim.claim.removesuffix(')')}, curve)",
                effect=claim.effect.replace("policies", "curves"),
                measure=dataclasses.replace(claim.measure, curve=True),  # pyright: ignore[reportArgumentType]
            )


def _faster(claim: str, statement: str, figure: str, where: str, of: Agent, than: Agent) -> Claim:
    effect = "probability that its policies converge earlier, with the same seed"
    return Claim(claim, statement, figure, where, effect, EarlierConvergence(of, than), ">", 0.5, "probability")


def _much_faster(name: str) -> Claim:
    label, effect = LABELS[name], "probability that its policies need less than half of DDQN's episodes"
    measure = EarlierConvergence(Agent(name), Agent("ddqn"), MUCH_FASTER)
    statement = f"{label} converges much faster than DDQN"
    return Claim(f"C3 ({label}, much)", statement, "5b", TRANSFER, effect, measure, ">", 0.5, "probability")


def _needs_about(
    claim: str, statement: str, figure: str, where: str, name: str, episode: float, x: float | None = None
) -> Claim:
    effect, measure = "median episode in which its policies converge", TypicalEpisode(Agent(name, x))
    return Claim(claim, statement, figure, where, effect, measure, "within", about(episode), "episode")


def _fails(environment: str, figure: str) -> Claim:
    statement = f"Q-learning does not reach the optimal policy in the {environment}"
    effect, measure = f"mean gap of its policies after episode {SETTLED}", LateGap(Agent("q_learning"), SETTLED)
    claim = f"C2 (Q-learning, {environment})"
    return Claim(claim, statement, figure, TRANSFER, effect, measure, ">", TOLERANCE, _OF_OPTIMUM)


def _is_last(environment: str, figure: str, others: tuple[str, ...]) -> Claim:
    claim, statement = f"C2 (Round Robin, {environment})", f"Round Robin is the lower bound in the {environment}"
    measure = EveryLead("reward", "round_robin", others, sign=-1.0, at=0.0)
    return Claim(claim, statement, figure, TRANSFER, "smallest lead of the others", measure, ">", 0.0, _REWARD)


_TARGET_OTHERS = ("tlwd", "dpr", "ddqn", "q_learning")
# fmt: off
_SOURCE = (
    Claim("C1 (reached)", "DDQN reaches the optimal policy in the source", "5a", TRANSFER,
          f"mean gap of its policies after episode {SETTLED}", LateGap(Agent("ddqn"), SETTLED), "<", TOLERANCE, _OF_OPTIMUM),
    _needs_about("C1 (about 200)", "DDQN reaches it after about 200 episodes", "5a", TRANSFER, "ddqn", 200.0),
    Claim("C1 (stable)", "DDQN is stable after 400 episodes", "5a", TRANSFER,
          f"deviation of its policies' means over 20 episodes after episode {SETTLED}",
          Movement(Agent("ddqn"), SETTLED), "<", TOLERANCE, _OF_OPTIMUM),
    _fails("source", "5a"),
    _is_last("source", "5a", ("ddqn", "q_learning")),
)
_TARGET = (
    _fails("target", "5b"),
    _is_last("target", "5b", _TARGET_OTHERS),
    *(_faster(f"C3 ({LABELS[name]})", f"{LABELS[name]} converges faster than DDQN", "5b", TRANSFER, Agent(name), Agent("ddqn"))
      for name in ("tlwd", "dpr")),
    *(_much_faster(name) for name in ("tlwd", "dpr")),
    *(_needs_about(f"C3 ({LABELS[name]}, about 100)", f"{LABELS[name]} converges from about episode 100", "5b", TRANSFER, name, 100.0)
      for name in ("tlwd", "dpr")),
    Claim("C4 (reward)", "TLwD earns more than DPR in the first 100 episodes", "5b", TRANSFER,
          "reward of episodes 1 to 100, TLwD less DPR", EarlyLead(Agent("tlwd"), Agent("dpr")), ">", 0.0, _REWARD),
    Claim("C4 (steadiness)", "TLwD is steadier than DPR in the first 100 episodes", "5b", TRANSFER,
          "deviation of the reward's change between episodes, TLwD less DPR", Roughness("tlwd", "dpr"), "<", 0.0, _REWARD),
)
_AT = 0.8
"""Value of p_1^v at which the paper counts episodes."""
_HIGH_SPEED = (
    _needs_about("C7 (DDQN)", "at p_1^v = 0.8 DDQN needs about 400 episodes", "6a", SWEEPS, "ddqn", 400.0, _AT),
    *(_needs_about(f"C7 ({LABELS[name]})", f"at p_1^v = 0.8 {LABELS[name]} needs about 150 episodes", "6a", SWEEPS, name, 150.0, _AT)
      for name in ("tlwd", "dpr")),
)
_PRIORITISED = (
    _faster("C15 (episodes)", "prioritised replay converges faster than uniform sampling", "9", REPLAY, PRIORITISED, UNIFORM),
    Claim("C15 (reward)", "prioritised replay earns more in the first 100 episodes", "9", REPLAY,
          "reward of episodes 1 to 100, prioritised less uniform", EarlyLead(PRIORITISED, UNIFORM), ">", 0.0, _REWARD),
)
# fmt: on
LEARNING_CLAIMS = tuple(with_curves((*_SOURCE, *_TARGET, *_HIGH_SPEED, *_PRIORITISED)))
