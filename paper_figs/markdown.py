"""Markdown from numbers: tables, lists and shares."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable

_WIDTH = 120


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    """A table with a heading."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (head, ("---",) * len(head), *rows))


def percent(share: float) -> str:
    """A share in per cent; a dash for one of nothing."""
    return "–" if math.isnan(share) else f"{100 * share:.3g} %"


def listed(items: Iterable[str]) -> str:
    """Sentences as a list, wrapped."""
    return "\n".join(wrapped(item) for item in items)


def paragraph(text: str) -> str:
    """Sentences in lines of the usual width."""
    return textwrap.fill(text, _WIDTH, break_long_words=False, break_on_hyphens=False)


def wrapped(item: str) -> str:
    """A list's item in lines of the usual width."""
    lines, line = [], "-"
    for word in item.split():
        if len(line) + len(word) + 1 > _WIDTH:
            lines.append(line)
            line = " "
        line += f" {word}"
    return "\n".join([*lines, line])


def from_to(numbers: set[int]) -> str:
    """The ends of some numbers, or the only one."""
    return " to ".join(str(n) for n in sorted({min(numbers), max(numbers)})) if numbers else "no"
