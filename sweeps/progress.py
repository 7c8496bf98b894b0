"""Progress for whoever looks: a bar on a terminal, lines at intervals in a log."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from sweeps.engine.estimate import in_words

_INTERVAL = 30.0
"""Seconds between two lines; after an hour of work ten times as many."""
_TELLING = 0.01
"""Share of the work before which the time is mostly that of compiling, and says nothing of what is left."""
_COLUMNS = (
    TextColumn("{task.description}"),
    BarColumn(),
    TaskProgressColumn(),
    TimeElapsedColumn(),
    TimeRemainingColumn(),
)


@contextlib.contextmanager
def shown(console: Console, name: str, total: float) -> Iterator[Callable[[float], None]]:
    """Shows how much of a task is done while the block runs.

    Args:
      console: where.
      name: of the task.
      total: what there is to do, in any unit.

    Yields:
      A function that is told what was done since it was last called.
    """
    if not console.is_terminal:
        yield Lines(console, name, total).advance
        return
    with Progress(*_COLUMNS, console=console) as progress:
        task = progress.add_task(name, total=total)
        yield lambda done: progress.advance(task, done)


class Lines:
    """A line at intervals: the share that is done, the time that it took, its rate, and the time that is left at it."""

    def __init__(self, console: Console, name: str, total: float, clock: Callable[[], float] = time.monotonic) -> None:
        self.console, self.name, self.total, self.clock = console, name, total, clock
        self.done = 0.0
        self.begin = self.said = clock()

    def advance(self, done: float) -> None:
        """Takes note of what was done, and prints a line if it is time."""
        self.done += done
        now = self.clock()
        gone = now - self.begin
        finished = self.done >= self.total * (1 - 1e-6)
        if now - self.said < _INTERVAL * (10 if gone > 3600 else 1) and not finished:
            return
        self.said = now
        share = min(self.done / self.total, 1.0) if self.total else 1.0
        line = f"{self.name}: {share:.0%} done in {in_words(gone)}"
        if _TELLING <= share < 1:
            line += (
                f", {60 * share / max(gone, 1e-9):.2%} per minute, about {in_words(gone * (1 - share) / share)} left"
            )
        self.console.print(line, soft_wrap=True, highlight=False)
