"""Environments in forked and spawned processes: they work or are refused at once; nothing waits for ever."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs the extra 'gymnasium'")

PROGRAM = Path(__file__).parents[1] / "twins" / "processes.py"
PATIENCE = 500  # s after which a program hangs; the machine may be busy


def results_of(case):
    done = subprocess.run([sys.executable, PROGRAM, case], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def forked():
    return results_of("fork")


def test_a_forked_process_steps(forked):
    assert forked["pickled"] == forked["made"] == forked["here"]
    assert len(set(forked["here"])) > 3


def test_gymnasiums_asynchronous_vector_forks(forked):
    first, second = zip(*forked["async"], strict=True)
    assert list(first) == forked["here"][: len(first)]
    assert first != second


def test_an_environment_that_the_parent_made_without_its_id(forked):
    assert forked["by_id"] == [True, True]


@pytest.mark.parametrize("case", ["picture", "new", "fresh"])
def test_what_needs_jax_is_refused_in_a_forked_process(forked, case):
    assert "needs JAX, which does not run in a process forked" in forked[case]
    assert "'spawn' or 'forkserver'" in forked[case]


def test_a_process_forked_before_jax_runs_it():
    assert results_of("before_jax") == 0


def test_spawned_processes_step():
    spawned = results_of("spawn")
    assert spawned["pickled"] == spawned["here"]
    assert [first for first, _ in spawned["async"]] == spawned["here"][: len(spawned["async"])]


@pytest.mark.parametrize("case", ["stable_baselines3", "torch"])
def test_clients_that_fork(case):
    pytest.importorskip(case, reason="needs the extra 'clients'")
    results = results_of(case)
    assert results["forked"] == results["here"]
