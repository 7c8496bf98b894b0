"""Fig. 8: the traffic density."""

from __future__ import annotations

import dataclasses
from functools import lru_cache

from jrcjax.model.params import EnvParams
from sweeps.engine.sources import SOURCE
from sweeps.preset import environment_of
from sweeps.sweep import Sweep


@lru_cache  # the bank of placements takes seconds to draw
def params_at(density: float, preset: str) -> EnvParams:
    """The target environment with omega = density."""
    params = environment_of("target", preset)
    return dataclasses.replace(params, radar=params.radar.replace(density=density))


FIG8 = Sweep(
    name="fig8",
    description="reward, throughput and miss detection against the traffic density: TLwD, DPR, DDQN",
    learners=("tlwd", "dpr", "ddqn"),
    x_name="density",
    x_values=(8.0, 12.0, 16.0, 20.0, 24.0, 28.0, 32.0, 36.0, 40.0),
    params_at=params_at,
    source=SOURCE,
)
