"""Interrupting a command: SIGTERM and Ctrl-C drop the part at work, and the person is told how to go on."""

from __future__ import annotations

import contextlib
import shlex
import signal
import sys
from collections.abc import Iterator
from typing import NoReturn

STATUS = 130
"""Exit status of an interrupted command, as shells have it."""


def _interrupt(number: int, frame: object) -> NoReturn:
    raise KeyboardInterrupt


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Makes SIGTERM interrupt like Ctrl-C."""
    before = signal.signal(signal.SIGTERM, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def how_to_go_on(*flags: str) -> str:
    """What an interrupted command says: itself, with the flags that make it go on."""
    words = sys.orig_argv[1:]
    again = shlex.join(["python", *words, *(flag for flag in flags if flag not in words)])
    return f"interrupted; to go on: {again}"
