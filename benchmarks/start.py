"""Claim: set-up takes less than 60 s with pip alone, and so does the tiny version of all figures with nothing compiled.

From import to the first trained episode it takes less than 5 s, and less than 2 s from then on. All but set-up is
measured in processes of their own, first with an empty folder of compiled programs, then with what is there after it.
Of the two programs that serve all figures compiling alone is timed.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.measure import Result

_ROOT = Path(__file__).parents[1]
_ENVIRONMENT = """
from jrcjax.training import parallel
parallel.start()
import functools, jax, jrcjax
env, key, params = jrcjax.JRCEnv(), jax.random.key(0), jrcjax.paper_params("target")
"""
_PARTS = {
    "import": "import jrcjax",
    "import to placements": _ENVIRONMENT,
    "import to first step": _ENVIRONMENT
    + """
obs, state = jax.jit(env.reset)(key)
jax.block_until_ready(jax.jit(env.step)(key, state, 0))
""",
    "import to first episode": _ENVIRONMENT
    + """
train = functools.partial(jrcjax.train, learner="ddqn", config=jrcjax.Config(episodes=1))
jax.block_until_ready(jax.jit(train)(key, params))
""",
}
"""What a process runs, all of which counts."""
_SWEEPS = ("fig5b", "fig5a")  # whose programs serve all other figures
_SWEEP = """
import sys, time
from jrcjax.training import parallel
parallel.start()
import jax, jrcjax, numpy as np
from sweeps.engine import program
from sweeps.engine.job import Job
from sweeps.studies import registry
from sweeps.sweep import Size
sweep = registry.SWEEPS[sys.argv[1]]
job = Job(sweep, Size())
points, config = job.table, job.groups[0].config
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
compiled = program.program_of(sweep.learners, job.spec, config, program.chunk_of(config.episodes))
lane = keys, source, where
compiled.start.lower(points, lane).compile()
agents = jax.eval_shape(compiled.start, points, lane)
compiled.advance.lower((points, jax.ShapeDtypeStruct((), "int32")), (agents, where)).compile()
print(time.perf_counter() - begin)
"""


def run(quick: bool) -> list[Result]:
    """Measures all parts, cold and warm, and prints a table; a quick run leaves set-up and most sweeps out."""
    if not quick:
        print(f"{'set-up with pip':28s}{_set_up():8.1f} s", flush=True)
    print(f"{'s':>28s}{'cold':>8s}{'again':>8s}")
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, code) in enumerate(_PARTS.items()):
            _row(name, Path(folder, str(number)), "-c", code)
        _row("all figures, tiny version", Path(folder, "figures"), "-m", "paper_figs", "--smoke", "--out")
        for name in _SWEEPS[:1] if quick else _SWEEPS:
            _row(f"compiling {name}", Path(folder, "sweeps"), "-c", _SWEEP, name)
    return []


def _row(name: str, cache: Path, *args: str) -> None:
    """Prints how long Python takes with a folder of compiled programs as it is, and again.

    If the process prints a number of seconds, that counts; after `--out` it is given a new folder each time.
    """
    print(f"{name:28s}", end="", flush=True)
    for repetition in ("cold", "again"):
        out = [str(cache / repetition)] if args[-1] == "--out" else []
        env = os.environ | {"XDG_CACHE_HOME": str(cache)}
        begin = time.perf_counter()
        command = [sys.executable, *args, *out]
        done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=_ROOT, env=env)
        seconds = time.perf_counter() - begin if out or not done.stdout else float(done.stdout)
        print(f"{seconds:8.1f}", end="" if repetition == "cold" else "\n", flush=True)


def _set_up() -> float:
    """Seconds of `make setup` in a copy of this checkout, where no uv is found."""
    with tempfile.TemporaryDirectory() as folder:
        copy, tools = Path(folder, "copy"), Path(folder, "tools")
        shutil.copytree(_ROOT, copy, ignore=shutil.ignore_patterns(".*", "published", "out", "site"), symlinks=True)
        path = os.environ.get("PATH", os.defpath).split(os.pathsep)
        clean = [entry for entry in path if not Path(entry, "uv").exists()] + [str(tools)]
        tools.mkdir()
        for tool in ("make", "sh", "rm", "touch", "git"):  # which may lie beside uv
            if found := shutil.which(tool):
                (tools / tool).symlink_to(found)
        begin = time.perf_counter()
        interpreter = f"PYTHON={Path(sys.base_prefix, 'bin', 'python3')}"
        env = os.environ | {"PATH": os.pathsep.join(clean)}
        subprocess.run(["make", "--silent", "setup", interpreter], check=True, cwd=copy, env=env)
        return time.perf_counter() - begin
