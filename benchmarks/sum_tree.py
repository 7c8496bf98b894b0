"""Claim: 4 children per node are as fast as 8, and faster than more, for 50,000 transitions, four in a leaf.

Draws 64 leaves and gives them new values, again and again, in a block of trees on every core. Two cores of an Intel
Xeon (Sapphire Rapids) print:

    children per node   us per draw and update   (range)
                    4                     4.38   (3.73-4.99)
                    8                     4.25   (3.73-4.30)
                   16                     5.23   (4.90-5.46)
                   32                     6.17   (5.28-6.32)
"""

from __future__ import annotations

import statistics
import time

from benchmarks.measure import Result

LEAVES, BATCH = 12_500, 64


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
