"""Claim: one DDQN agent-step costs less than 1/80 of rejax's, 1/300 of Stable-Baselines3's on both cores, and 1/10 of
what one writes with flashbax, linen and optax; TLwD's costs less than 2.5 times DDQN's, and less than 1/15 of the same
algorithm on flashbax's buffer.

All on the paper's source environment, with Table I's sizes, an update in every step, and full memories. Every case runs
in a process of its own, compiled and warmed up before the first measurement; then one repetition of each in turn. Peers
run at the best of several numbers of agents; those in JAX run with XLA as it is, and again, as NAME_flags, with the
flags that this package sets (not in a quick run). The numbers of a run are in
docs/explanation/performance.md.
"""  # noqa: D205

from __future__ import annotations

import functools
import os
import statistics
from collections.abc import Callable, Sequence
from typing import NamedTuple

from benchmarks import ours
from benchmarks.measure import Case, NotMeasured, Ready, Result, alone, in_turns, print_table, spread
from benchmarks.peers import flashbax_dqn, purejaxrl_dqn, rejax_dqn, sb3_dqn

RATIOS = (
    ("ddqn", "rejax_dqn"),
    ("ddqn", "sb3_dqn"),
    ("ddqn", "flashbax_dqn"),
    ("ddqn", "purejaxrl_dqn"),
    ("tlwd", "flashbax_tlwd"),
    ("ddqn", "tlwd"),
)


class Peer(NamedTuple):
    """A peer's cases, of which the fastest counts."""

    candidates: tuple[Case, ...]
    """The first is taken in a quick run."""
    in_jax: bool = True


def with_flags(setup: Callable[[int, int], Ready], agents: int, steps: int) -> Ready:
    """A peer with the XLA flags that this package sets, on one device as without them.

    All but one: fusion with several results, with which XLA ends the process while it compiles any of the peers.
    """
    from jrcjax.training import parallel

    parallel.set_flags()
    os.environ["XLA_FLAGS"] = os.environ["XLA_FLAGS"].replace(",xla_cpu_use_multi_output_fusion=true", "")
    return setup(agents, steps)


def cases(quick: bool) -> list[Case | Peer]:
    """What is measured."""
    long = 10 if quick else 100
    short = 1 if quick else 4

    def peer(name, setup, sizes):
        return Peer(tuple(Case(name, setup, agents, steps * short) for agents, steps in sizes))

    return [
        Case("env", ours.environment, 1024, 100 * long),
        Case("q_learning", ours.q_learning, 64, 300 * long),
        Case("ddqn", ours.ddqn, 64, 300 * long),
        Case("tlwd", ours.tlwd, 64, 300 * long // 2),
        peer("rejax_dqn", rejax_dqn.setup, ((8, 300), (4, 600), (16, 150), (64, 50))),
        Peer((Case("sb3_dqn", sb3_dqn.setup, 1, 500 * short, processes=2),), in_jax=False),
        peer("flashbax_dqn", flashbax_dqn.double_dqn, ((64, 200), (16, 800), (128, 100), (256, 50))),
        peer("purejaxrl_dqn", purejaxrl_dqn.setup, ((16, 400), (4, 800), (64, 100))),
        peer("flashbax_tlwd", flashbax_dqn.tlwd, ((16, 200), (8, 400), (64, 50))),
    ]


def fastest(candidates: Sequence[Case], quick: bool) -> Case:
    """The best case of a peer; the first if `quick`, or if none can be measured."""
    if quick or len(candidates) == 1:
        return candidates[0]
    results = {}
    for case in candidates:
        try:
            results[case] = alone(case, 2).us_per_agent_step
        except NotMeasured as error:
            print(f"{case.name}, {case.agents} agents: {error}", flush=True)
    tried = ", ".join(f"{case.agents}: {us:.0f}" for case, us in results.items())
    print(f"{candidates[0].name}: us per agent-step with so many agents: {tried}", flush=True)
    return min(results, key=results.__getitem__, default=candidates[0])


def _as_run(case: Case | Peer, quick: bool) -> list[Case]:
    """The case itself, or a peer's best one without our flags and its best one with them."""
    if isinstance(case, Case):
        return [case]
    ways = [case.candidates]
    if case.in_jax and not quick:
        ways.append(
            tuple(
                one._replace(name=f"{one.name}_flags", setup=functools.partial(with_flags, one.setup))
                for one in ways[0]
            )
        )
    return [fastest(candidates, quick) for candidates in ways]


def run(quick: bool) -> list[Result]:
    """Measures all cases and prints a table and ratios."""
    chosen = [one for case in cases(quick) for one in _as_run(case, quick)]
    results, failed = in_turns(chosen, 3 if quick else 9)
    print_table(results, failed)
    by_name = {result.case: result for result in results}
    print("\nus per agent-step of the second, divided by the first's")
    for first, second in [(a, name) for a, b in RATIOS for name in (b, b + "_flags")]:
        if first in by_name and second in by_name:
            a, b = by_name[first].us_each, by_name[second].us_each
            ratios = [y / x for x, y in zip(a, b, strict=True)]
            print(f"{first + ' : ' + second:28s}{spread(ratios)}")
    if "ddqn" in by_name:
        seconds = 300_000 * statistics.median(by_name["ddqn"].us_each) * 1e-6
        print(f"\na DDQN agent of the paper (1000 episodes of 300 slots) costs {seconds:.2f} s of this machine")
    return results
