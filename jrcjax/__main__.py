"""`python -m jrcjax` says which versions and devices it runs on, as a report of a bug should; `--version` its own."""

from __future__ import annotations

import argparse
import platform
from importlib.metadata import version

import jax

import jrcjax


def main(args: list[str] | None = None) -> None:
    """Prints versions and devices."""
    parser = argparse.ArgumentParser(prog="python -m jrcjax", description=__doc__)
    parser.add_argument("--version", action="version", version=f"jrcjax {jrcjax.__version__}")
    parser.parse_args(args)
    packages = ", ".join(f"{name} {version(name)}" for name in ("jax", "jaxlib", "flax", "optax", "distrax", "numpy"))
    print(f"jrcjax {jrcjax.__version__}\nPython {platform.python_version()}, {packages}\n{platform.platform()}")
    print("devices: " + ", ".join(map(str, jax.devices())))


if __name__ == "__main__":
    main()
