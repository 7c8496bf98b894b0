"""How fast this machine was in its last run: kept beside the compiled programs, so that the next estimate uses it."""

from __future__ import annotations

import contextlib
import functools
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from jrcjax import files, kept

_ENOUGH = 1.0  # seconds of measured work below which a run says nothing of the pace
_COMPILED = 5.0  # seconds; programs that were kept start faster
_SLOWEST = 100.0  # times the machine where the constants were measured; the fastest is as many times as fast


class Pace(NamedTuple):
    """The pace of a machine."""

    ratio: float = 1.0
    """Seconds that work took here, over those that it took where the constants of `estimate` were measured."""
    compiling: float = 30.0
    """Seconds until a program that is not kept ran for the first time."""


@functools.cache
def of_machine() -> Pace:
    """What the last run here measured; a guess before the first, and where nothing can be kept."""
    with contextlib.suppress(OSError, ValueError, TypeError, LookupError):
        ratio, compiling = (float(json.loads(_file().read_text(encoding="utf-8"))[name]) for name in Pace._fields)
        if 1 / _SLOWEST <= ratio <= _SLOWEST and 0 <= compiling <= 3600:
            return Pace(ratio, compiling)
    return Pace()


def _file() -> Path:
    folder = kept.folder()
    if folder is None:
        raise FileNotFoundError("no folder of compiled programs")
    return folder / "pace.json"


class Stopwatch:
    """Times the chunks of a run against what was expected of them."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._begin = clock, clock()
        self._took = self._expected = 0.0
        self._compiling: list[float] = []

    def start(self) -> None:
        """A block begins."""
        self._begin = self._clock()

    def lap(self, expected: float, is_first: bool) -> None:
        """A chunk of so many expected seconds ends; the first of a program has compiled it, too."""
        now = self._clock()
        took, self._begin = now - self._begin, now
        if is_first:
            self._compiling.append(max(took - expected, 0.0))
        else:
            self._took += took
            self._expected += expected

    @property
    def pace(self) -> Pace:
        """What was measured; what was not is as before."""
        before = of_machine()
        ratio = before.ratio * self._took / self._expected if self._took >= _ENOUGH else before.ratio
        slowest = max(self._compiling, default=0.0)  # programs that were kept say nothing of those that are not
        return Pace(ratio, slowest if slowest >= _COMPILED else before.compiling)

    def keep(self) -> None:
        """Keeps the pace for the next run, if there is a place for it."""
        with contextlib.suppress(OSError):
            files.write_text(_file(), json.dumps(self.pace._asdict()) + "\n")
