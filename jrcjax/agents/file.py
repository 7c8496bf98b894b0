"""Trained agents on disk: safetensors files with what acts, its configuration, its environment and its provenance.

A file holds the agents of several learners, each for all points and seeds of a sweep along leading axes; the agent of a
single run is one of each. What training alone needs, replay memories and optimisers, is not kept.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax.agents import layout
from jrcjax.agents.saved_agent import SavedAgent
from jrcjax.checks import refuse, require, require_keys, require_type
from jrcjax.files import DamagedFile, write_whole
from jrcjax.keys import key_of
from jrcjax.learners import Spec
from jrcjax.learners.hparams import Config, HParams, check_config, check_hparams
from jrcjax.learners.q_function import q_function
from jrcjax.model import states
from jrcjax.model.params import EnvParams, check_params
from jrcjax.named import container_of, named_arrays, named_settings
from jrcjax.provenance import provenance
from jrcjax.training.rollout import AgentState, spec_of
from jrcjax.types import Key, choice

LEARNING = layout.LEARNING


def save_agent(
    path: str | os.PathLike,
    agent: AgentState,
    env_params: EnvParams,
    hparams: HParams | None = None,
    *,
    learner: str,
    config: Config | None = None,
) -> Path:
    """Saves one trained agent, as `train` returns it, with the arguments that it was trained with.

    Args:
      path: of the file, which is written whole or not at all.
      agent: after training.
      env_params: the environment that it was trained in.
      hparams: its hyperparameters; Table I's if None.
      learner: "q_learning", "ddqn", "dpr" or "tlwd".
      config: its static settings; Table I's if None.

    Raises:
      ValueError: naming the argument, the value and what is allowed, before the file is touched.
    """
    require_type("agent", agent, AgentState)
    hparams = HParams() if hparams is None else hparams
    check_params(env_params)
    check_hparams(hparams)
    one = jax.tree.map(lambda leaf: leaf[None], (env_params, hparams))
    acting = agent._replace(learner=acting_part(agent.learner))
    agents = {learner: jax.tree.map(lambda leaf: leaf[None, None], acting)}
    return save_agents(path, agents, *one, config=config, seeds=(0,))


def save_agents(
    path: str | os.PathLike,
    agents: dict[str, AgentState],
    env_params: EnvParams,
    hparams: HParams,
    *,
    config: Config | None = None,
    seeds: Sequence[int],
) -> Path:
    """Saves the agents of a sweep.

    Args:
      path: of the file, which is written whole or not at all.
      agents: by learner, every leaf with leading axes of points and seeds; of the learner's state the `acting_part`.
      env_params: the environments, every leaf with a leading axis of points.
      hparams: the same for hyperparameters.
      config: static settings, the same for all; Table I's if None.
      seeds: the seeds' numbers.

    Raises:
      ValueError: naming the argument, the value and what is allowed, before the file is touched.
    """
    config = Config() if config is None else config
    require_type("params", env_params, EnvParams)
    require_type("hparams", hparams, HParams)
    check_config(config)
    _check_agents(agents)
    tensors = {f"params.{name}": leaf for name, leaf in named_arrays(env_params).items()}
    tensors |= {f"hparams.{name}": leaf for name, leaf in named_arrays(hparams).items()}
    for learner, agent in agents.items():
        named = named_arrays(agent.learner) | {"key": jax.random.key_data(_typed(agent.key))}
        tensors |= {f"agents.{learner}.{name}": leaf for name, leaf in named.items()}
    about = {
        "version": layout.VERSION,
        "learners": list(agents),
        "points": next(iter(np.shape(hparams.discount)), 1),
        "seeds": [int(seed) if isinstance(seed, np.integer) else seed for seed in seeds],
        "config": _plain_config(config),
        "settings": named_settings(env_params),
        "key_implementation": str(jax.random.key_impl(_typed(next(iter(agents.values())).key))),
        "provenance": provenance(),
    }
    arrays = {name: np.asarray(leaf) for name, leaf in tensors.items()}
    _check_as_read(layout.File(b"", {}, about, arrays), agents, config)
    write_whole(Path(path), layout.content_of(arrays, about))
    return Path(path)


def _check_agents(agents: dict[str, AgentState]) -> None:
    """Refuses what is not the agents of at least one learner, with a key for each point and seed."""
    require_type("agents", agents, dict)
    if not agents:
        refuse("agents", "{}", "the agents of at least one learner")
    for learner, agent in agents.items():
        choice("learner", learner, layout.LEARNING)
        require_type(f"agents.{learner}", agent, AgentState)
        # From other processes agents come as arrays of NumPy, their keys in the old style.
        key = jnp.asarray(agent.key) if isinstance(agent.key, np.ndarray) else agent.key
        require_keys(key, 2, "a key for each point and seed")


def _check_as_read(file: layout.File, agents: dict[str, AgentState], config: Config) -> None:
    """Refuses what could not be loaded again, unless because an agent diverged: a sweep keeps the others."""
    layout.check(file)
    points = [_point_of(file, x) for x in range(file.about["points"])]
    for learner, agent in agents.items():
        leading = (len(points), len(file.about["seeds"]))
        _check_values(learner, agent.learner, spec_of(points[0][0]), config, leading)


def load_agent(
    path: str | os.PathLike, *, learner: str | None = None, point: int | None = None, seed: int | None = None
) -> SavedAgent:
    """Loads one agent.

    Args:
      path: a file that `save_agent`, or a sweep with --save-agents, wrote.
      learner: its name; not needed where the file has only one.
      point: number of the point, likewise.
      seed: the seed, likewise.

    Raises:
      FileNotFoundError: if there is no such file.
      ValueError: naming the file, the field, the value and what is allowed, if it is no file of agents, if a bit of it
        is not as it was written, if it is of another version, if the agent diverged, or if there is no such agent.
    """
    try:
        return _loaded(Path(path), learner, point, seed)
    except (ValueError, DamagedFile) as error:
        raise ValueError(f"{path}: {error}") from None


def _loaded(path: Path, learner: str | None, point: int | None, seed: int | None) -> SavedAgent:
    file = layout.read(path)
    layout.check(file)
    about = file.about
    name = _chosen("learner", learner, about["learners"])
    x = _chosen("point", point, range(about["points"]))
    number = _chosen("seed", seed, about["seeds"])
    config = layout.config_of(about)
    environment, hparams = jax.tree.map(jnp.asarray, _point_of(file, x))
    values = jax.tree.map(jnp.asarray, _part(file, f"agents.{name}.", (x, about["seeds"].index(number))))
    key = jax.random.wrap_key_data(values.pop("key"), impl=about["key_implementation"])
    _check_values(name, values, spec_of(environment), config, ())
    finite = "finite numbers, of an agent that did not diverge"
    for part, leaf in values.items():
        require(f"agents.{name}.{part}", leaf, leaf.shape, lambda x: True, finite)
    layout.check_seal(file)
    return SavedAgent(name, environment, hparams, config, key, _unnamed(values), x, number, about["provenance"])


def _point_of(file: layout.File, x: int) -> tuple[EnvParams, HParams]:
    """Environment and hyperparameters of a point, checked; still arrays of NumPy, which cost the least to check."""
    environment = container_of(EnvParams, _part(file, "params.", (x,)), layout.settings_of(file.about))
    hparams = HParams.restored(_part(file, "hparams.", (x,)))
    check_params(environment)
    check_hparams(hparams)
    return environment, hparams


def acting_part(learner_state: Any) -> dict[str, Any]:
    """What a learner acts by, without what it learns with."""
    return {name: getattr(learner_state, name) for name in ("weights", "q") if hasattr(learner_state, name)}


def _typed(key: Key) -> Key:
    """A typed key, also for a key of the old style."""
    return key if jnp.issubdtype(key.dtype, jax.dtypes.prng_key) else jax.random.wrap_key_data(key)


def _plain_config(config: Config) -> dict[str, Any]:
    fields = {field.name: getattr(config, field.name) for field in dataclasses.fields(config)}
    optimiser = config.optimiser if isinstance(config.optimiser, str) else layout.OPTAX
    return fields | {"hidden": list(config.hidden), "optimiser": optimiser}


def _check_values(learner: str, values: dict[str, Any], spec: Spec, config: Config, leading: tuple[int, ...]) -> None:
    """Refuses values that do not fit the problem."""
    if learner == "q_learning":
        wanted: Any = {"q": jax.ShapeDtypeStruct((states.num_states(spec.shape), spec.num_actions), jnp.float32)}
    else:
        wanted = {"weights": jax.eval_shape(q_function(spec, config).init, key_of(0))}
    shapes = {name: (*leading, *leaf.shape) for name, leaf in named_arrays(wanted).items()}
    found = {name: tuple(leaf.shape) for name, leaf in named_arrays(values).items()}
    if found != shapes:
        refuse(
            f"agents.{learner}", f"shapes {found}", f"{shapes}, as levels {spec.shape} and the configuration have it"
        )


def _part(file: layout.File, prefix: str, place: tuple[int, ...]) -> dict[str, Any]:
    """One entry along the leading axes of every tensor whose name has this prefix, by the rest of its name."""
    named = {name: tensor for name, tensor in file.tensors.items() if name.startswith(prefix)}
    return {name.removeprefix(prefix): tensor[place] for name, tensor in named.items()}


def _unnamed(leaves: dict[str, jax.Array]) -> dict[str, Any]:
    """The nested dictionary of leaves with dotted paths."""
    tree: dict[str, Any] = {}
    for name, leaf in leaves.items():
        *outer, last = name.split(".")
        inner = tree
        for part in outer:
            inner = inner.setdefault(part, {})
        inner[last] = leaf
    return tree


def _chosen(field: str, value: Any, there: Sequence[Any]) -> Any:
    if value is None and len(there) == 1:
        return there[0]
    value = int(value) if isinstance(value, np.integer) else value
    if type(value) is not type(there[0]) or value not in there:
        numbers = f"one of {there[0]} to {there[-1]}" if len(there) > 8 else f"one of {', '.join(map(repr, there))}"
        refuse(field, value if type(value) in (int, float, str) else repr(value), f"{numbers}, which the file holds")
    return value
