"""Claim: 4 children per node are the fastest for the paper's replay memory of 50,000 transitions.

Draws 64 leaves and gives them new values, again and again, in a block of trees on every core. Typical printout:

    children per node   us per draw and update   (range)
                    4                     2.73   (2.65-2.80)
                    8                     3.00   (2.72-3.11)
                   16                     3.12   (2.93-3.19)
                   32                     5.80   (5.66-5.96)
"""

from __future__ import annotations

import statistics
import time

from benchmarks.measure import Result

LEAVES, BATCH = 50_000, 64


def run(quick: bool) -> list[Result]:
    """Measures all radices, one repetition of each in turn, and prints a table."""
    from jrcjax.training import parallel

    parallel.use_all_cores()
    import jax
    import jax.numpy as jnp

    from jrcjax import rng
    from jrcjax.replay import sum_tree

    steps, trees = 1000 if quick else 5000, parallel.padded(1)

    def of(radix: int):
        layout = sum_tree.layout_of(LEAVES, radix)

        def one(_, key):
            def step(tree, words):
                indices, values, _ = sum_tree.sample(tree, words, layout)
                return sum_tree.update(tree, indices, values * (0.5 + rng.uniform(words[0])), layout), None

            words = jax.random.bits(key, (steps, sum_tree.NUM_WORDS, BATCH), jnp.uint32)
            tree = sum_tree.init(jax.random.uniform(key, (LEAVES,)) + 0.1, layout)
            return sum_tree.total(jax.lax.scan(step, tree, words)[0], layout)

        run = parallel.over_agents(one)
        keys = jax.random.split(jax.random.key(0), trees)
        return run.lower((), keys).compile(), keys

    programs = {radix: of(radix) for radix in (4, 8, 16, 32)}
    times: dict[int, list[float]] = {radix: [] for radix in programs}
    for _ in range(3 if quick else 7):
        for radix, (program, keys) in programs.items():
            begin = time.perf_counter()
            jax.block_until_ready(program((), keys))
            times[radix].append((time.perf_counter() - begin) / (trees * steps) * 1e6)
    print(f"{'children per node':>17s}{'us per draw and update':>25s}   (range)")
    for radix, us in times.items():
        print(f"{radix:17d}{statistics.median(us):25.2f}   ({min(us):.2f}-{max(us):.2f})")
    return []
