"""Times cases side by side: each in a process of its own, all made ready first, then one repetition of each in turn.

Other work on a shared machine then slows all cases alike, and ratios of one run mean something.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import resource
import statistics
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, NamedTuple


class Ready(NamedTuple):
    """A case that is compiled."""

    advance: Callable[[], Any]
    """Advances all agents by the steps of one repetition and waits for the result."""
    compile_s: float
    """Tracing and compiling, with no cache on disk."""


class Case(NamedTuple):
    """What is timed."""

    name: str
    setup: Callable[[int, int], Ready]
    """(agents, steps of one repetition) to the compiled case; a function of a module, since it runs elsewhere."""
    agents: int
    """In each process."""
    steps: int
    """Of each agent in one repetition."""
    processes: int = 1
    """That run at the same time."""


@dataclass(frozen=True)
class Result:
    """One measured case."""

    case: str
    agents: int
    us_per_agent_step: float
    """Median over repetitions: wall time / (agents x steps)."""
    us_low: float
    us_high: float
    compile_s: float
    """Tracing and compiling, with no cache on disk."""
    peak_rss_mb: float
    """Largest resident memory, of all processes of the case; on an accelerator the largest memory there."""
    steps_per_agent: int
    """In one repetition."""
    us_each: tuple[float, ...]
    """Of each repetition."""


def spread(values: Sequence[float]) -> str:
    """Median and range, for a table."""
    low, middle, high = (_digits(value) for value in (min(values), statistics.median(values), max(values)))
    return f"{middle:>8s}  {f'({low}-{high})':18s}"


def header() -> None:
    """Prints the heading of a table of results."""
    print(f"{'case':20s}{'agents':>7s}{'us/agent-step':>14s}  {'(range)':18s}{'compile s':>9s}{'peak MB':>9s}")


def row(r: Result) -> None:
    """Prints a result."""
    print(f"{r.case:20s}{r.agents:7d}{'':6s}{spread(r.us_each)}{r.compile_s:9.1f}{r.peak_rss_mb:9.0f}", flush=True)


def print_table(results: Iterable[Result], failed: Mapping[str, str]) -> None:
    """Prints results, and why other cases have none."""
    header()
    for result in results:
        row(result)
    for case, reason in failed.items():
        print(f"{case:20s} not measured: {reason}", flush=True)


class NotMeasured(Exception):
    """A case cannot run here; says why."""


def _digits(value: float) -> str:
    return f"{value:.3f}" if value < 1 else f"{value:.2f}" if value < 100 else f"{value:.0f}"


def _peak_mb() -> float:
    """Peak memory of this process: an accelerator's if it has used one, else resident memory."""
    if jax := sys.modules.get("jax"):
        of_device = jax.devices()[0].memory_stats() if jax.default_backend() != "cpu" else None
        if of_device:
            return of_device["peak_bytes_in_use"] / 2**20
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _serve(pipe: Connection, case: Case) -> None:
    """In a process of its own: gets the case ready, then times a repetition whenever it is asked to."""
    try:
        ready = case.setup(case.agents, case.steps)
    except ModuleNotFoundError as error:
        pipe.send(str(error.name))
        return
    ready.advance()
    pipe.send(ready.compile_s)
    while pipe.recv():
        begin = time.perf_counter()
        ready.advance()
        seconds = time.perf_counter() - begin
        pipe.send((seconds, _peak_mb()))


class Running:
    """A case in its processes."""

    def __init__(self, case: Case):
        """Waits until the case is compiled and warmed up; raises NotMeasured."""
        self.case = case
        self._repetitions: list[float] = []
        self._peaks: list[float] = []
        context = multiprocessing.get_context("spawn")
        self._pipes, self._processes = [], []
        for _ in range(case.processes):
            ours, theirs = context.Pipe()
            self._processes.append(context.Process(target=_serve, args=(theirs, case), daemon=True))
            self._processes[-1].start()
            theirs.close()
            self._pipes.append(ours)
        answers = self._answers()
        if isinstance(answers[0], str):
            self.stop()
            raise NotMeasured(f"the package {answers[0]} is missing; `make bench` installs it")
        self._compile_s = max(answers)

    def repeat(self) -> None:
        """Times one repetition."""
        for pipe in self._pipes:
            with contextlib.suppress(BrokenPipeError):  # its process has ended, as the answer will say
                pipe.send(True)
        answers = self._answers()
        steps = self.case.agents * self.case.processes * self.case.steps
        self._repetitions.append(max(seconds for seconds, _ in answers) / steps * 1e6)
        self._peaks = [peak for _, peak in answers]

    def _answers(self) -> list[Any]:
        """One of each process; raises NotMeasured when XLA's own checks or the lack of memory have ended one."""
        answers = []
        for pipe, process in zip(self._pipes, self._processes, strict=True):
            try:
                answers.append(pipe.recv())
            except EOFError:
                process.join()
                self.stop()
                raise NotMeasured(f"its process ended with status {process.exitcode}") from None
        return answers

    def result(self) -> Result:
        """What was measured so far."""
        us = self._repetitions
        agents = self.case.agents * self.case.processes
        return Result(
            self.case.name,
            agents,
            statistics.median(us),
            min(us),
            max(us),
            self._compile_s,
            sum(self._peaks),
            self.case.steps,
            tuple(us),
        )

    def stop(self) -> None:
        """Ends the processes."""
        for process in self._processes:
            process.kill()
            process.join()


def in_turns(cases: Iterable[Case], repetitions: int) -> tuple[list[Result], dict[str, str]]:
    """Results of the cases, and why the others could not run."""
    with ExitStack() as stack:
        running: list[Running] = []
        failed: dict[str, str] = {}
        for case in cases:
            try:
                running.append(Running(case))
            except NotMeasured as error:
                failed[case.name] = str(error)
                continue
            stack.callback(running[-1].stop)
        for _ in range(repetitions):
            for one in list(running):
                try:
                    one.repeat()
                except NotMeasured as error:
                    failed[one.case.name] = str(error)
                    running.remove(one)
        return [one.result() for one in running], failed


def alone(case: Case, repetitions: int) -> Result:
    """The result of one case; raises NotMeasured."""
    results, failed = in_turns([case], repetitions)
    if failed:
        raise NotMeasured(*failed.values())
    return results[0]
