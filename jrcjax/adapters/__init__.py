"""The environment in the shapes that other libraries expect.

| for | take | needs |
|---|---|---|
| Gymnasium, Stable-Baselines3 | `GymnasiumEnv`, or `gymnasium.make("jrcjax/JRC-target-v0")` | gymnasium |
| Gymnasium, many at once | `VectorEnv`, or `gymnasium.make_vec("jrcjax/JRC-target-v0", num_envs=64)` | gymnasium |
| Stable-Baselines3, many at once | `SB3VecEnv` | stable_baselines3 |
| gymnax 1.0 and its wrappers | `GymnaxEnv` | gymnax |
| rejax, PureJaxRL and others that unpack five values from `step` | `FiveTupleEnv` | gymnax |

Where Gymnasium is installed, importing this package registers `jrcjax/JRC-source-v0` and `jrcjax/JRC-target-v0`, whose
episodes have at most 300 slots, and `jrcjax/JRC-v0`, whose episodes are as long as its parameters say. All take
`params=`. A process that has not imported it takes "jrcjax.adapters:jrcjax/JRC-target-v0". The package can be imported
without any of the libraries.

In a process forked from one that has run JAX, an environment works if its parent made one with equal parameters;
otherwise it is refused. Start other workers by "spawn" or "forkserver".
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jrcjax.adapters.five_tuple import FiveTupleEnv
    from jrcjax.adapters.gymnasium_env import GymnasiumEnv
    from jrcjax.adapters.gymnax_env import GymnaxEnv
    from jrcjax.adapters.sb3_vec_env import SB3VecEnv
    from jrcjax.adapters.vector_env import VectorEnv

__all__ = ["FiveTupleEnv", "GymnasiumEnv", "GymnaxEnv", "SB3VecEnv", "VectorEnv"]

_MODULES = {
    "FiveTupleEnv": "five_tuple",
    "GymnasiumEnv": "gymnasium_env",
    "GymnaxEnv": "gymnax_env",
    "SB3VecEnv": "sb3_vec_env",
    "VectorEnv": "vector_env",
}


def __getattr__(name: str) -> Any:
    """Loads an adapter when it is first asked for."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)


if importlib.util.find_spec("gymnasium"):
    from jrcjax.adapters.registration import register_all

    register_all()
