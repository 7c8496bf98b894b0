"""Where numbers come from: command, versions, machine, commit."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

_PACKAGES = ("jrcjax", "jax", "jaxlib", "flax", "optax", "chex", "distrax", "numpy", "scipy", "xarray")


def versions() -> dict[str, str]:
    """Versions of Python and of the packages that results depend on."""
    return {"python": platform.python_version()} | {p: importlib.metadata.version(p) for p in _PACKAGES}


def machine() -> dict[str, Any]:
    """Processor, usable cores and operating system."""
    return {"cpu": _cpu_name(), "cores": len(os.sched_getaffinity(0)), "system": platform.system()}


def _cpu_name() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def provenance() -> dict[str, Any]:
    """Command, time, versions, machine, and the commit of the source if it is in a git checkout."""
    modified = _git("status", "--porcelain", "--untracked-files=no")
    main = getattr(sys.modules["__main__"], "__spec__", None)
    module = main.name.removesuffix(".__main__") if main else Path(sys.argv[0]).name
    return {
        "command": " ".join(["python", "-m", module, *sys.argv[1:]]),
        "finished": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": versions(),
        "machine": machine(),
        "git_commit": _git("rev-parse", "HEAD"),
        "git_modified": None if modified is None else bool(modified),
    }


def _git(*args: str) -> str | None:
    done = subprocess.run(["git", "-C", str(Path(__file__).parent), *args], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else None
