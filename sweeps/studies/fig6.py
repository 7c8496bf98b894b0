"""Fig. 6: the probability of an unexpected event at high speed."""

from __future__ import annotations

import dataclasses

from jrcjax.model.params import EnvParams
from sweeps.engine.sources import SOURCE
from sweeps.preset import environment_of
from sweeps.sweep import Sweep


def params_at(p: float, preset: str) -> EnvParams:
    """The target environment with p_1^v = p."""
    params = environment_of("target", preset)
    speed = dataclasses.replace(params.speed, event_probability=params.speed.event_probability.at[1].set(p))
    return dataclasses.replace(params, speed=speed)


FIG6 = Sweep(
    name="fig6",
    description="reward, throughput and miss detection against p_1^v: TLwD, DPR, DDQN",
    learners=("tlwd", "dpr", "ddqn"),
    x_name="high_speed_event_probability",
    x_values=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
    params_at=params_at,
    source=SOURCE,
)
