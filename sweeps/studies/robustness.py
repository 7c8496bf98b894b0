"""How much seeds matter: all learners in the source and the target environment, over as many seeds as one likes."""

from __future__ import annotations

import dataclasses

from sweeps.studies.fig5a import FIG5A
from sweeps.studies.fig5b import FIG5B
from sweeps.sweep import Study

_SEEDS_PER_PART = 64  # fills the blocks that devices work on, with a single point

SOURCE = dataclasses.replace(FIG5A, name="robustness/source", hands_on=True, seeds_per_part=_SEEDS_PER_PART)
"""All learners in the source environment; Double DQN's agents hand on their weights and demonstrations."""
TARGET = dataclasses.replace(FIG5B, name="robustness/target", source=SOURCE, seeds_per_part=_SEEDS_PER_PART)
"""All learners in the target environment."""

ROBUSTNESS = Study(
    name="robustness",
    description="all learners in both environments, and what a study with few seeds would have concluded",
    sweeps=(TARGET,),
    summary="paper_figs.studies.summaries:summarise_robustness",
)
