"""Claim: all figures of the paper, 10 seeds x 1000 episodes, take no longer than four Stable-Baselines3 runs of a DQN.

The figures are made in a folder of their own, with no compiled program on disk. One Stable-Baselines3 run is 300,000
steps of one agent, extrapolated from a few thousand, with all cores to itself.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time

from benchmarks.measure import Case, NotInstalled, Result, alone
from benchmarks.peers import sb3_dqn


def run(quick: bool) -> list[Result]:
    """Makes all figures (their tiny version if `quick`), and prints how long it took."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "paper_figs", "--out", out, *(["--smoke"] if quick else [])]
        begin = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=os.environ | {"XDG_CACHE_HOME": out})
        seconds = time.perf_counter() - begin
    print(f"all figures{' (tiny version)' if quick else ''}: {seconds / 60:.1f} min")
    try:
        step = alone(Case("sb3_dqn", sb3_dqn.setup, 1, 1000 if quick else 5000), 3)
    except NotInstalled as error:
        print(f"Stable-Baselines3 not measured: the package {error} is missing; `make bench` installs it")
        return []
    one_run = 300_000 * step.us_per_agent_step * 1e-6
    print(
        f"one Stable-Baselines3 run of 300,000 steps: {one_run / 60:.1f} min; the figures take {seconds / one_run:.2f}"
    )
    return [step]
