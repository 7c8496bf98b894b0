"""Trained agents on disk: safetensors files with what acts, its configuration, its environment and its provenance.

A file holds the agents of several learners, each for all points and seeds of a sweep along leading axes; the agent of a
single run is one of each. What training alone needs, replay memories and optimisers, is not kept.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax.agents.saved_agent import SavedAgent
from jrcjax.checks import refuse, require_type
from jrcjax.files import write_whole
from jrcjax.learners import LEARNERS, Spec
from jrcjax.learners.hparams import Config, HParams
from jrcjax.learners.q_function import q_function
from jrcjax.model import states
from jrcjax.model.params import EnvParams
from jrcjax.named import container_of, named_arrays, named_settings
from jrcjax.provenance import provenance
from jrcjax.training.rollout import AgentState, spec_of
from jrcjax.types import Key, choice

VERSION = 2
"""Of the files' layout."""
ABOUT = "jrcjax agents"
"""Key of the metadata under which a file says what it holds."""
_OPTAX = "optax"  # an optimiser that had no name
LEARNING = tuple(name for name in LEARNERS if name != "round_robin")
"""Learners that have something to save."""


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
    tensors = {f"params.{name}": leaf for name, leaf in named_arrays(env_params).items()}
    tensors |= {f"hparams.{name}": leaf for name, leaf in named_arrays(hparams).items()}
    points = hparams.discount.shape[0]
    for learner, agent in agents.items():
        choice("learner", learner, LEARNING)
        _check_values(learner, agent.learner, spec_of(env_params), config, (points, len(seeds)))
        named = named_arrays(agent.learner) | {"key": jax.random.key_data(_typed(agent.key))}
        tensors |= {f"agents.{learner}.{name}": leaf for name, leaf in named.items()}
    about = {
        "version": VERSION,
        "learners": list(agents),
        "points": points,
        "seeds": [int(seed) for seed in seeds],
        "config": _plain_config(config),
        "settings": named_settings(env_params),
        "key_implementation": str(jax.random.key_impl(_typed(next(iter(agents.values())).key))),
        "provenance": provenance(),
    }
    return _write(Path(path), {name: np.asarray(leaf) for name, leaf in tensors.items()}, about)


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
      ValueError: if it is no file of agents, damaged or of another version, or has no such agent.
    """
    with opened(path) as (file, about):
        name = _chosen("learner", learner, about["learners"])
        x = _chosen("point", point, list(range(about["points"])))
        number = _chosen("seed", seed, about["seeds"])
        params, hparams = (_read(file, prefix, (x,)) for prefix in ("params.", "hparams."))
        agent = _unnamed(_read(file, f"agents.{name}.", (x, about["seeds"].index(number))))
    key = jax.random.wrap_key_data(agent.pop("key"), impl=about["key_implementation"])
    config = Config(**about["config"] | {"hidden": tuple(about["config"]["hidden"])})
    environment = _environment(params, about["settings"])
    _check_values(name, agent, spec_of(environment), config, ())
    learned_with = HParams(**{field: jnp.asarray(leaf) for field, leaf in hparams.items()})
    return SavedAgent(name, environment, learned_with, config, key, agent, x, number, about["provenance"])


def acting_part(learner_state: Any) -> dict[str, Any]:
    """What a learner acts by, without what it learns with."""
    return {name: getattr(learner_state, name) for name in ("weights", "q") if hasattr(learner_state, name)}


def _typed(key: Key) -> Key:
    """A typed key, also for a key of the old style."""
    return key if jnp.issubdtype(key.dtype, jax.dtypes.prng_key) else jax.random.wrap_key_data(key)


def _plain_config(config: Config) -> dict[str, Any]:
    fields = {field.name: getattr(config, field.name) for field in dataclasses.fields(config)}
    return fields | {"optimiser": config.optimiser if isinstance(config.optimiser, str) else _OPTAX}


def _check_values(learner: str, values: dict[str, Any], spec: Spec, config: Config, leading: tuple[int, ...]) -> None:
    """Refuses values that do not fit the problem."""
    if learner == "q_learning":
        wanted: Any = {"q": jax.ShapeDtypeStruct((states.num_states(spec.shape), spec.num_actions), jnp.float32)}
    else:
        wanted = {"weights": jax.eval_shape(q_function(spec, config).init, jax.random.key(0))}
    shapes = {name: (*leading, *leaf.shape) for name, leaf in named_arrays(wanted).items()}
    found = {name: tuple(leaf.shape) for name, leaf in named_arrays(values).items()}
    if found != shapes:
        refuse(
            f"agents.{learner}", f"shapes {found}", f"{shapes}, as levels {spec.shape} and the configuration have it"
        )


def _unnamed(leaves: dict[str, np.ndarray]) -> dict[str, Any]:
    """The nested dictionary of leaves with dotted paths."""
    tree: dict[str, Any] = {}
    for name, leaf in leaves.items():
        *outer, last = name.split(".")
        inner = tree
        for part in outer:
            inner = inner.setdefault(part, {})
        inner[last] = jnp.asarray(leaf)
    return tree


def _environment(arrays: dict[str, np.ndarray], settings: dict[str, Any]) -> EnvParams:
    """Environment parameters from their leaves and what is static of them, which JSON gives as lists."""
    statics = {name: tuple(value) if isinstance(value, list) else value for name, value in settings.items()}
    return container_of(EnvParams, {name: jnp.asarray(leaf) for name, leaf in arrays.items()}, statics)


def _read(file: Any, prefix: str, place: tuple[int, ...]) -> dict[str, np.ndarray]:
    """One entry along the leading axes of every tensor whose name has this prefix, by the rest of its name."""
    slices = tuple(slice(i, i + 1) for i in place)
    names = [name for name in file.keys() if name.startswith(prefix)]  # noqa: SIM118 - not a mapping
    return {name.removeprefix(prefix): file.get_slice(name)[slices][(0,) * len(place)] for name in names}


@contextlib.contextmanager
def opened(path: str | os.PathLike) -> Iterator[tuple[Any, dict[str, Any]]]:
    """An open file of agents, and what it says of itself.

    Raises:
      FileNotFoundError: if there is no such file.
      ValueError: if it is no file of agents, damaged or of another version.
    """
    from safetensors import SafetensorError, safe_open  # here, since importing the package needs it for nothing else

    try:
        with safe_open(path, "numpy") as file:
            metadata = file.metadata() or {}
            if ABOUT not in metadata:
                raise ValueError(f"{path}: a safetensors file without agents; allowed: one that save_agent wrote")
            about = json.loads(metadata[ABOUT])
            if about["version"] != VERSION:
                raise ValueError(f"{path}: version {about['version']}; allowed: {VERSION}, which this jrcjax reads")
            yield file, about
    except SafetensorError as error:
        raise ValueError(f"{path}: damaged, or not a file that save_agent wrote ({error})") from None


def _chosen(field: str, value: Any, there: list[Any]) -> Any:
    if value is None and len(there) == 1:
        return there[0]
    if value not in there:
        numbers = f"one of {there[0]} to {there[-1]}" if len(there) > 8 else f"one of {', '.join(map(repr, there))}"
        refuse(field, "None" if value is None else value, f"{numbers}, which the file holds")
    return value


def _write(path: Path, tensors: dict[str, np.ndarray], about: dict[str, Any]) -> Path:
    """Writes a file, whole or not at all."""
    from safetensors.numpy import save

    content = save({name: np.ascontiguousarray(array) for name, array in tensors.items()}, {ABOUT: json.dumps(about)})
    write_whole(path, content)
    return path
