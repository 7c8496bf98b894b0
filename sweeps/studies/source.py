"""Source agents of all sweeps of the paper: Double DQN in Table I's source environment."""

from __future__ import annotations

from dataclasses import replace

from sweeps.studies.fig5a import FIG5A
from sweeps.sweep import Sweep

SOURCE = replace(FIG5A, name="source", description="source agents and their demonstrations", hands_on=True)
"""With the learners of Fig. 5(a), whose program serves both: the others are cheap, and compiling is not."""

_NOT_THE_SOURCES = frozenset(
    {
        "hparams.step_exponent",
        "hparams.step_constant",
        "hparams.priority_exponent",
        "hparams.priority_constant",
        "hparams.demonstration_constant",
        "hparams.demonstration_rewards",
        "hparams.importance_start",
        "hparams.importance_end",
        "hparams.importance_over",
        "hparams.n_step_weight",
        "hparams.margin_weight",
        "hparams.l2_weight",
        "hparams.margin",
        "hparams.initial_weights",
        "config.pretraining",
    }
)
"""What only Q-learning or TLwD reads, so that Double DQN's source agents are the same whatever it is."""


ALWAYS_SHARED = ("config.n_step",)
"""What source agents have in common with the learners in any case: demonstrations come with their returns."""


def source_for(sweep: Sweep, of_table1: bool = False) -> tuple[Sweep, tuple[int, ...]]:
    """What trains the source agents of a sweep.

    Args:
      sweep: whose points' hyperparameters and settings they have.
      of_table1: let them have Table I's instead, but for what is `ALWAYS_SHARED`.

    Returns:
      The source's sweep, `SOURCE` where nothing differs from Table I, and the number of its point for each point.
    """
    names = [column.name for column in sweep.design.columns if is_the_sources(column.path, of_table1)]
    design, points = sweep.design.distinct(names)
    fixed = tuple((path, value) for path, value in sweep.fixed if is_the_sources(path, of_table1))
    if not design.columns and not fixed:
        return SOURCE, ()
    of_points = {"design": design, "fixed": fixed, "seeds_per_part": sweep.seeds_per_part, "own": True}
    return replace(SOURCE, name=f"{sweep.name}-source", learners=("ddqn",), **of_points), points


def is_the_sources(path: str, of_table1: bool = False) -> bool:
    """Whether what trains source agents has the learners' number at a path; see `source_for`."""
    if of_table1:
        return path in ALWAYS_SHARED
    return path.startswith(("hparams.", "config.")) and path not in _NOT_THE_SOURCES
