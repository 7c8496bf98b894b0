"""Learners by name."""

from __future__ import annotations

from jrcjax.checks import refuse
from jrcjax.hparams import Config
from jrcjax.learners.base import Learner, LearnerFactory, Source, Spec
from jrcjax.learners.ddqn import ddqn, dpr
from jrcjax.learners.q_learning import q_learning
from jrcjax.learners.round_robin import round_robin
from jrcjax.learners.tlwd import tlwd
from jrcjax.types import choice

LEARNERS: dict[str, LearnerFactory] = {
    "round_robin": round_robin,
    "q_learning": q_learning,
    "ddqn": ddqn,
    "dpr": dpr,
    "tlwd": tlwd,
}

__all__ = [
    "LEARNERS", "Learner", "LearnerFactory", "Source", "Spec", "ddqn", "dpr", "make_learner", "q_learning",
    "round_robin", "tlwd",
]  # fmt: skip


def make_learner(learner: str | LearnerFactory, spec: Spec, config: Config) -> Learner:
    """The learner of that name, or of that factory, for a problem.

    Raises:
      ValueError: for an unknown name.
    """
    if isinstance(learner, str):
        choice("learner", learner, tuple(LEARNERS))
        learner = LEARNERS[learner]
    if not callable(learner):
        refuse("learner", str(learner), f"{', '.join(map(repr, LEARNERS))}, or a function that makes a Learner")
    return learner(spec, config)
