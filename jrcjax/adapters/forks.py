"""JAX in forked processes: it waits for ever there, so what needs it is refused at once.

A fork copies the memory of a process and one of its threads. JAX computes in the others, so a child of a process that
has run JAX can read arrays but compute none.
"""

from __future__ import annotations

import os

from jax._src import xla_bridge

_BY_METHOD = "multiprocessing.get_context('spawn'), make_vec(..., vector_kwargs={'context': 'spawn'})"


class _Process:
    """This process: whether it was forked from one that had run JAX."""

    parent_ran_jax = False
    lost_jax = False


def _before_fork() -> None:
    # JAX has no public function that asks without starting its backends.
    _Process.parent_ran_jax = xla_bridge.backends_are_initialized()


def _in_child() -> None:
    _Process.lost_jax = _Process.parent_ran_jax


if hasattr(os, "register_at_fork"):  # only Unix forks
    os.register_at_fork(before=_before_fork, after_in_child=_in_child)


def require_jax(purpose: str) -> None:
    """Refuses a computation in a process that JAX can't compute in.

    Args:
      purpose: what JAX is needed for, as the error says it.

    Raises:
      RuntimeError: that says how to start the process instead.
    """
    if _Process.lost_jax:
        raise RuntimeError(
            f"{purpose} needs JAX, which does not run in a process forked from one that has run it; start workers by "
            f"'spawn' or 'forkserver', for instance {_BY_METHOD} or SubprocVecEnv(..., start_method='spawn')"
        )
