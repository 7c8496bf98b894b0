"""Readings: how the paper may be understood where it is silent or contradicts itself.

Each class is one decision and each member one reading of it; the first is the default. Parameters hold the reading's
number, so that a reading can be traced and vmapped over, and people may give its name in lower case.
"""

from __future__ import annotations

from enum import IntEnum


class Reading(IntEnum):
    """One decision that the paper leaves open."""

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """The readings as people write them, in the order of their numbers."""
        return tuple(member.name.lower() for member in cls)


class EventModel(Reading):
    """How the factors' probabilities add up to that of an unexpected event, equation (4)."""

    CONDITIONAL = 0
    """The sum over factors of p at the factor's current level, clipped to 1."""
    MARGINAL = 1
    """Equation (4) as printed: the sum over factors of the mean of p over the factor's prior."""
    NOISY_OR = 2
    """1 - product over factors of (1 - p), p at the factor's current level."""


class MissConvention(Reading):
    """Which slots count for the probability of miss detection, equation (7). A slot spent on data misses all."""

    ALL_SLOTS = 0
    EVENT_SLOTS = 1
    RADAR_SLOTS = 2


class Distance(Reading):
    """The distance between two objects that is compared with the range resolution."""

    FOOTPRINT_GAP = 0
    """Between their axis-aligned footprints."""
    CENTRE_TO_CENTRE = 1
    RADIAL_RANGE = 2
    """The difference of their distances from the vehicle."""


class CountingRule(Reading):
    """Which objects count as detected."""

    RESOLVED = 0
    """Those that are resolved from all others."""
    CLUSTERS = 1
    """Every cluster of merged objects, once."""


class CountModel(Reading):
    """How many objects a placement has, given their mean number."""

    FIXED = 0
    """The mean, rounded."""
    POISSON = 1
    """A Poisson number with that mean."""


class RewardState(Reading):
    """Which state a slot's event, packets and reward belong to."""

    CURRENT = 0
    """The one that the agent observes."""
    EPISODE_START = 1
    """The episode's first, although what the agent observes goes on changing; so in the authors' earlier code."""


class Exploration(Reading):
    """How epsilon falls over `HParams.epsilon_slots`."""

    LINEAR = 0
    EXPONENTIAL = 1
    """By the same factor from episode to episode."""


class Loss(Reading):
    """How an error of equations (26) and (27) counts."""

    SQUARED = 0
    HUBER = 1
    """Squared up to `HParams.huber_delta`, linear beyond it."""


class Initialiser(Reading):
    """Where a network's random weights come from."""

    LECUN_NORMAL = 0
    GLOROT_UNIFORM = 1
    HE_NORMAL = 2


class ImportanceOver(Reading):
    """Which updates the beta of equation (24) rises over."""

    ALL_UPDATES = 0
    """Pre-training and training."""
    TRAINING = 1
    """Training alone; beta is `importance_start` throughout pre-training."""


class DemonstrationRewards(Reading):
    """What TLwD does with the rewards that the demonstrations brought in the source environment."""

    SOURCE = 0
    """It learns from them as from its own."""
    UNUSED = 1
    """Demonstrations count for the margin alone: they have no temporal-difference error."""


class InitialWeights(Reading):
    """TLwD's network at the start of pre-training."""

    RANDOM = 0
    """As in Algorithm 2."""
    SOURCE = 1
    """The source agent's."""
