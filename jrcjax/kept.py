"""Numbers that take a second to make and are always the same, kept on disk beside the compiled programs.

They are found by all that decides them: what they are made from, the source of this package, the versions of what it
calls, JAX's settings, and the processor's instructions; their file names it, so that another file is not taken for it.
Where no compiled programs are kept, nothing is.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
from collections.abc import Callable, Iterable
from pathlib import Path

import jax
import numpy as np

from jrcjax import files, numerics, provenance


def folder() -> Path | None:
    """Where compiled programs are kept on this machine, if they are."""
    path = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    wanted = jax.config.jax_enable_compilation_cache  # pyright: ignore[reportAttributeAccessIssue]
    return Path(path) if wanted and path and "://" not in path else None  # it may be a bucket


def kept(name: str, content: object, make: Callable[[], jax.Array]) -> np.ndarray:
    """What `make` gives, from disk if a process with the same code has made it before on such a machine.

    A file that is damaged or can't be read is made anew; where none can be written nothing is kept.

    Args:
      name: of the kind of numbers.
      content: what they are made from, with a `repr` that tells all of it.
      make: makes them.
    """
    where = folder()
    if where is None:
        return np.asarray(make())
    decides = repr((content, _code(), numerics.in_force(), _devices()))
    key = hashlib.sha256(decides.encode()).digest()
    path = Path(where, name, f"{key.hex()}.npy")
    with contextlib.suppress(OSError, ValueError, files.DamagedFile):
        found = files.unsealed(path)
        if found.startswith(key):
            return np.load(io.BytesIO(found.removeprefix(key)), allow_pickle=False)
    made = np.asarray(make())
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        written = io.BytesIO()
        np.save(written, made, allow_pickle=False)
        files.write_whole(path, files.sealed(key + written.getvalue()))
    return made


def source_of(modules: Iterable[Path]) -> str:
    """A digest of modules, sorted by path; those that are not there, as in a frozen program, are left out."""
    source = hashlib.sha256()
    for path in sorted(modules):
        source.update(path.read_bytes() if path.is_file() else b"")
    return source.hexdigest()


# As it is imported, and not as it may be when something is made.
_SOURCE = source_of(Path(__file__).parent.rglob("*.py"))


@functools.cache
def _code() -> str:
    """What turns parameters into numbers: the source of this package, versions, and the machine."""
    return repr((_SOURCE, provenance.versions(), provenance.machine()))


def _devices() -> str:
    """What computes: XLA compiles other code for a single CPU device."""
    where = jax.config.jax_default_device or jax.devices()[0]  # pyright: ignore[reportAttributeAccessIssue]
    return repr((str(where), getattr(where, "device_kind", ""), jax.device_count() == 1))
