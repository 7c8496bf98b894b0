"""Environments in other processes, each case a program of its own: python processes.py CASE.

Starting a process by fork needs one that has run JAX and may be left hanging; by spawn, functions that it can import. A
case prints what its workers return.
"""

import json
import multiprocessing
import os
import sys
from pathlib import Path

import gymnasium
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from tiny import tiny_params

from jrcjax.adapters import GymnasiumEnv
from jrcjax.training import parallel

ACTIONS = (0, 3, 4, 1) * 15  # three episodes


def rewards_of(env, seed=5):
    """Rewards of ACTIONS, with a reset wherever an episode ends."""
    env.reset(seed=seed)
    rewards = []
    for action in ACTIONS:
        _, reward, terminated, truncated, _ = env.step(action)
        rewards.append(float(reward))
        if terminated or truncated:
            env.reset()
    return rewards


def vector_rewards(**settings):
    """Of two environments in processes, seeds 5 and 6."""
    envs = gymnasium.make_vec("jrcjax/JRC-target-v0", num_envs=2, vectorization_mode="async", **settings)
    envs.reset(seed=5)
    rewards = [envs.step(np.array([action] * 2))[1].tolist() for action in ACTIONS[:20]]
    envs.close()
    return rewards


def made_in_child(params):
    """What making an environment in this process leads to."""
    try:
        return rewards_of(GymnasiumEnv(params))
    except RuntimeError as error:
        return str(error)


def made_by_id_in_child(name):
    """Whether an id makes an environment in this process, or what it leads to."""
    try:
        return isinstance(gymnasium.make(name).unwrapped, GymnasiumEnv)
    except RuntimeError as error:
        return str(error)


def picture_in_child(env):
    """What drawing in this process leads to."""
    try:
        return env.render().shape
    except RuntimeError as error:
        return str(error)


def in_child(method, function, argument):
    """What a function returns in a child process."""
    with multiprocessing.get_context(method).Pool(1) as pool:
        return pool.apply(function, (argument,))


def fork():
    """All that a forked process may and may not do, after JAX has run."""
    params = tiny_params()
    env = GymnasiumEnv(params, render_mode="rgb_array")
    env.reset(seed=0)
    fresh = params.replace(radar=params.radar.replace(placements="fresh"))
    new = params.replace(reward_weights=2 * params.reward_weights)
    GymnasiumEnv()
    return {
        "here": rewards_of(env),
        "async": vector_rewards(params=params),
        "pickled": in_child("fork", rewards_of, env),
        "made": in_child("fork", made_in_child, env.params),
        "by_id": [in_child("fork", made_by_id_in_child, f"jrcjax/JRC-{name}v0") for name in ("", "target-")],
        "picture": in_child("fork", picture_in_child, env),
        "new": in_child("fork", made_in_child, jax_free(new)),
        "fresh": in_child("fork", made_in_child, jax_free(fresh)),
    }


def jax_free(params):
    """The parameters with NumPy's arrays, which can be unpickled without JAX."""
    import jax

    return jax.tree.map(np.asarray, params)


def before_jax():
    """A forked process whose parent has not run JAX runs it itself."""
    pid = os.fork()
    if pid == 0:
        ok = len(rewards_of(GymnasiumEnv(tiny_params()))) == len(ACTIONS)
        os._exit(0 if ok else 1)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def spawn():
    """Spawned processes are given an environment, or an id and parameters."""
    env = GymnasiumEnv(tiny_params())
    return {
        "here": rewards_of(env),
        "pickled": in_child("spawn", rewards_of, env),
        "async": vector_rewards(params=tiny_params(), vector_kwargs={"context": "forkserver"}),
    }


def stable_baselines3():
    """Its vector of forked environments, made by id; rewards of the first."""
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.vec_env import SubprocVecEnv

    env, settings = GymnasiumEnv(tiny_params()), {"params": tiny_params()}
    vector = make_vec_env(
        "jrcjax/JRC-target-v0", 2, 5, env_kwargs=settings, vec_env_cls=SubprocVecEnv,
        vec_env_kwargs={"start_method": "fork"},
    )  # fmt: skip
    vector.reset()
    forked = [float(vector.step(np.array([action] * 2))[1][0]) for action in ACTIONS[:20]]
    vector.close()
    return {"here": rewards_of(env)[:20], "forked": forked}


def torch():
    """A data set that steps an environment, in a loader's forked worker."""
    from torch.utils.data import DataLoader, IterableDataset

    class Rewards(IterableDataset):
        def __init__(self, env):
            self.env = env

        def __iter__(self):
            return iter(rewards_of(self.env))

    env = GymnasiumEnv(tiny_params())
    loader = DataLoader(Rewards(env), batch_size=None, num_workers=1, multiprocessing_context="fork")
    return {"here": rewards_of(env), "forked": [float(reward) for reward in loader]}


CASES = {"fork": fork, "before_jax": before_jax, "spawn": spawn, "stable_baselines3": stable_baselines3, "torch": torch}

if __name__ == "__main__":
    parallel.keep_compiled()
    print(json.dumps(CASES[sys.argv[1]]()))
