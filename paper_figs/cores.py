"""Analyses that take minutes, on all cores."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TypeVar, cast

import joblib
from threadpoolctl import threadpool_limits

from jrcjax.machine import usable_cores

T = TypeVar("T")


def on_cores(function: Callable[..., T], arguments: Iterable[tuple]) -> list[T]:
    """The function's values for each tuple of arguments, in processes of one thread, as many as there are cores."""
    jobs = (joblib.delayed(_in_one_thread)(function, each) for each in arguments)
    return cast("list[T]", joblib.Parallel(n_jobs=usable_cores())(jobs))


def _in_one_thread(function: Callable[..., T], arguments: tuple) -> T:
    # Linear algebra with a thread per core is many times slower where the cores have other work.
    with threadpool_limits(1):
        return function(*arguments)
