"""Claim: the dense products of one update, on their own, take more than half of a DDQN step.

Each product of the paper's network (hidden layers of 24) on all 32 states runs alone, batched over the agents of a
block as in training, on all devices. In another form it may be faster or slower: these are the forms that are used.
"""

from __future__ import annotations

import statistics
import time

from benchmarks import ours
from benchmarks.measure import Case, Result, alone

PRODUCTS = {
    "W1 X": (24, 5, 32),
    "W2 H1": (24, 24, 32),
    "W3 H2": (4, 24, 32),
    "G H2'": (4, 32, 24),
    "W3' G": (24, 4, 32),
    "D2 H1'": (24, 32, 24),
    "W2' D2": (24, 24, 32),
    "D1 X'": (24, 32, 6),
}
"""Of [n, k] and [k, m], as (n, k, m); a prime is a transpose."""


def run(quick: bool) -> list[Result]:
    """Measures all products and a DDQN step, and prints a table."""
    from jrcjax.training import parallel

    parallel.use_all_cores()
    import jax
    import jax.numpy as jnp

    from jrcjax.learners.networks import product

    agents, steps = parallel.BLOCK * jax.device_count(), 1000 if quick else 4000

    def program(n: int, k: int, m: int):
        def one(_, factors):
            a, b = factors

            def step(carry, _):
                a, c = carry
                # The result of the step before changes a factor, so that no step can be left out.
                return (a.at[0, 0].set(c[0, 0] * 1e-9), product(a, b)), None

            return jax.lax.scan(step, (a, jnp.zeros((n, m))), length=steps)[0][1]

        key = jax.random.key(0)
        factors = jax.random.normal(key, (agents, n, k)), jax.random.normal(key, (agents, k, m))
        return parallel.over_agents(one).lower((), factors).compile(), factors

    programs = {name: program(*sizes) for name, sizes in PRODUCTS.items()}
    times: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(3 if quick else 7):
        for name, (compiled, factors) in programs.items():
            begin = time.perf_counter()
            jax.block_until_ready(compiled((), factors))
            times[name].append((time.perf_counter() - begin) / (agents * steps) * 1e6)
    print(f"{'product':10s}{'n x k x m':>14s}{'us per agent':>14s}{'GFLOP/s':>9s}")
    total, flops = 0.0, 0
    for name, (n, k, m) in PRODUCTS.items():
        us = statistics.median(times[name][1:])
        total, flops = total + us, flops + 2 * n * k * m
        print(f"{name:10s}{f'{n} x {k} x {m}':>14s}{us:14.3f}{2e-3 * n * k * m / us:9.0f}")
    print(f"{'all':10s}{'':14s}{total:14.3f}{1e-3 * flops / total:9.0f}")
    step = alone(Case("ddqn", ours.ddqn, 64, 3000), 3 if quick else 7)
    share = total / step.us_per_agent_step
    print(f"a DDQN step takes {step.us_per_agent_step:.2f} us per agent; its products alone are {share:.0%} of it")
    return [step]
