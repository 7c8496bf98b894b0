"""Claim: an agent-step costs the same from 64 agents to 4096, and 4096 TLwD agents with the paper's replay memory fit
into 6 GB.

Each number of agents runs in a process of its own, so that its peak memory is its own.
"""  # noqa: D205

from __future__ import annotations

import functools

from benchmarks import ours
from benchmarks.measure import Case, NotMeasured, Result, alone, header, row


def run(quick: bool) -> list[Result]:
    """Measures all numbers of agents on one device and on all, and prints a table."""
    counts = (1, 64, 256) if quick else (1, 16, 64, 256, 1024, 4096)
    results = []
    header()
    for name in ("ddqn", "tlwd"):
        for devices in (1, None):
            for agents in counts:
                label = f"{name}, {'1 device' if devices else 'all'}"
                episodes = max(1, (640 if quick else 5120) // max(agents, 64))
                setup = functools.partial(ours.learner, name, devices=devices)
                try:
                    results.append(alone(Case(label, setup, agents, 300 * episodes), 3))
                    row(results[-1])
                except NotMeasured as error:  # such as for lack of memory, which the other numbers may have
                    print(f"{label:20s}{agents:7d} not measured: {error}", flush=True)
        _print_memory(name, [result for result in results if result.case == f"{name}, all"])
    return results


def _print_memory(name: str, results: list[Result]) -> None:
    """Prints what an agent takes, by the two largest numbers of agents."""
    if len(results) > 1:
        few, many = results[-2:]
        per_agent = (many.peak_rss_mb - few.peak_rss_mb) / (many.agents - few.agents)
        print(f"{name}: {per_agent:.2f} MB per agent")
