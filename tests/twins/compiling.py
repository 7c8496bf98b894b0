"""What was compiled meanwhile."""

from collections.abc import Iterator
from contextlib import contextmanager

import jax


@contextmanager
def compiled_programs() -> Iterator[list[str]]:
    """Names of the programs that are compiled, or found on disk, while the context lasts."""
    compiled = []

    def listen(event, _, fun_name="", **__):
        # The first array of a shape compiles its own transfer, in no time.
        if "backend_compile" in event and fun_name not in ("jit(stage)", "jit(convert_element_type)"):
            compiled.append(fun_name)

    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        yield compiled
    finally:
        jax.monitoring.unregister_event_duration_listener(listen)


@contextmanager
def nothing_compiles() -> Iterator[None]:
    with compiled_programs() as programs:
        yield
    assert not programs, programs
