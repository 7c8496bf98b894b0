"""Claim: the replay capacity hardly changes the cost of a step.

A compiler that copies a whole memory in every step instead of writing one row shows here first: ten times the capacity
would cost about ten times as much.
"""

from __future__ import annotations

import functools

from benchmarks import ours
from benchmarks.measure import Case, Result, in_turns, print_table


def run(quick: bool) -> list[Result]:
    """Measures three capacities in turns, and prints a table."""
    capacities = (30_000, 50_000, 300_000)
    cases = [
        Case(f"{name} {capacity}", functools.partial(ours.learner, name, replay_capacity=capacity), 32, steps)
        for name, steps in (("ddqn", 3000), ("tlwd", 1500))
        for capacity in capacities
    ]
    results, failed = in_turns(cases, 3 if quick else 7)
    print_table(results, failed)
    if failed:
        return results
    for first in (0, len(capacities)):
        ratio = results[first + 2].us_per_agent_step / results[first].us_per_agent_step
        print(f"{cases[first].name.split()[0]}: ten times the capacity costs {ratio:.2f} times as much")
    return results
