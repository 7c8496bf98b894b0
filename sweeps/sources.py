"""The source agents of all sweeps that transfer: trained once per seed, kept on disk with their demonstrations."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

from jrcjax import parallel
from jrcjax.episodes import spec_of
from jrcjax.hparams import Config
from jrcjax.learners import Source, Spec, make_learner
from jrcjax.learners.q_function import q_function
from jrcjax.n_step import NStepTransition
from jrcjax.presets import paper_params
from jrcjax.source import source_of
from sweeps import store
from sweeps.estimate import seconds_per_episode
from sweeps.program import Points, keys_of, points_of, reference_of, run_block
from sweeps.sweep import Size, Sweep

SOURCE = Sweep(
    name="source",
    description="source agents and their demonstrations",
    learners=("ddqn",),
    x_name="environment",
    x_values=(0.0,),
    params_at=lambda x, preset: paper_params("source", preset),
)


def missing_sources(source: Sweep, size: Size, seeds: range, out: Path) -> range:
    """Those of the seeds, from the first to the last, whose source agents are still to be trained.

    Raises:
      ConfigurationMismatch: if `out / source.name` holds agents of another configuration.
    """
    folder = out / source.name
    store.check_folder(folder, source, size)
    missing = set(seeds) - store.finished_seeds(folder)
    return range(min(missing), max(missing) + 1) if missing else range(0)


def sources_of(source: Sweep, size: Size, seeds: range, out: Path, advance: Callable[[float], None]) -> Source:
    """The sources of some seeds, from `out / source.name` where they are there, else trained and kept there.

    Args:
      source: what trains them.
      size: the preset and lengths of the runs.
      seeds: the seeds.
      out: the folder with the results of all sweeps.
      advance: told how many of the expected seconds are done.

    Returns:
      Weights and demonstrations, every leaf with leading axes of points and of seeds.

    Raises:
      ConfigurationMismatch: if the folder holds agents of another configuration.
    """
    folder = out / source.name
    if missing := missing_sources(source, size, seeds, out):
        folder.mkdir(parents=True, exist_ok=True)
        _train(source, size, missing, folder, advance)
    return _load(source, size, seeds, folder)


def _train(sweep: Sweep, size: Size, seeds: range, folder: Path, advance: Callable[[float], None]) -> None:
    points = points_of(sweep, size.preset)
    logs: list[Any] = []
    agents: Any = None
    for chunk in run_block(sweep, size, points, seeds, None):
        logs.append(chunk.log)
        agents = chunk.agents["ddqn"]
        advance(chunk.episodes * seconds_per_episode(sweep, len(seeds)))
    log = jax.tree.map(lambda *parts: np.concatenate(parts, axis=-1), *logs)
    shape = (len(sweep.x_values), len(seeds))
    point, seed = (a.reshape(-1) for a in np.indices(shape))
    lanes = parallel.padded(point.size)
    key_and_point = parallel.pad_agents((keys_of(np.array(seeds)[seed]), jnp.asarray(point)), lanes)
    handed_on = _hand_on(_spec_of(points), sweep.config(size))(points, (*key_and_point, agents.learner))
    source = jax.tree.map(lambda leaf: np.asarray(leaf[: point.size]).reshape(*shape, *leaf.shape[1:]), handed_on)
    data = store.dataset(sweep, size, seeds, log, reference_of(points, size.episodes)).assign(_variables(source))
    store.write_part(folder, seeds, data)
    store.write_manifest(folder, sweep, size)


def _spec_of(points: Points) -> Spec:
    return spec_of(jax.tree.map(lambda leaf: leaf[0], points.params))


@functools.cache
def _hand_on(spec: Spec, config: Config) -> Callable:
    learner = make_learner("ddqn", spec, config)

    def one(points, agent):
        key, point, state = agent
        params, hparams = jax.tree.map(lambda a: a[point], points)
        return source_of(key, learner.policy(state), state.weights, params, hparams, config)

    return parallel.over_agents(one)


def _variables(source: Source) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """A source as named arrays: weights by their path, demonstrations by their field."""
    arrays: dict[str, tuple[tuple[str, ...], np.ndarray]] = {
        f"demonstration_{name}": (("point", "seed", "transition"), np.asarray(field))
        for name, field in source.demonstrations._asdict().items()
    }
    for path, leaf in jax.tree_util.tree_leaves_with_path(source.weights):
        name = "weights_" + "_".join(str(part.key) for part in path)
        arrays[name] = (("point", "seed", *(f"{name}_{axis}" for axis in range(leaf.ndim - 2))), np.asarray(leaf))
    return arrays


def _load(sweep: Sweep, size: Size, seeds: range, folder: Path) -> Source:
    parts = [xr.load_dataset(path, engine="h5netcdf") for path in sorted(folder.glob("seeds-*.nc"))]
    names = [name for name in parts[0].data_vars if str(name).startswith(("demonstration_", "weights_"))]
    whole = xr.concat([part[names] for part in parts], "seed").drop_duplicates("seed").sel(seed=list(seeds))
    function = q_function(_spec_of(points_of(sweep, size.preset)), sweep.config(size))
    like = jax.eval_shape(function.init, jax.random.key(0))
    weights = [
        jnp.asarray(whole["weights_" + "_".join(str(part.key) for part in path)].values)
        for path, _ in jax.tree_util.tree_leaves_with_path(like)
    ]
    fields = (jnp.asarray(whole[f"demonstration_{name}"].values) for name in NStepTransition._fields)
    return Source(jax.tree.unflatten(jax.tree.structure(like), weights), NStepTransition(*fields))
