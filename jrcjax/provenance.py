"""Where numbers come from: command, versions, machine, commit."""

from __future__ import annotations

import contextlib
import importlib.metadata
import os
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

_ROOT = Path(__file__).resolve().parents[1]
_PACKAGES = ("jrcjax", "jax", "jaxlib", "flax", "optax", "chex", "distrax", "numpy", "scipy", "xarray")
_WORKS_FOR: ContextVar[str | None] = ContextVar("_WORKS_FOR", default=None)
_VECTOR_FLAGS = ("avx", "fma", "f16c", "amx", "asimd", "sve")


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on."""
    return {"python": platform.python_version()} | {package: version_of(package) for package in _PACKAGES}


def version_of(package: str) -> str:
    """The version of an installed package."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def machine() -> dict[str, Any]:
    """Processor, its vector instructions, for which XLA generates code, XLA's flags, usable cores and system."""
    return {
        "cpu": _cpuinfo("model name") or platform.processor() or platform.machine(),
        "cpu_features": cpu_features(),
        "xla_flags": os.environ.get("XLA_FLAGS", ""),
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
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
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
    """Command, time, versions, machine, and the commit of the source if it is in a git checkout of its own."""
    own = _is_own_checkout()
    modified = _git("status", "--porcelain", "--untracked-files=no") if own else None
    return {
        "command": command(),
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": versions(),
        "machine": machine(),
        "git_commit": _git("rev-parse", "HEAD") if own else None,
        "git_modified": None if modified is None else bool(modified),
    }


def _is_own_checkout() -> bool:
    """Whether this file is tracked at its place in a checkout, and does not just lie in somebody else's."""
    top = _git("rev-parse", "--show-toplevel")
    return bool(top) and Path(top).resolve() == _ROOT and bool(_git("ls-files", "--", str(Path(__file__).resolve())))


def _git(*args: str) -> str | None:
    # The checkout may be another user's; and a hook's variables are about another repository.
    command = ["git", "-c", "safe.directory=*", "--no-optional-locks", "-C", str(_ROOT), *args]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, encoding="utf-8", errors="replace", env=environment, check=False
        )
    except OSError:  # no git on this machine
        return None
    return done.stdout.strip() if done.returncode == 0 else None
