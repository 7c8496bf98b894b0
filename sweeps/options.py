"""Options that several commands share, as their help shows them. The text under a field says what its default is."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, TypeAlias

import tyro


def _shown_as(metavar: str) -> Any:
    return tyro.conf.arg(metavar=metavar, help_behavior_hint="")


Count: TypeAlias = Annotated[int | None, _shown_as("N")]
"""A number, with a default that depends on other options."""
Counts: TypeAlias = Annotated[tuple[int, ...], _shown_as("N ...")]
Folder: TypeAlias = Annotated[Path | None, _shown_as("DIR")]
File: TypeAlias = Annotated[Path | None, _shown_as("FILE")]
Preset: TypeAlias = Annotated[str, tyro.conf.arg(metavar="NAME|FILE")]
FLAGS = (tyro.conf.FlagCreatePairsOff,)
"""How switches are shown: --smoke, without --no-smoke beside it."""
