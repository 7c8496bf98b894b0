"""Where numbers come from: command, versions, machine, commit."""

from __future__ import annotations

import contextlib
import importlib.metadata
import platform
import shlex
import subprocess
import sys
from collections.abc import Iterator
from contextvars import ContextVar
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from jrcjax.machine import usable_cores

_PACKAGES = ("jrcjax", "jax", "jaxlib", "flax", "optax", "chex", "distrax", "numpy", "scipy", "xarray")
_WORKS_FOR: ContextVar[str | None] = ContextVar("_WORKS_FOR", default=None)
_VECTOR_FLAGS = ("avx", "fma", "f16c", "amx", "asimd", "sve")


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on."""
    return {"python": platform.python_version()} | {p: importlib.metadata.version(p) for p in _PACKAGES}


def machine() -> dict[str, Any]:
    """Processor, its vector instructions, for which XLA generates code, usable cores and operating system."""
    return {
        "cpu": _cpuinfo("model name") or platform.processor() or platform.machine(),
        "cpu_features": cpu_features(),
        "cores": usable_cores(),
        "system": platform.system(),
    }


def cpu_features() -> list[str]:
    """Vector instructions of the processor (fma, avx2, avx512f, ...); empty where the system does not tell."""
    flags = (_cpuinfo("flags") or _cpuinfo("Features")).split()
    return sorted(flag for flag in flags if flag.startswith(_VECTOR_FLAGS))


def _cpuinfo(field: str) -> str:
    """The value of a field of the first processor; empty if there is none."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return ""
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith(field)), "")


def command() -> str:
    """The command that this process, or the one that it works for, was started with."""
    return _WORKS_FOR.get() or shlex.join(["python", *sys.orig_argv[1:]])


@contextlib.contextmanager
def working_for(command: str) -> Iterator[None]:
    """What is made meanwhile is made by this command of another process."""
    before = _WORKS_FOR.set(command)
    try:
        yield
    finally:
        _WORKS_FOR.reset(before)


def provenance() -> dict[str, Any]:
    """Command, time, versions, machine, and the commit of the source if it is in a git checkout."""
    modified = _git("status", "--porcelain", "--untracked-files=no")
    return {
        "command": command(),
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": versions(),
        "machine": machine(),
        "git_commit": _git("rev-parse", "HEAD"),
        "git_modified": None if modified is None else bool(modified),
    }


def _git(*args: str) -> str | None:
    command = ["git", "-C", str(Path(__file__).parent), *args]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError:  # no git on this machine
        return None
    return done.stdout.strip() if done.returncode == 0 else None
