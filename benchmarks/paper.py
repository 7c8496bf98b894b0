"""Claim: all figures of the paper, 10 seeds x 1000 episodes, take no longer than two Stable-Baselines3 runs of a DQN.

The figures are made in a folder of their own, with no compiled program on disk. One Stable-Baselines3 run is 300,000
steps of one agent, extrapolated from a few thousand, with all cores to itself. A table tells what is computed beyond
the work asked for: lanes that fill up blocks, on machines of several sizes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.measure import Case, NotMeasured, Result, alone
from benchmarks.peers import sb3_dqn

LIMIT = 2.0
"""Runs of Stable-Baselines3 that the claim allows."""
_CORES = (2, 16, 64)
_SEEDS = 10


def run(quick: bool) -> list[Result]:
    """Makes all figures (their tiny version if `quick`), and prints how long it took, and lanes used and asked for."""
    _print_lanes()
    seconds = _seconds_of_figures(quick)
    print(f"all figures{' (tiny version)' if quick else ''}: {seconds / 60:.1f} min")
    try:
        step = alone(Case("sb3_dqn", sb3_dqn.setup, 1, 1000 if quick else 5000), 3)
    except NotMeasured as error:
        print(f"Stable-Baselines3 not measured: {error}")
        return []
    one_run = 300_000 * step.us_per_agent_step * 1e-6
    print(f"one Stable-Baselines3 run of 300,000 steps: {one_run / 60:.1f} min")
    runs = seconds / one_run
    held = "" if quick else "holds: " if runs <= LIMIT else "DOES NOT HOLD: "
    print(f"at most {LIMIT:g} such runs for the figures: {held}{runs:.2f}")
    return [step]


def _seconds_of_figures(quick: bool) -> float:
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "paper_figs", "--out", out, *(["--smoke"] if quick else [])]
        begin = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=os.environ | {"XDG_CACHE_HOME": out})
        return time.perf_counter() - begin


def lanes_of(points: int, seeds: int, cores: int) -> tuple[int, int]:
    """Lanes of a learner that so many cores advance, and those asked for."""
    from jrcjax.training import parallel
    from sweeps.engine.bundle import parts_for

    devices = max(cores, 2)
    used = (parallel.padded(points * part, parallel.BLOCK, devices) for part in parts_for(points, seeds, devices))
    return sum(used), points * seeds


def _print_lanes() -> None:
    from sweeps.engine.plan import plan
    from sweeps.studies.registry import SWEEPS
    from sweeps.sweep import Size

    with tempfile.TemporaryDirectory() as empty:
        figures = [sweep for name, sweep in SWEEPS.items() if name.startswith("fig")]
        bundles = plan(figures, Size(seeds=_SEEDS), Path(empty))
    print(f"lanes per learner for {_SEEDS} seeds, used / asked for")
    for bundle in bundles:
        of_cores = {cores: "{} / {}".format(*lanes_of(len(bundle.job.sweep.design), _SEEDS, cores)) for cores in _CORES}
        told = ", ".join(f"{lanes} on {cores} cores" for cores, lanes in of_cores.items())
        print(f"  {bundle.job.sweep.name}: {told}")
