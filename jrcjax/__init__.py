"""Joint radar-communications for autonomous vehicles in JAX: environment, exact solver and learners.

Reproduces and examines N. Q. Hieu et al., "Transferable Deep Reinforcement Learning Framework for Autonomous Vehicles
with Joint Radar-Data Communications" (arXiv:2105.13670), called the paper throughout.
"""

from jrcjax import events, exact, radar
from jrcjax.environment import EnvState, JRCEnv
from jrcjax.episodes import AgentState, Log
from jrcjax.hparams import Config, HParams
from jrcjax.learners import Source
from jrcjax.params import EnvParams, check_params
from jrcjax.params_file import load_params, save_params
from jrcjax.presets import paper_params
from jrcjax.saved_agent import Evaluation, SavedAgent
from jrcjax.saving import load_agent, save_agent, save_agents
from jrcjax.source import train_source
from jrcjax.training import train, train_agents
from jrcjax.transfer import Transfer, transfer

__version__ = "0.1.0"

__all__ = [
    "AgentState", "Config", "EnvParams", "EnvState", "Evaluation", "HParams", "JRCEnv", "Log", "SavedAgent", "Source",
    "Transfer", "check_params", "events", "exact", "load_agent", "load_params", "paper_params", "radar", "save_agent",
    "save_agents", "save_params", "train", "train_agents", "train_source", "transfer",
]  # fmt: skip
