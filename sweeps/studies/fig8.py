"""Fig. 8: the traffic density."""

from __future__ import annotations

from jrcjax.training.transfer import TARGET_LEARNERS
from sweeps.design import along
from sweeps.studies.source import SOURCE
from sweeps.sweep import Sweep

FIG8 = Sweep(
    name="fig8",
    description="reward, throughput and miss detection against the traffic density: the learners of Fig. 5(b)",
    learners=TARGET_LEARNERS,
    design=along("density", "env.radar.density", (8.0, 12.0, 16.0, 20.0, 24.0, 28.0, 32.0, 36.0, 40.0)),
    source=SOURCE,
)
