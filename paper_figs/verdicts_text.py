"""The parts of texts that say what has a verdict under many readings, and what more seeds do to estimates."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from paper_figs.claims.judge import VERDICTS
from paper_figs.claims.results import Rules
from paper_figs.markdown import from_to, listed, percent, table
from paper_figs.published import counted, csv_of, seeds_of, share
from paper_figs.studies import multiverse
from sweeps.studies.multiverse import MULTIVERSE


def never_judged_so(published: Path, claims: list[str]) -> str:
    """Which of some statements no reading with seeds enough for a verdict supports, and what bound that gives."""
    shares = csv_of(published, MULTIVERSE.name, "claims").query("claim in @claims and judged > 0 and supported == 0")
    if shares.empty:
        return "Each of these is supported in some of the multiverse's readings with verdicts."
    judged = multiverse.judged(multiverse.sampled(csv_of(published, MULTIVERSE.name, "verdicts")))
    seeds = seeds_of(judged.loc[judged.claim.isin(shares.claim)])
    undecided = np.average(shares.undecided, weights=shares.judged)
    return (
        f"Of these, {seeds} seeds support none in the {from_to(set(shares.judged.astype(int)))} readings of the "
        f"multiverse with verdicts, so they would in at most {percent(shares.supported_high.max())} of readings (each "
        f"by itself, and as if readings of a block were independent); but {percent(undecided)} of these "
        f"verdicts are undecided: {'; '.join(shares.claim)}."
    )


def judged_table(published: Path) -> str:
    """One row per statement: shares of its verdicts in the readings that have seeds enough for one."""
    claims = csv_of(published, MULTIVERSE.name, "claims")
    names = (*VERDICTS, "unknown_then", "negligible")
    rows = [
        (row["claim"], str(int(row["judged"])), *("–" if np.isnan(row[name]) else share(row, name) for name in names))
        for row in claims.query("judged > 0").to_dict("records")
    ]
    return table(("statement", "readings", *VERDICTS, "of these unknown", "negligible, of those that compare"), rows)


def looks_table(published: Path) -> str:
    """The statements of the first page in the readings with seeds enough for verdicts: few seeds, and all of them."""
    found = multiverse.sampled(csv_of(published, MULTIVERSE.name, "verdicts"))
    then, rows = multiverse.judged(found), []
    first = multiverse.estimates(found)
    for claim in multiverse.HEADLINES:
        few, many = (of.loc[of.claim == claim].set_index("reading").holds.astype(bool) for of in (first, then))
        if many.empty:
            continue
        few = few.loc[many.index]
        cells = (f"{holds.sum()} of {len(holds)}" for holds in (few, many))
        rows.append((claim, *cells, str((many & ~few).sum()), str((few & ~many).sum())))
    head = ("statement", *(f"on its side, seeds: {seeds_of(of)}" for of in (first, then)), "came to it", "left it")
    return table(head, rows)


def judged_list(published: Path) -> str:
    """What has a verdict, and what verdicts say in most readings."""
    claims, verdicts = (csv_of(published, MULTIVERSE.name, name) for name in ("claims", "verdicts"))
    sampled = multiverse.sampled(verdicts)
    judged = multiverse.judged(sampled)
    if judged.empty:
        return listed([f"No reading has seeds enough for a verdict, which takes {Rules().least_seeds}."])
    mostly = {v: claims.claim[claims[f"{v}_low"] > 0.5] for v in ("supported", "contradicted")}
    never = claims.claim[claims.supported == 0]
    readings, of_each = judged.reading.nunique(), set(judged.claim.value_counts())
    in_some = f" (each statement {from_to(of_each)} of them)" if len(of_each) > 1 else ""
    in_words = [
        f"In more than half, interval included, {v}: {'; '.join(names) or 'none'}." for v, names in mostly.items()
    ]
    return listed(
        [
            f"{readings} of the sample's {sampled.reading.nunique()} readings have {seeds_of(judged)} seeds{in_some}, "
            f"and {len(judged)} verdicts: {counted(judged)}.",
            *in_words,
            f"Supported in none of them: {'; '.join(never) or 'none'}.",
        ]
    )


BLOCKS: dict[str, Callable[[Path], str]] = {"judged": judged_list, "judged_table": judged_table, "looks": looks_table}
"""Name of a marked part to what makes it from the folder of published results."""
