"""The ids by which Gymnasium makes the environments.

A process that has not imported `jrcjax.adapters` finds them by "jrcjax.adapters:jrcjax/JRC-target-v0".
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gymnasium.envs.registration import register, registry  # pyright: ignore[reportMissingImports]

from jrcjax.adapters.slots import paper_slots
from jrcjax.checks import refuse
from jrcjax.model.params import EnvParams
from jrcjax.model.presets import ENVIRONMENTS

if TYPE_CHECKING:
    from jrcjax.adapters.gymnasium_env import GymnasiumEnv
    from jrcjax.adapters.vector_env import VectorEnv

PAPER_SLOTS = 300
"""Slots per episode in the paper, which Gymnasium's time limit for its environments repeats."""
ANY = "jrcjax/JRC-v0"
"""Id of an environment with own parameters, whose episodes last as long as they say."""


def register_all() -> None:
    """Registers `jrcjax/JRC-source-v0`, `jrcjax/JRC-target-v0` and `jrcjax/JRC-v0`, if they are not yet."""
    here = __name__
    limits: dict[str, tuple[int | None, dict[str, str]]] = {ANY: (None, {})}
    limits |= {f"jrcjax/JRC-{name}-v0": (PAPER_SLOTS, {"environment": name}) for name in ENVIRONMENTS}
    for name, (limit, kwargs) in limits.items():
        if name not in registry:
            register(
                name,
                entry_point=f"{here}:make_env",
                vector_entry_point=f"{here}:make_vector_env",
                max_episode_steps=limit,
                kwargs=kwargs,
            )


def _params(environment: str | None, preset: str, params: EnvParams | None) -> EnvParams:
    """The given parameters, or else the paper's."""
    if params is None:
        return paper_slots(environment or "target", preset).params
    if environment is not None and params.max_steps_in_episode > PAPER_SLOTS:
        slots = f"at most {PAPER_SLOTS}, where this id cuts episodes off; {ANY} has no such limit"
        refuse("params.max_steps_in_episode", params.max_steps_in_episode, slots)
    return params


def make_env(
    environment: str | None = None, preset: str = "paper", params: EnvParams | None = None, **settings: Any
) -> GymnasiumEnv:
    """A `GymnasiumEnv`, as `gymnasium.make` makes it.

    Args:
      environment: "source" or "target", as the id says.
      preset: "paper" or "paper_table"; see `paper_params`.
      params: own parameters, instead of the paper's.
      **settings: `seed` and `render_mode`.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    from jrcjax.adapters.gymnasium_env import GymnasiumEnv

    return GymnasiumEnv(_params(environment, preset, params), **settings)


def make_vector_env(
    num_envs: int = 1,
    environment: str | None = None,
    preset: str = "paper",
    params: EnvParams | None = None,
    **settings: Any,
) -> VectorEnv:
    """A `VectorEnv`, as `gymnasium.make_vec` makes it.

    Args:
      num_envs: number of environments.
      environment: "source" or "target", as the id says.
      preset: "paper" or "paper_table"; see `paper_params`.
      params: own parameters, instead of the paper's.
      **settings: `seed`, `autoreset_mode` and `max_episode_steps`.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    from jrcjax.adapters.vector_env import VectorEnv

    return VectorEnv(num_envs, _params(environment, preset, params), **settings)
