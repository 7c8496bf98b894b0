"""Fig. 5(b): learning curves in the target environment."""

from __future__ import annotations

from jrcjax.training.transfer import TARGET_LEARNERS
from sweeps.studies.source import SOURCE
from sweeps.sweep import Sweep

FIG5B = Sweep(
    name="fig5b",
    description="learning curves in the target environment: TLwD, DPR, DDQN, Q-learning, Round Robin",
    learners=TARGET_LEARNERS,
    source=SOURCE,
)
