"""TLwD in the target with one part of its loss, or of its start, changed at a time; no figure of the paper."""

from __future__ import annotations

from sweeps.design import table
from sweeps.studies.source import SOURCE
from sweeps.sweep import Sweep

VARIANTS: dict[str, dict[str, float]] = {
    "as in the paper": {},
    "no large margin (lambda_2 = 0)": {"margin_weight": 0.0},
    "margin 0.8": {"margin": 0.8},
    "no n-step loss (lambda_1 = 0)": {"n_step_weight": 0.0},
    "neither": {"margin_weight": 0.0, "n_step_weight": 0.0},
    "source agent's initial weights": {"initial_weights": 1},
}
"""What is changed at each point, in order."""
_CHANGED = ("margin_weight", "margin", "n_step_weight", "initial_weights")

ABLATION = Sweep(
    name="ablation",
    description="TLwD in the target with parts of its loss left out",
    learners=("tlwd",),
    design=table(
        [{"variant": float(number)} | changes for number, changes in enumerate(VARIANTS.values())],
        {"variant": ""} | {name: f"hparams.{name}" for name in _CHANGED},
    ),
    source=SOURCE,
)
