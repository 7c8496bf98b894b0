"""Joint radar-communications for autonomous vehicles in JAX: environment, exact solver and learners.

Reproduces and examines N. Q. Hieu et al., "Transferable Deep Reinforcement Learning Framework for Autonomous Vehicles
with Joint Radar-Data Communications" (arXiv:2105.13670), called the paper throughout.
"""

from jrcjax import events, exact, front, radar
from jrcjax.agents.file import load_agent, save_agent, save_agents
from jrcjax.agents.saved_agent import Evaluation, SavedAgent
from jrcjax.config.toml import load_params, save_params
from jrcjax.learners import Source
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model.environment import EnvState, JRCEnv
from jrcjax.model.params import EnvParams, check_params
from jrcjax.model.presets import paper_params
from jrcjax.training.chunks import train_in_chunks
from jrcjax.training.rollout import AgentState, Log
from jrcjax.training.source import train_source
from jrcjax.training.train import train, train_agents
from jrcjax.training.transfer import Transfer, transfer

__version__ = "0.1.0"

__all__ = [
    "AgentState", "Config", "EnvParams", "EnvState", "Evaluation", "HParams", "JRCEnv", "Log", "SavedAgent", "Source",
    "Transfer", "check_params", "events", "exact", "front", "load_agent", "load_params", "paper_params", "radar",
    "save_agent", "save_agents", "save_params", "train", "train_agents", "train_in_chunks",
    "train_source", "transfer",
]  # fmt: skip
