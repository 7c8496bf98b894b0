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
TLWD, DPR, DDQN = Agent("tlwd"), Agent("dpr"), Agent("ddqn")
PRIORITISED, UNIFORM = Agent("tlwd", 1.0), Agent("tlwd", 0.0)
SWEEPS = "VII-B.2"
"""The paper's section on Figs. 6 to 8."""
_FIG5A, _FIG5B, _FIG6A, _FIG9 = ("5a", "VII-B.1"), ("5b", "VII-B.1"), ("6a", SWEEPS), ("9", "VII-B.3")
_AT = 0.8
"""Value of p_1^v at which the paper counts episodes."""
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


def _faster(claim: str, statement: str, where: tuple[str, str], of: Agent, than: Agent) -> Claim:
    effect = "probability that its policies converge earlier, with the same seed"
    return Claim(claim, statement, *where, effect, EarlierConvergence(of, than), ">", 0.5, "probability")


def _much_faster(name: str) -> Claim:
    label, effect = LABELS[name], "probability that its policies need less than half of DDQN's episodes"
    statement, measure = f"{label} converges much faster than DDQN", EarlierConvergence(Agent(name), DDQN, MUCH_FASTER)
    return Claim(f"C3 ({label}, much)", statement, *_FIG5B, effect, measure, ">", 0.5, "probability")


def _needs_about(claim: str, statement: str, where: tuple[str, str], agent: Agent, episode: float) -> Claim:
    effect = "median episode in which its policies converge"
    return Claim(claim, statement, *where, effect, TypicalEpisode(agent), "within", about(episode), "episode")


def _needs_about_150(name: str) -> Claim:
    label = LABELS[name]
    statement = f"at p_1^v = {_AT} {label} needs about 150 episodes"
    return _needs_about(f"C7 ({label})", statement, _FIG6A, Agent(name, _AT), 150.0)


def _late_gap(claim: str, statement: str, where: tuple[str, str], name: str, relation: str) -> Claim:
    effect, measure = f"mean gap of its policies after episode {SETTLED}", LateGap(Agent(name), SETTLED)
    return Claim(claim, statement, *where, effect, measure, relation, TOLERANCE, _OF_OPTIMUM)


def _fails(environment: str, where: tuple[str, str]) -> Claim:
    statement = f"Q-learning does not reach the optimal policy in the {environment}"
    return _late_gap(f"C2 (Q-learning, {environment})", statement, where, "q_learning", ">")


def _is_last(environment: str, where: tuple[str, str], others: tuple[str, ...]) -> Claim:
    claim, statement = f"C2 (Round Robin, {environment})", f"Round Robin is the lower bound in the {environment}"
    measure = EveryLead("reward", "round_robin", others, sign=-1.0, at=0.0)
    return Claim(claim, statement, *where, "smallest lead of the others", measure, ">", 0.0, _REWARD)


_SOURCE = (
    _late_gap("C1 (reached)", "DDQN reaches the optimal policy in the source", _FIG5A, "ddqn", "<"),
    _needs_about("C1 (about 200)", "DDQN reaches it after about 200 episodes", _FIG5A, DDQN, 200.0),
    Claim(
        "C1 (stable)",
        f"DDQN is stable after {SETTLED} episodes",
        *_FIG5A,
        f"deviation of its policies' means over 20 episodes after episode {SETTLED}",
        Movement(DDQN, SETTLED),
        "<",
        TOLERANCE,
        _OF_OPTIMUM,
    ),
    _fails("source", _FIG5A),
    _is_last("source", _FIG5A, ("ddqn", "q_learning")),
)
_TARGET = (
    _fails("target", _FIG5B),
    _is_last("target", _FIG5B, ("tlwd", "dpr", "ddqn", "q_learning")),
    _faster("C3 (TLwD)", "TLwD converges faster than DDQN", _FIG5B, TLWD, DDQN),
    _faster("C3 (DPR)", "DPR converges faster than DDQN", _FIG5B, DPR, DDQN),
    _much_faster("tlwd"),
    _much_faster("dpr"),
    _needs_about("C3 (TLwD, about 100)", "TLwD converges from about episode 100", _FIG5B, TLWD, 100.0),
    _needs_about("C3 (DPR, about 100)", "DPR converges from about episode 100", _FIG5B, DPR, 100.0),
    Claim(
        "C4 (reward)",
        "TLwD earns more than DPR in the first 100 episodes",
        *_FIG5B,
        "reward of episodes 1 to 100, TLwD less DPR",
        EarlyLead(TLWD, DPR),
        ">",
        0.0,
        _REWARD,
    ),
    Claim(
        "C4 (steadiness)",
        "TLwD is steadier than DPR in the first 100 episodes",
        *_FIG5B,
        "deviation of the reward's change between episodes, TLwD less DPR",
        Roughness("tlwd", "dpr"),
        "<",
        0.0,
        _REWARD,
    ),
)
_HIGH_SPEED = (
    _needs_about("C7 (DDQN)", f"at p_1^v = {_AT} DDQN needs about 400 episodes", _FIG6A, Agent("ddqn", _AT), 400.0),
    _needs_about_150("tlwd"),
    _needs_about_150("dpr"),
)
_REPLAY = (
    _faster("C15 (episodes)", "prioritised replay converges faster than uniform sampling", _FIG9, PRIORITISED, UNIFORM),
    Claim(
        "C15 (reward)",
        "prioritised replay earns more in the first 100 episodes",
        *_FIG9,
        "reward of episodes 1 to 100, prioritised less uniform",
        EarlyLead(PRIORITISED, UNIFORM),
        ">",
        0.0,
        _REWARD,
    ),
)
LEARNING_CLAIMS = tuple(with_curves((*_SOURCE, *_TARGET, *_HIGH_SPEED, *_REPLAY)))
