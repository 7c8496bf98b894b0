"""Judgements in words, for tables that people read."""

from __future__ import annotations

import math

from paper_figs.claims.judge import Judgement


def number(value: float) -> str:
    """A number with three digits; "never" for an episode that does not come, a dash for none."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "never" if value > 0 else "no bound"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def criterion(judgement: Judgement) -> str:
    """What the claim demands: the effect and its limit."""
    limit = judgement.limit
    if isinstance(limit, float | int):
        return f"{judgement.effect} {'above' if judgement.relation == '>' else 'below'} {limit:g}"
    return f"{judgement.effect} between {limit[0]:g} and {limit[1]:g}"


def interval(judgement: Judgement) -> str:
    """The limits of the interval, and at how many points the claim holds where it is about all of them."""
    limits = [
        "no bound" if math.isinf(x) and judgement.unit != "episode" else number(x)
        for x in (judgement.ci_low, judgement.ci_high)
    ]
    return f"{limits[0]} to {limits[1]}"


def measured(judgement: Judgement) -> str:
    """The effect with its interval."""
    if math.isnan(judgement.value):
        return "–"
    held = f"; holds at {judgement.held}" if judgement.held else ""
    if math.isnan(judgement.ci_low) and math.isnan(judgement.ci_high):
        return number(judgement.value) + held
    return f"{number(judgement.value)} ({interval(judgement)}){held}"


def verdict(judgement: Judgement) -> str:
    """The verdict, and whether the learners are the same for practical purposes."""
    return f"{judgement.verdict}, difference negligible" if judgement.negligible else judgement.verdict
