"""Claim: no sweep takes more than 30 s to compile, and a second run needs a few seconds.

Each measurement is a process of its own: from the start of Python to the first compiled environment step, and for each
sweep the compiling of its program, first with an empty folder of compiled programs, then with what is there after it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time

from benchmarks.measure import Result

_FIRST_STEP = """
from jrcjax.training import parallel
parallel.use_all_cores(); parallel.keep_compiled()
import jax, jrcjax
env = jrcjax.JRCEnv()
key = jax.random.key(0)
obs, state = jax.jit(env.reset)(key)
jax.block_until_ready(jax.jit(env.step)(key, state, 0))
"""
_SWEEP = """
import sys, time
from jrcjax.training import parallel
parallel.use_all_cores(); parallel.keep_compiled()
import jax, jrcjax, numpy as np
from sweeps.engine import program
from sweeps.engine.job import Job
from sweeps.studies import registry
from sweeps.sweep import Size
sweep = registry.SWEEPS[sys.argv[1]]
job = Job(sweep, Size())
points, config = job.points, job.groups[0].config
compiled = program.program_of(sweep.learners, job.spec, config, program.chunk_of(config.episodes))
lanes = parallel.padded(1)  # of every group
source = None
if sweep.source:
    def train(key):
        return jrcjax.train_source(key, jrcjax.paper_params("source"), jrcjax.HParams(), config)[0]
    of_one = jax.eval_shape(train, jax.random.key(0))
    source = jax.tree.map(lambda a: jax.ShapeDtypeStruct((lanes, *a.shape), a.dtype), of_one)
keys = program.keys_of(np.arange(lanes))
where = jax.ShapeDtypeStruct((lanes,), "int32")
begin = time.perf_counter()
start = compiled.start.lower(points, (keys, source, where))
agents = jax.eval_shape(compiled.start, points, (keys, source, where))
start.compile()
compiled.advance.lower((points, jax.ShapeDtypeStruct((), "int32")), (agents, where)).compile()
print(time.perf_counter() - begin)
"""


def run(quick: bool) -> list[Result]:
    """Measures the first step and all sweeps, cold and warm, and prints a table."""
    from sweeps.studies.registry import SWEEPS

    print(f"{'s':>24s}{'cold':>8s}{'again':>8s}")
    with tempfile.TemporaryDirectory() as cache:
        env = os.environ | {"XDG_CACHE_HOME": cache}

        def seconds(*args: str) -> float:
            begin = time.perf_counter()
            done = subprocess.run([sys.executable, "-c", *args], check=True, capture_output=True, text=True, env=env)
            return float(done.stdout) if done.stdout else time.perf_counter() - begin

        print(f"{'import to first step':24s}{seconds(_FIRST_STEP):8.1f}{seconds(_FIRST_STEP):8.1f}", flush=True)
        for name in ("fig5b",) if quick else SWEEPS:
            print(f"{'compiling ' + name:24s}{seconds(_SWEEP, name):8.1f}{seconds(_SWEEP, name):8.1f}", flush=True)
    return []
