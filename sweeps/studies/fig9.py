"""Fig. 9: prioritised against uniform replay."""

from __future__ import annotations

from jrcjax.training.transfer import TARGET_LEARNERS
from sweeps.design import table
from sweeps.studies.source import SOURCE
from sweeps.sweep import Sweep

PATHS = {
    "prioritised": "",
    "priority_exponent": "hparams.priority_exponent",
    "importance_start": "hparams.importance_start",
    "importance_end": "hparams.importance_end",
}
"""What varies, by column."""
PRIORITISED = {"prioritised": 1.0}
"""(alpha, beta) = (0.4, 0.6 to 1), as in the base."""
UNIFORM = {"prioritised": 0.0, "priority_exponent": 0.0, "importance_start": 0.0, "importance_end": 0.0}
"""(alpha, beta) = (0, 0)."""

FIG9 = Sweep(
    name="fig9",
    description="learning curves in the target environment, with prioritised replay for TLwD and with uniform",
    learners=TARGET_LEARNERS,
    design=table((PRIORITISED, UNIFORM), PATHS),
    source=SOURCE,
)
