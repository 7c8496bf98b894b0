"""Claim: a million environment slots take less than a second and 64 DDQN agents of 300,000 slots less than three
minutes, on two cores.

Each case runs in a process of its own, so that its peak memory is its own. A case is compiled once, warmed up, and then
timed over several repetitions; the median counts, the range shows the noise of the machine. Typical printout:

    case        agents  us/agent-step  (range)       compile s  peak MB
    env           1024          0.084  (0.08-0.09)         1.1      436
    q_learning      64          0.344  (0.34-0.39)         4.4      485
    ddqn            64          5.623  (5.59-5.75)         7.2      546
"""  # noqa: D205

from __future__ import annotations

import dataclasses
import functools
import multiprocessing
import resource
import statistics
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Result:
    """One measured case."""

    case: str
    agents: int
    us_per_agent_step: float
    """Median over repetitions: wall time / (agents x steps)."""
    us_low: float
    us_high: float
    compile_s: float
    """Tracing and compiling, with no cache on disk."""
    peak_rss_mb: float
    """Largest resident memory of the process."""
    steps_per_agent: int
    """In one repetition."""
    repetitions: int


def _measure(case: str, agents: int, steps: int, repetitions: int, lower: Callable[[], Any], args: Callable) -> Result:
    """Times a compiled function; `args(i)` gives the arguments of repetition i."""
    import jax

    begin = time.perf_counter()
    compiled = lower().compile()
    compile_s = time.perf_counter() - begin
    jax.block_until_ready(compiled(*args(0)))
    times = []
    for i in range(1, repetitions + 1):
        ready = jax.block_until_ready(args(i))
        begin = time.perf_counter()
        jax.block_until_ready(compiled(*ready))
        times.append((time.perf_counter() - begin) / (agents * steps) * 1e6)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return Result(case, agents, statistics.median(times), min(times), max(times), compile_s, peak, steps, repetitions)


def _environment(agents: int, steps: int, repetitions: int) -> Result:
    """Slots of the public environment under random actions, automatic reset included."""
    import jax
    import jax.numpy as jnp

    import jrcjax
    from jrcjax import parallel

    env, params = jrcjax.JRCEnv(), jrcjax.paper_params("target")
    space = env.action_space(params)

    def one(params, key):
        def step(carry, i):
            state, total = carry
            act_key, step_key = jax.random.split(jax.random.fold_in(key, i))
            _, state, reward, _, _, _ = env.step(step_key, state, space.sample(act_key), params)
            return (state, total + reward), None

        _, state = env.reset(key, params)
        return jax.lax.scan(step, (state, jnp.float32(0.0)), jnp.arange(steps))[0][1]

    run = parallel.over_agents(one, block=512)
    keys = lambda i: jax.random.split(jax.random.key(i), agents)  # noqa: E731
    return _measure("env", agents, steps, repetitions, lambda: run.lower(params, keys(0)), lambda i: (params, keys(i)))


def _learner(name: str, agents: int, steps: int, repetitions: int) -> Result:
    """A learner's whole training at the paper's sizes: acting, environment, replay, update, log.

    TLwD is given demonstrations and goes without pre-training, so that a step is one of its online steps.
    """
    import jax

    import jrcjax
    from jrcjax import parallel

    params = jrcjax.paper_params("source")
    config = jrcjax.Config(episodes=max(steps // params.max_steps_in_episode, 1), pretraining=0)
    steps = config.episodes * params.max_steps_in_episode
    source = None
    if name == "tlwd":
        brief = dataclasses.replace(config, episodes=1)
        source, _ = jrcjax.train_source(jax.random.key(0), params, jrcjax.HParams(), brief)

    def one(shared, key):
        params, source = shared
        return jrcjax.train(key, params, learner=name, config=config, source=source)[1]

    run = parallel.over_agents(one)
    shared = (params, source)
    keys = lambda i: jax.random.split(jax.random.key(i), agents)  # noqa: E731
    return _measure(name, agents, steps, repetitions, lambda: run.lower(shared, keys(0)), lambda i: (shared, keys(i)))


CASES: dict[str, Callable[[int, int, int], Result]] = {
    "env": _environment,
    "q_learning": functools.partial(_learner, "q_learning"),
    "ddqn": functools.partial(_learner, "ddqn"),
    "tlwd": functools.partial(_learner, "tlwd"),
}


def _in_this_process(case: str, agents: int, steps: int, repetitions: int) -> Result:
    from jrcjax import parallel

    parallel.use_all_cores()
    return CASES[case](agents, steps, repetitions)


def run(quick: bool) -> list[dict[str, Any]]:
    """Measures all cases, each in a fresh process, and prints a table."""
    sizes = {"env": (1024, 1000), "q_learning": (64, 6_000), "ddqn": (64, 6_000), "tlwd": (64, 6_000)}
    if not quick:
        sizes |= {"env": (1024, 10_000), "q_learning": (64, 300_000), "ddqn": (64, 300_000), "tlwd": (64, 300_000)}
    repetitions = {"env": 5, "q_learning": 3, "ddqn": 3 if quick else 1, "tlwd": 3 if quick else 1}
    print(f"{'case':12s}{'agents':>6s}{'us/agent-step':>15s}  {'(range)':14s}{'compile s':>9s}{'peak MB':>9s}")
    results = []
    for case, (agents, steps) in sizes.items():
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
            r = pool.submit(_in_this_process, case, agents, steps, repetitions[case]).result()
        spread = f"({r.us_low:.2f}-{r.us_high:.2f})"
        print(
            f"{r.case:12s}{r.agents:6d}{r.us_per_agent_step:15.3f}  {spread:14s}{r.compile_s:9.1f}{r.peak_rss_mb:9.0f}"
        )
        steps = r.agents * r.steps_per_agent
        print(f"{'':12s}{steps:,} steps in {r.us_per_agent_step * steps / 1e6:.2f} s")
        results.append(asdict(r))
    return results
