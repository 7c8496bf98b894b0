"""What is negligible: the numbers that say when two learners are the same for practical purposes."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Delta:
    """Differences up to these are negligible."""

    reward: float = 0.01
    """Share of the optimum's reward."""
    throughput: float = 0.02
    """Share of the other learner's throughput."""
    miss_detection: float = 0.01
    """Probability."""
    episodes: float = 10.0
    """Between the episodes in which learners converge."""

    def check(self) -> None:
        """Raises ValueError naming the field, the value and what is allowed."""
        for name, value in asdict(self).items():
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"delta.{name}: {value!r}; allowed: a number > 0")
