"""Claim: on an accelerator a slot takes as long for a thousand agents as for 64, with a CPU's results to rounding.

DDQN and TLwD with full memories, as in `throughput`, beside the same learners on two cores of this machine. Then the
first episodes of 16 agents on both.
"""

from __future__ import annotations

import functools
import os
from concurrent.futures import ThreadPoolExecutor

from benchmarks import ours
from benchmarks.measure import Case, Ready, Result, Running, header, row, spread

LEARNERS = ("ddqn", "tlwd")
_EPISODES = 3  # that are compared


def on_two_cores(name: str, agents: int, steps: int) -> Ready:
    """A learner on two cores, whatever accelerator there is."""
    os.environ["JAX_PLATFORMS"] = "cpu"
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:2])
    return ours.learner(name, agents, steps)


def on_accelerator(name: str, agents: int, steps: int) -> Ready:
    """A learner on the accelerator, which other processes use, too."""
    os.environ["XLA_PYTHON_CLIENT_PREALLOCATE"] = "false"
    return ours.learner(name, agents, steps)


def _cases(quick: bool) -> list[list[Case]]:
    """Cases in rounds; those of a round are ready at the same time, so the largest ones have rounds of their own."""
    sizes = (64, 256) if quick else (64, 512, 4096)
    small = [
        Case(f"{name}, accelerator", functools.partial(on_accelerator, name), agents, 300)
        for name in LEARNERS
        for agents in sizes
    ]
    cores = [Case(f"{name}, two cores", functools.partial(on_two_cores, name), 64, 3000) for name in LEARNERS]
    if quick:
        return [cores + small]
    large = [[Case(f"{name}, accelerator", functools.partial(on_accelerator, name), 32768, 300)] for name in LEARNERS]
    return [cores + small, *large]


def _measured(cases: list[Case], repetitions: int) -> list[Result]:
    """The same as `in_turns`, but cases compile at the same time: an accelerator's host has cores enough."""
    with ThreadPoolExecutor(len(cases)) as pool:
        running = list(pool.map(Running, cases))
    try:
        for _ in range(repetitions):
            for one in running:
                one.repeat()
        return [one.result() for one in running]
    finally:
        for one in running:
            one.stop()


def run(quick: bool) -> list[Result]:
    """Measures all numbers of agents, and prints a table, the memory of an agent and what differs from a CPU."""
    import jax

    device = jax.devices()[0]
    print(f"{device.platform}: {device.device_kind}")
    header()
    results = []
    for cases in _cases(quick):
        for result in _measured(cases, 3):
            results.append(result)
            row(result)
    by_name = {(r.case, r.agents): r for r in results}
    for name in LEARNERS:
        cores = by_name[f"{name}, two cores", 64]
        mine = [r for r in results if r.case == f"{name}, accelerator"]
        print(f"{name}: agents per second and slot of two cores: {1e6 / cores.us_per_agent_step:.3g}")
        for r in mine:
            faster = [a / b for a, b in zip(cores.us_each, r.us_each, strict=True)]
            print(f"  {r.agents:6d} agents: {1e6 / r.us_per_agent_step:9.3g}, two cores' times {spread(faster)}")
        grown = (mine[-1].peak_rss_mb - mine[0].peak_rss_mb) / (mine[-1].agents - mine[0].agents)
        print(f"  {grown:.2f} MB per agent")
    for name in LEARNERS:
        print(f"{name}: largest difference from the CPU, relative to the largest value: {_differences(name)}")
    return results


def _differences(name: str) -> str:
    """By episode, the largest difference of what 16 agents earn, and that of their weights after the first episode."""
    import jax
    import jax.numpy as jnp
    import numpy as np

    import jrcjax
    from jrcjax.training.rollout import init_agent, learner_for, run_episodes

    params, hparams = jrcjax.paper_params("source"), jrcjax.HParams()
    config = jrcjax.Config(pretraining=0, replay_capacity=2000, demonstrations=500, episodes=1)
    rule = learner_for(name, params, config)

    def one(key):
        source = jrcjax.train_source(key, params, hparams, config)[0] if rule.needs_source else None
        agent = init_agent(key, hparams, rule, source)
        first, _ = run_episodes(agent, jnp.int32(0), 1, params, hparams, rule)
        _, log = run_episodes(agent, jnp.int32(0), _EPISODES, params, hparams, rule)
        return first.learner.weights, log.reward

    def on(device):
        with jax.default_device(device):
            return jax.device_get(jax.jit(jax.vmap(one))(jax.random.split(jax.random.key(0), 16)))

    (weights, reward), (cpu_weights, cpu_reward) = on(jax.devices()[0]), on(jax.devices("cpu")[0])
    pairs = zip(jax.tree.leaves(weights), jax.tree.leaves(cpu_weights), strict=True)
    of_weights = max(np.abs(a - b).max() / np.abs(b).max() for a, b in pairs)
    of_reward = np.abs(reward - cpu_reward).max(axis=0) / np.abs(cpu_reward).max()
    rewards = ", ".join(f"{difference:.1e}" for difference in of_reward)
    return f"weights after one episode {of_weights:.1e}; reward of episodes 1 to {_EPISODES} {rewards}"
