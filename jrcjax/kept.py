"""Numbers that take a second to make and are always the same, kept on disk beside the compiled programs.

They are found by all that decides them: what they are made from, the source of this package, the versions of what it
calls, JAX's settings, and the processor's instructions. Where no compiled programs are kept, nothing is.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
from collections.abc import Callable
from pathlib import Path

import jax
import numpy as np

from jrcjax import files, numerics, provenance

_PACKAGE = Path(__file__).parent


def kept(name: str, content: object, make: Callable[[], jax.Array]) -> np.ndarray:
    """What `make` gives, from disk if a process with the same code has made it before on such a machine.

    A file that is damaged or can't be read is made anew; where none can be written nothing is kept.

    Args:
      name: of the kind of numbers.
      content: what they are made from, with a `repr` that tells all of it.
      make: makes them.
    """
    folder = jax.config.jax_compilation_cache_dir  # pyright: ignore[reportAttributeAccessIssue]
    if folder is None or "://" in folder:  # programs may be kept in a bucket
        return np.asarray(make())
    decides = repr((content, _code(), numerics.in_force(), jax.device_count() == 1))
    path = Path(folder, name, f"{hashlib.sha256(decides.encode()).hexdigest()}.npy")
    with contextlib.suppress(OSError, ValueError, files.DamagedFile):
        return np.load(io.BytesIO(files.unsealed(path)), allow_pickle=False)
    made = np.asarray(make())
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        written = io.BytesIO()
        np.save(written, made, allow_pickle=False)
        files.write_whole(path, files.sealed(written.getvalue()))
    return made


@functools.cache
def _code() -> str:
    """What turns parameters into numbers: the source of this package, versions, and the machine."""
    source = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        source.update(path.read_bytes())
    return repr((source.hexdigest(), provenance.versions(), provenance.machine(), jax.devices()[0].device_kind))
