"""The trained agents of a sweep on disk, one file beside each part of its results."""

from __future__ import annotations

from pathlib import Path

from jrcjax import save_agents
from jrcjax.agents.file import LEARNING
from jrcjax.training.rollout import AgentState
from sweeps.engine.job import Job
from sweeps.results import store


def agents_path(folder: Path, seeds: range) -> Path:
    """File of the agents of a block of seeds."""
    return folder / f"agents-{seeds.start:06d}-{seeds.stop - 1:06d}.safetensors"


def write_agents(folder: Path, job: Job, seeds: range, agents: dict[str, AgentState]) -> Path:
    """Writes what the agents of a block act by.

    Args:
      folder: of the sweep's results.
      job: what was run.
      seeds: the seeds of the block.
      agents: by learner, of their state what they act by, every leaf with leading axes of points and of seeds.
    """
    return save_agents(agents_path(folder, seeds), agents, *job.points, config=job.groups[0].config, seeds=seeds)


def check_agents(folder: Path, job: Job) -> None:
    """Refuses a sweep without agents to save or with several settings, and results whose agents were not saved.

    Raises:
      ValueError: naming the seeds.
    """
    learners = ", ".join(job.sweep.learners)
    if not set(job.sweep.learners) & set(LEARNING):
        raise ValueError(f"save-agents: {learners} has nothing to save; allowed: {', '.join(LEARNING)}")
    if len(job.groups) > 1:
        raise ValueError(f"save-agents: points of {len(job.groups)} settings; allowed: points that share all of config")
    without = [part.seeds for part in store.parts_of(folder) if not agents_path(folder, part.seeds).exists()]
    bare = {seed for seeds in without for seed in seeds}
    if bare:
        there = f"{folder} holds results of seeds {store.in_words(bare)} without their agents"
        raise ValueError(f"save-agents: {there}; choose another --out, or remove these parts")
