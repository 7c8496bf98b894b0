"""What every command does first, so that nothing of a user's shell, notebook or locale gets in its way."""

from __future__ import annotations

import os
import sys

from rich.console import Console


def begin() -> Console:
    """Makes the process ready: streams that take any character, figures for files alone, JAX on all cores.

    Returns:
      Where progress is shown.

    Raises:
      ValueError: naming JAX_PLATFORMS, if this machine has none of the platforms that it asks for.
    """
    undisturbed()
    from jrcjax.training import parallel  # not before it is needed: --help and errors come at once

    parallel.start()
    return Console(stderr=True)


def undisturbed() -> None:
    """Draws figures for files alone, and shows a character that the locale does not know as its number."""
    os.environ["MPLBACKEND"] = "agg"
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")  # pyright: ignore[reportAttributeAccessIssue]
