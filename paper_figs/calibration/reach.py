"""What is out of reach, with how many seeds, and why: rows of the table that the limits on errors are not asked of.

"errors" means that false verdicts are more frequent than 3.5 %; "coverage" that intervals are wider than they need be,
so that they hold the truth in more than 97 % of studies, while false verdicts are as rare as they should be.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

FALSE_VERDICTS = 0.035
"""What false verdicts of one kind may reach: 2.5 %, and what skewness and simulation add."""
COVERAGE = (0.93, 0.97)
"""What the coverage of a 95 % interval may be."""
SEEDS = (3, 5, 10, 30, 100, 1000)
"""Seeds of a study."""
FEWEST = 5
"""Seeds below which there are estimates and no verdicts."""


class Beyond(NamedTuple):
    """Why a rule can't do better in a world."""

    rule: str
    world: str
    """Its name, or how the name ends."""
    seeds: tuple[int, ...]
    what: Literal["errors", "coverage", "verdicts"]
    why: str


_TAIL = "so few values don't show how long the tail is"
_RARE = "most studies hold too few of the rare runs to say how frequent they are"
_UNION = "where all points are equal, the limit that needs no correction is hardly ever wrong"
_FEW = "with so few seeds hardly any point is surely off the edge, so the limit holds for all of them"
_COUNT = "a count has few outcomes; the next narrower interval would be wrong too often"
_ALIKE = "five runs that share their seeds make hardly any independent comparisons"
_HEAVY = "Student's t is too wide for a few values with heavy tails"

BEYOND: tuple[Beyond, ...] = (
    Beyond("", "", tuple(n for n in SEEDS if n < FEWEST), "verdicts", "so few seeds give estimates and no verdicts"),
    Beyond("mean", "exponential", (5,), "errors", _TAIL),
    Beyond("mean", "lognormal", (5, 10, 30, 100), "errors", _TAIL),
    Beyond("mean", "one run in ten is a catastrophe", (5, 10, 30), "errors", _RARE),
    Beyond("negligible", "exponential", (5,), "errors", _TAIL),
    Beyond("ratio", "lognormal", (5,), "coverage", _HEAVY),
    *(Beyond(rule, end, SEEDS, "coverage", _UNION) for rule in ("every point", "up to") for end in ("all equal",)),
    Beyond("rises", "all flat", SEEDS, "coverage", _UNION),
    *(Beyond(rule, end, (5,), "coverage", _FEW) for rule, end in (("every point", "one worst"), ("up to", "one best"))),
    Beyond("up to", "t with 3 degrees of freedom, one best", (10,), "coverage", _FEW),
    Beyond("rises", "one flat step", (5,), "coverage", _FEW),
    Beyond("earlier", "", (10,), "coverage", _COUNT),
    Beyond("earlier", "with ties", (5,), "coverage", _COUNT),
    Beyond("share of runs", "half", (10,), "coverage", _COUNT),
    Beyond("share of runs", "nine in ten", (5, 10), "coverage", _COUNT),
    Beyond("share of runs", "nine in ten", (30,), "errors", "a count's errors are 2.5 % on average over shares only"),
    Beyond("inter-quartile mean", "exponential", (5,), "errors", _TAIL),
    Beyond("improvement", "learners that share seeds", (5,), "coverage", _ALIKE),
)


def beyond(rule: str, world: str, n_seeds: int) -> Beyond | None:
    """What is out of reach of a rule in a world with so many seeds, if anything is."""
    for entry in BEYOND:
        if entry.rule in ("", rule) and world.endswith(entry.world) and n_seeds in entry.seeds:
            return entry
    return None


def reach(rule: str, world: str) -> int | None:
    """Fewest of SEEDS from which nothing is out of reach; None where something always is."""
    last = max((n for n in SEEDS if beyond(rule, world, n)), default=0)
    return next((n for n in SEEDS if n > last), None)
