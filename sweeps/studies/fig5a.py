"""Fig. 5(a): learning curves in the source environment."""

from __future__ import annotations

from sweeps.sweep import Sweep

FIG5A = Sweep(
    name="fig5a",
    description="learning curves in the source environment: DDQN, Q-learning, Round Robin",
    learners=("ddqn", "q_learning", "round_robin"),
    environment="source",
)
