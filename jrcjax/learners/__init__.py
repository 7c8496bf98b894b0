"""Learners by name."""

from __future__ import annotations

from collections.abc import Hashable

from jrcjax.checks import refuse
from jrcjax.learners.base import Learner, LearnerFactory, Source, Spec
from jrcjax.learners.ddqn import ddqn, dpr
from jrcjax.learners.hparams import Config
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
    allowed = f"{', '.join(map(repr, LEARNERS))}, or a function that makes a Learner"
    if not callable(learner) or not isinstance(learner, Hashable):
        refuse("learner", repr(learner), allowed)
    made = learner(spec, config)
    if not isinstance(made, Learner):
        refuse("learner", f"a function that makes a {type(made).__name__}", allowed)
    return made
