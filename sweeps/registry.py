"""All sweeps by name."""

from __future__ import annotations

from sweeps.fig5a import FIG5A
from sweeps.sweep import Sweep

SWEEPS: dict[str, Sweep] = {sweep.name: sweep for sweep in (FIG5A,)}
