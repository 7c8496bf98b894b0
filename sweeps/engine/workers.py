"""The workers of a Dask cluster: how many there are, and what they lack.

Nobody waits for them without a word, or without an end.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Collection
from typing import Any

from jrcjax.checks import refuse
from jrcjax.provenance import version_of

_NEEDED = ("jrcjax", "sweeps")  # modules
_VERSIONS = ("jrcjax", "jax", "jaxlib", "flax", "optax", "numpy")  # which decide the last bit of a number
SAME_CHECKOUT = "workers started in a checkout like this one, with the same packages"
_AGAIN = 30.0
"""Seconds between two lines about the same."""


def say(line: str) -> None:
    """Tells a person, beside the results on standard output."""
    print(line, file=sys.stderr, flush=True)


class Watch:
    """Looks at the workers of a client's cluster, as often as its owner asks.

    Args:
      client: of the cluster.
      patience: seconds without any worker after which `look` gives up.
      say: is told how many workers there are, and in which versions they differ.
      clock: seconds.
    """

    def __init__(
        self,
        client: Any,
        patience: float,
        say: Callable[[str], None] = say,
        clock: Callable[[], float] = time.monotonic,
    ):
        self._client, self._patience, self._say, self._clock = client, patience, say, clock
        self._known: frozenset[str] = frozenset()
        self._alone_since: float | None = None
        self._said: float | None = None

    def look(self) -> int:
        """The number of workers; those that are new are checked.

        Raises:
          TimeoutError: when there has been no worker for longer than the patience.
          ValueError: if a worker lacks a module of this project.
        """
        there = frozenset(self._client.nthreads())
        if not there:
            self._wait()
        elif there != self._known:
            self._alone_since = self._said = None
            self._check(there - self._known)
            self._say(f"workers: {len(there)}")
        self._known = there
        return len(there)

    def _wait(self) -> None:
        now, address = self._clock(), self._client.scheduler.address
        if self._alone_since is None:
            self._alone_since = now
        waited = now - self._alone_since
        if waited > self._patience:
            raise TimeoutError(
                f"no worker came to {address} within {self._patience:.0f} s; start some in this environment "
                f"(dask worker {address}), or wait longer (--wait SECONDS)"
            )
        if self._said is None or now - self._said >= _AGAIN:
            self._said = now
            self._say(f"workers: none at {address}; waiting for one, {self._patience - waited:.0f} s at most")

    def _check(self, new: Collection[str]) -> None:
        if not new:
            return
        # A nested function travels as code, so that a worker without this module can run it.
        lacking = self._client.run(_lacking_modules(), workers=list(new), on_error="return")
        for worker, modules in lacking.items():
            if isinstance(modules, list) and modules:
                refuse("workers", f"{worker} lacks {' and '.join(modules)}", SAME_CHECKOUT)
        found = self._client.get_versions(packages=list(_VERSIONS))["workers"]
        for package in _VERSIONS:
            here = version_of(package)
            there = sorted({str(found[w]["packages"].get(package)) for w in new if w in found} - {here})
            if there:
                self._say(f"warning: {package} is {here} here, {', '.join(there)} on workers; numbers may differ")


def _lacking_modules() -> Callable[[], list[str]]:
    needed = _NEEDED

    def lacking() -> list[str]:
        import importlib.util

        return [name for name in needed if importlib.util.find_spec(name) is None]

    return lacking
