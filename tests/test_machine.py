"""What a process may use, where a container or a batch job allows less than the machine has."""

import os

import pytest

from jrcjax import machine


@pytest.fixture
def groups(tmp_path, monkeypatch):
    """Control groups of one's own, of a process in /job/step, on a machine with 64 cores."""
    (tmp_path / "membership").write_text("4:cpu,cpuacct:/old\n3:memory:/old\n0::/job/step\n")
    monkeypatch.setattr(machine, "_GROUPS", tmp_path)
    monkeypatch.setattr(machine, "_MEMBERSHIP", tmp_path / "membership")
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(64)), raising=False)
    monkeypatch.delenv("SLURM_CPUS_PER_TASK", raising=False)

    def limit(file, text):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(text)

    return limit


@pytest.mark.parametrize(
    ("limits", "cores"),
    [
        ({}, 64),
        ({"cpu.max": "max 100000"}, 64),
        ({"cpu.max": "200000 100000"}, 2),
        ({"job/step/cpu.max": "max 100000", "job/cpu.max": "450000 100000"}, 5),  # the group around it
        ({"job/step/cpu.max": "10000 100000"}, 1),
        ({"cpu/old/cpu.cfs_quota_us": "300000", "cpu/old/cpu.cfs_period_us": "100000"}, 3),
        ({"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, 64),
    ],
)
def test_the_quota_of_a_container_limits_the_cores(limits, cores, groups):
    for file, text in limits.items():
        groups(file, text)
    assert machine.usable_cores() == cores


@pytest.mark.parametrize(("variable", "cores"), [("8", 8), ("128", 64), ("", 64), ("all", 64)])
def test_a_slurm_task_has_its_own_cores(variable, cores, groups, monkeypatch):
    monkeypatch.setenv("SLURM_CPUS_PER_TASK", variable)
    assert machine.usable_cores() == cores


@pytest.mark.parametrize("file", ["memory.max", "job/memory.max", "memory/old/memory.limit_in_bytes"])
def test_the_memory_of_a_container_is_that_of_the_process(file, groups):
    assert machine.physical_memory() > 2**20
    groups("job/step/memory.max", "max")
    groups(file, str(2**20))
    assert machine.physical_memory() == 2**20
