"""What this process may use of its machine: cores and memory, as the system, a container or a batch job allows."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

_GROUPS = Path("/sys/fs/cgroup")
_MEMBERSHIP = Path("/proc/self/cgroup")


def usable_cores() -> int:
    """Cores that this process may use: those it may run on, within the quota of its container and of its SLURM task."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(min([cores, *_quotas(), *_slurm_cores()]), 1)


def physical_memory() -> int:
    """Bytes of main memory that this process may use."""
    installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limits = [*_numbers("memory.max"), *_numbers("memory.limit_in_bytes", "memory")]
    return int(min([installed, *(limit[0] for limit in limits)]))


def _quotas() -> Iterator[int]:
    """Cores' worth of time that groups of processes have, version 2 and version 1, rounded up."""
    for quota, period in _numbers("cpu.max"):
        yield math.ceil(quota / period)
    periods = _numbers("cpu.cfs_period_us", "cpu")
    for (quota,), (period,) in zip(_numbers("cpu.cfs_quota_us", "cpu"), periods, strict=False):
        if quota > 0:
            yield math.ceil(quota / period)


def _slurm_cores() -> Iterator[int]:
    """Cores of a SLURM task, which is not bound to them on every cluster."""
    cores = os.environ.get("SLURM_CPUS_PER_TASK", "")
    if cores.isdigit():
        yield int(cores)


def _numbers(file: str, controller: str = "") -> Iterator[list[int]]:
    """The numbers in a limit's file in this process' control group and in the groups around it; "max" is no limit."""
    try:
        lines = _MEMBERSHIP.read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    own = ""
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controller in controllers.split(","):
            own = path.strip("/")
    base = _GROUPS / controller
    for folder in dict.fromkeys((base / own, *(base / parent for parent in Path(own).parents), base)):
        try:
            words = (folder / file).read_text(encoding="utf-8").split()
        except OSError:
            continue
        if words and all(word.lstrip("-").isdigit() for word in words):
            yield [int(word) for word in words]
