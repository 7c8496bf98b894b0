"""An environment that is quick to build: few objects, placements and slots, and unequal numbers of everything else."""

from functools import lru_cache

from jrcjax.config.toml import from_toml
from jrcjax.model.params import EnvParams

TEXT = """
reward_weights = [1, 100, 1, 50]
max_steps_in_episode = 20
[channel]
prior = [0.5, 0.3, 0.2]
received_power = 1
interference = [0.0, 0.1, 0.5]
noise = 0.01
sinr_threshold = [1.5, 5, 20]
packets = [1, 2, 4]
[road]
prior = [0.6, 0.4]
event_probability = [0.01, 0.1]
[weather]
prior = [1.0]
event_probability = [0.02]
[speed]
prior = [0.2, 0.3, 0.5]
event_probability = [0.0, 0.1, 0.3]
persistence = 0.25
[nearby]
prior = [0.5, 0.5]
event_probability = [0.0, 0.05]
[radar]
bandwidth = [300e6, 750e6]
slope = [1.0e13, 1.5e13]
max_intermediate_frequency = [2e6, 3e6]
density = 10
class_share = [1.0]
size_mean = [[4.6, 1.9]]
size_std = [[0.2, 0.1]]
bank_size = 64
"""


@lru_cache
def tiny_params() -> EnvParams:
    """The environment of TEXT: 36 states, three data rates, two radar modes of equal range."""
    return from_toml(TEXT)
