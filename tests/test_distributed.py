"""A sweep on a local Dask cluster gives the bits of a local run, also when it loses a worker."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from sweeps import parts
from sweeps.__main__ import main

ROOT = Path(__file__).parents[1]
ARGUMENTS = ["run", "fig5a", "--episodes", "2", "--seeds", "160"]


@pytest.mark.slow
def test_a_cluster_that_loses_a_worker_gives_the_results_of_a_local_run(tmp_path):
    pytest.importorskip("distributed", reason="the extra dask is not installed")
    import psutil

    command = [sys.executable, "-m", "sweeps", *ARGUMENTS, "--out"]
    subprocess.run([*command, str(tmp_path / "local")], cwd=ROOT, check=True, capture_output=True)
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
