"""A sweep on a local Dask cluster gives the bits of a local run, also when it loses a worker."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from jrcjax import load_agent
from jrcjax.provenance import command, version_of
from sweeps.__main__ import main
from sweeps.engine.distributed import share
from sweeps.engine.workers import Watch
from sweeps.results import parts, store
from sweeps.results.agents import agents_path

ROOT = Path(__file__).parents[2]
ARGUMENTS = ["run", "fig5a", "--episodes", "2", "--seeds", "160"]


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_the_results_of_a_local_run(tmp_path):
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    import psutil

    command = [sys.executable, "-m", "sweeps", *ARGUMENTS, "--out"]
    # On the cores of one worker, which then finds its program compiled.
    on = share(sorted(os.sched_getaffinity(0)), 0, 2) if hasattr(os, "sched_setaffinity") else None
    pin = f"os.sched_setaffinity(0, {on}); " if on else ""
    here = f"import os, sys; {pin}from sweeps.__main__ import main; sys.exit(main(sys.argv[1:]))"
    local = [sys.executable, "-c", here, *ARGUMENTS, "--out", str(tmp_path / "local")]
    subprocess.run(local, cwd=ROOT, check=True, capture_output=True)
    process = subprocess.Popen([*command, str(tmp_path / "dask"), "--workers", "2"], cwd=ROOT, stderr=subprocess.PIPE)
    while process.poll() is None and not list(tmp_path.glob("dask/fig5a/*.nc")):
        time.sleep(0.005)
    assert process.poll() is None, process.communicate()
    workers = [c for c in psutil.Process(process.pid).children() if "spawn_main" in " ".join(c.cmdline())]
    assert len(workers) == 2
    workers[0].kill()
    _, said = process.communicate()
    assert process.returncode == 0, said.decode()
    assert all("sweeps run fig5a" in part.provenance["command"] for part in parts.parts_of(tmp_path / "dask" / "fig5a"))
    local, dask = (parts.parts_of(tmp_path / name / "fig5a") for name in ("local", "dask"))
    assert [(part.path.name, part.digest) for part in dask] == [(part.path.name, part.digest) for part in local]


@pytest.mark.slow
def test_a_sweep_that_transfers_runs_on_a_scheduler_that_is_there(tmp_path):
    distributed = pytest.importorskip("distributed", reason="the extra dask is not installed")
    transfer = ["run", "fig9", "--smoke", "--save-agents"]
    # In a process of its own: this one may have compiled for other devices before.
    local = [sys.executable, "-m", "sweeps", *transfer, "--out", str(tmp_path / "local")]
    subprocess.run(local, cwd=ROOT, check=True, capture_output=True)
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster:
        there = ["--scheduler", cluster.scheduler_address, "--out", str(tmp_path / "dask")]
        assert main([*transfer, *there]) == 0  # trains its source agents there
        shutil.rmtree(tmp_path / "dask" / "fig9")
        assert main([*transfer, *there]) == 0  # sends source agents there
    which = {"learner": "tlwd", "point": 1, "seed": 1}
    here, back = (load_agent(agents_path(tmp_path / where / "fig9", range(2)), **which) for where in ("local", "dask"))
    np.testing.assert_array_equal(here.policy(), back.policy())
    assert back.provenance["command"] == command()  # of this process, not of the worker
    for name in ("fig9", "source"):
        local, dask = (store.load(tmp_path / where / name, 2) for where in ("local", "dask"))
        xr.testing.assert_equal(local, dask)


class Cluster:
    """A client of a cluster whose workers are told, one set for each look."""

    scheduler = SimpleNamespace(address="tcp://here:1")

    def __init__(self, *looks: tuple[str, ...], versions: dict | None = None, lacking: tuple[str, ...] = ()):
        self._looks, self._versions, self._lacking = list(looks), versions or {}, list(lacking)

    def nthreads(self) -> dict[str, int]:
        return dict.fromkeys(self._looks.pop(0), 1)

    def run(self, function, workers, on_error):
        return dict.fromkeys(workers, self._lacking or function())

    def get_versions(self, packages):
        return {"workers": {"a": {"packages": {p: self._versions.get(p, version_of(p)) for p in packages}}}}


def test_waiting_for_workers_is_told_and_ends():
    said, times = [], iter([0.0, 10.0, 31.0, 50.0, 70.0, 200.0])
    watch = Watch(Cluster((), (), (), ("a", "b"), (), (), ()), 100.0, said.append, clock=lambda: next(times))
    assert [watch.look() for _ in range(6)] == [0, 0, 0, 2, 0, 0]
    assert said == [
        "workers: none at tcp://here:1; waiting for one, 100 s at most",
        "workers: none at tcp://here:1; waiting for one, 69 s at most",
        "workers: 2",
        "workers: none at tcp://here:1; waiting for one, 100 s at most",
    ]
    with pytest.raises(TimeoutError, match=r"no worker came to tcp://here:1 within 100 s; start some.*--wait"):
        watch.look()


def test_versions_of_workers_that_differ_are_told():
    said = []
    Watch(Cluster(("a",), versions={"jax": "0.1"}), 1.0, said.append).look()
    assert said == [f"warning: jax is {version_of('jax')} here, 0.1 on workers; numbers may differ", "workers: 1"]


def test_a_worker_without_the_project_is_refused():
    with pytest.raises(ValueError, match="workers: 'a lacks jrcjax and sweeps'; allowed: workers started"):
        Watch(Cluster(("a",), lacking=("jrcjax", "sweeps")), 1.0).look()


_LACKING = """
import asyncio, sys
sys.modules["sweeps"] = None  # as where it is not installed
from distributed import Worker

async def work():
    async with Worker(sys.argv[1], dashboard=False) as worker:
        await worker.finished()

asyncio.run(work())
"""


@pytest.mark.slow
def test_a_cluster_without_workers_or_with_others_ends_the_command(tmp_path, capsys):
    distributed = pytest.importorskip("distributed", reason="the extra dask is not installed")
    with distributed.LocalCluster(n_workers=0, dashboard_address=":0") as cluster:
        address = cluster.scheduler_address
        run = [*ARGUMENTS, "--scheduler", address, "--out", str(tmp_path)]
        assert main([*run, "--wait", "0"]) == 2
        assert f"error: no worker came to {address} within 0 s" in capsys.readouterr().err
        with subprocess.Popen([sys.executable, "-c", _LACKING, address], stderr=subprocess.DEVNULL) as worker:
            try:
                assert main(run) == 2
                assert "lacks sweeps'; allowed: workers started in a checkout like this one" in capsys.readouterr().err
            finally:
                worker.kill()


@pytest.mark.parametrize(
    ("cores", "of", "shares"),
    [
        ([0, 1, 2, 3, 4], 2, [[0, 2, 4], [1, 3]]),
        ([2, 5], 2, [[2], [5]]),
        ([2, 5], 3, [[2], [5], [2]]),
    ],
)
def test_workers_of_one_machine_share_its_cores(cores, of, shares):
    assert [share(cores, number, of) for number in range(of)] == shares


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["--workers", "0"], "workers: 0; allowed: an int from 1 to 1024"),
        (["--workers", "2", "--scheduler", "tcp://h:1"], "workers: 2; allowed: none together with scheduler"),
        (["--scheduler", "nonsense://"], "scheduler: 'nonsense://'; allowed: the address of a running scheduler"),
    ],
)
def test_bad_clusters_are_refused(flags, message, capsys, tmp_path):
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    assert main([*ARGUMENTS, *flags, "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
