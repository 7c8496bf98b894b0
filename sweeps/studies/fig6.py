"""Fig. 6: the probability of an unexpected event at high speed."""

from __future__ import annotations

from jrcjax.training.transfer import TARGET_LEARNERS
from sweeps.design import along
from sweeps.studies.source import SOURCE
from sweeps.sweep import Sweep

FIG6 = Sweep(
    name="fig6",
    description="reward, throughput and miss detection against p_1^v: the learners of Fig. 5(b)",
    learners=TARGET_LEARNERS,
    design=along(
        "high_speed_event_probability",
        "env.speed.event_probability.high",
        (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
    ),
    source=SOURCE,
)
