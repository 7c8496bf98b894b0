"""Fig. 5(b): learning curves in the target environment."""

from __future__ import annotations

from jrcjax.training.transfer import TARGET_LEARNERS
from sweeps.engine.sources import SOURCE
from sweeps.preset import environment_of
from sweeps.sweep import Sweep

FIG5B = Sweep(
    name="fig5b",
    description="learning curves in the target environment: TLwD, DPR, DDQN, Q-learning, Round Robin",
    learners=TARGET_LEARNERS,
    x_name="environment",
    x_values=(0.0,),
    params_at=lambda x, preset: environment_of("target", preset),
    source=SOURCE,
)
