"""The trained agents of a sweep on disk, one file beside each part of its results."""

from __future__ import annotations

from pathlib import Path

import jax

from jrcjax import save_agents
from jrcjax.agents.file import LEARNING, acting_part
from jrcjax.training.rollout import AgentState
from sweeps.engine.program import Points, joined
from sweeps.results import store
from sweeps.sweep import Size, Sweep


def agents_path(folder: Path, seeds: range) -> Path:
    """File of the agents of a block of seeds."""
    return folder / f"agents-{seeds.start:06d}-{seeds.stop - 1:06d}.safetensors"


def write_agents(
    folder: Path, sweep: Sweep, size: Size, points: Points, seeds: range, groups: list[dict[str, AgentState]]
) -> Path:
    """Writes what the agents of a block act by; Round Robin has nothing of the kind.

    Args:
      folder: of the sweep's results.
      sweep: what was run.
      size: how much of it.
      points: its points.
      seeds: the seeds of the block.
      groups: of lanes, by learner, as in `sweeps.engine.program.Progress`.
    """
    shape = (len(sweep.x_values), len(seeds))
    lanes = shape[0] * shape[1]

    def kept(name: str) -> AgentState:
        agents = [group[name]._replace(learner=acting_part(group[name].learner)) for group in groups]
        return jax.tree.map(lambda leaf: leaf[:lanes].reshape(*shape, *leaf.shape[1:]), joined(agents))

    learning = {name: kept(name) for name in sweep.learners if name in LEARNING}
    return save_agents(agents_path(folder, seeds), learning, *points, config=sweep.config(size), seeds=seeds)


def check_agents(folder: Path, sweep: Sweep) -> None:
    """Refuses a sweep without agents to save, and a folder with results whose agents were not saved.

    Raises:
      ValueError: naming the seeds.
    """
    if not set(sweep.learners) & set(LEARNING):
        raise ValueError(
            f"save-agents: {', '.join(sweep.learners)} has nothing to save; allowed: {', '.join(LEARNING)}"
        )
    without = [part.seeds for part in store.parts_of(folder) if not agents_path(folder, part.seeds).exists()]
    bare = {seed for seeds in without for seed in seeds}
    if bare:
        there = f"{folder} holds results of seeds {store.in_words(bare)} without their agents"
        raise ValueError(f"save-agents: {there}; choose another --out, or remove these parts")
