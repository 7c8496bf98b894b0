"""The environment in the shapes that other libraries expect.

| for | take | needs |
|---|---|---|
| Gymnasium, Stable-Baselines3 | `GymnasiumEnv`, or `gymnasium.make("jrcjax/JRC-target-v0")` | gymnasium |
| gymnax 1.0 and its wrappers | `GymnaxEnv` | gymnax |
| rejax, PureJaxRL | `FiveTupleEnv` | gymnax |

Where Gymnasium is installed, importing this package registers `jrcjax/JRC-source-v0` and `jrcjax/JRC-target-v0`. It can
be imported without any of the libraries.
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
