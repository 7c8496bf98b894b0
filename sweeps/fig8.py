"""Fig. 8: the traffic density."""

from __future__ import annotations

import dataclasses

from jrcjax.params import EnvParams
from jrcjax.presets import paper_params, paper_radar
from sweeps.sources import SOURCE
from sweeps.sweep import Sweep


def params_at(density: float, preset: str) -> EnvParams:
    """The target environment with omega = density."""
    return dataclasses.replace(paper_params("target", preset), radar=paper_radar(density))


FIG8 = Sweep(
    name="fig8",
    description="reward, throughput and miss detection against the traffic density: TLwD, DPR, DDQN",
    learners=("tlwd", "dpr", "ddqn"),
    x_name="density",
    x_values=(8.0, 12.0, 16.0, 20.0, 24.0, 28.0, 32.0, 36.0, 40.0),
    params_at=params_at,
    source=SOURCE,
)
