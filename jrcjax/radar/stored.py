"""Banks that come with the package, those of the paper's radars, so that nobody waits until they are drawn.

A stored bank is taken only where drawing would use the same parameters, source, versions and settings of JAX: whoever
changes how objects are placed or detected gets banks of the changed code. The processor is left out, since a bank holds
ratios of counts, in which rounding shows only where two objects are as far apart as the range resolution.
"""

from __future__ import annotations

import functools
import hashlib
import zipfile
from pathlib import Path

import numpy as np

from jrcjax import numerics, provenance
from jrcjax.kept import source_of

FILE = Path(__file__).with_name("stored_banks.npz")
_SOURCE = (*FILE.parent.glob("*.py"), *(FILE.parents[1] / f"{m}.py" for m in ("keys", "numerics", "readings")))
_VERSIONS = {name: provenance.version_of(name) for name in ("jax", "distrax")}


def code() -> str:
    """What turns a radar's parameters into a bank: source and versions."""
    return repr((source_of(_SOURCE), _VERSIONS))


_CODE = code()  # as it is imported, and not as it may be when a bank is asked for


def name_of(content: object) -> str:
    """What a bank is stored under.

    Args:
      content: what it is made from, with a `repr` that tells all of it.
    """
    settings = numerics.in_force() | {"platform": None}
    return hashlib.sha256(repr((content, _CODE, settings)).encode()).hexdigest()


def stored(content: object) -> np.ndarray | None:
    """The bank with this content, [K, B], or None if the package does not have it."""
    return _banks().get(name_of(content))


@functools.cache
def _banks() -> dict[str, np.ndarray]:
    try:
        with np.load(FILE, allow_pickle=False) as file:
            return dict(file)
    except (OSError, ValueError, EOFError, zipfile.BadZipFile):  # they can all be drawn
        return {}
