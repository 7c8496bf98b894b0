"""Interrupting a command: SIGTERM and Ctrl-C drop the part at work, and the person is told how to go on."""

from __future__ import annotations

import contextlib
import shlex
import signal
import sys
import threading
from collections.abc import Iterator
from typing import NoReturn

STATUS = 130
"""Exit status of an interrupted command, as shells have it."""


def _interrupt(number: int, frame: object) -> NoReturn:
    raise KeyboardInterrupt


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Makes SIGTERM interrupt like Ctrl-C; only the main thread is ever interrupted, so elsewhere it does nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, _interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextlib.contextmanager
def held_off() -> Iterator[None]:
    """Lets what is begun come to its end: an interrupt waits for the end of the block.

    Only the main thread is ever interrupted, so elsewhere this does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting: list[int] = []
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, lambda number, frame: waiting.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    for number in waiting[:1]:
        signal.raise_signal(number)


def how_to_go_on(*flags: str) -> str:
    """What an interrupted command says: itself, with the flags that make it go on."""
    words = sys.orig_argv[1:]
    again = shlex.join(["python", *words, *(flag for flag in flags if flag not in words)])
    return f"interrupted; to go on: {again}"
