"""Fig. 7: the probability of favourable conditions, of all five factors together."""

from __future__ import annotations

from jrcjax.training.transfer import TARGET_LEARNERS
from sweeps.design import along
from sweeps.studies.source import SOURCE
from sweeps.sweep import Sweep

FIG7 = Sweep(
    name="fig7",
    description="reward, throughput and miss detection against tau_0 of all factors: the learners of Fig. 5(b)",
    learners=TARGET_LEARNERS,
    design=along("favourable_probability", "env.all.prior.low", (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)),
    source=SOURCE,
)
