"""The claims in many universes: where each holds, which readings decide it, and the specification curves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from paper_figs.analysis import divergence
from paper_figs.analysis.statistics import CONFIDENCE
from paper_figs.claims import table
from paper_figs.claims.judge import Judgement, is_on_its_side
from paper_figs.plots import style
from sweeps.studies.fig6 import FIG6
from sweeps.studies.fig7 import FIG7
from sweeps.studies.fig8 import FIG8
from sweeps.studies.fig9 import FIG9
from sweeps.studies.multiverse import BASE_AT, LEVELS, POINTS, UNIVERSES, Universe
from sweeps.sweep import Sweep

VERDICTS = ("supported", "undecided", "contradicted")
_COLOURS = {"supported": "#009E73", "undecided": "0.75", "contradicted": "#D55E00"}
_MARKS = {"supported": "o", "undecided": ".", "contradicted": "x"}
_SHUFFLES = 1000


def level_name(level: Any) -> str:
    """A level as tables show it."""
    return " ".join(str(part) for part in level) if isinstance(level, tuple) else str(level)


def readings_of(universe: Universe) -> dict[str, str]:
    """The level of each reading."""
    return {name: level_name(level) for name, level in universe._asdict().items()}


def _figure(target: xr.Dataset, sweep: Sweep) -> xr.Dataset:
    """The results of one figure in a universe: its points, the unchanged target environment among them."""
    at = {number: point.x for number, point in enumerate(POINTS) if point.sweep is sweep} | {0: BASE_AT[sweep.name]}
    numbers = sorted(at, key=lambda number: at[number])
    found = target.isel(point=numbers)
    return found.assign_coords({"point": range(len(numbers)), sweep.x_name: ("point", [at[n] for n in numbers])})


def claims_of(source: xr.Dataset, target: xr.Dataset) -> list[Judgement]:
    """All claims in one universe.

    Args:
      source: results in its source environment, one point.
      target: results at all of its POINTS.
    """
    swept = {sweep.name: _figure(target, sweep) for sweep in (FIG6, FIG7, FIG8, FIG9)}
    return table.claims_of({"fig5a": source, "fig5b": target.isel(point=[0]), **swept})


def verdicts(
    results: dict[str, tuple[xr.Dataset, xr.Dataset]], universes: dict[str, tuple[Universe, ...]]
) -> pd.DataFrame:
    """One row per universe and claim: the readings, the effect with its interval, and the verdict.

    Args:
      results: by optimiser, results in the source environments and at the points of all universes.
      universes: by optimiser, in the order of the results.
    """
    rows = []
    for name, (source, target) in results.items():
        for number, universe in enumerate(universes[name]):
            points = slice(number * len(POINTS), (number + 1) * len(POINTS))
            here = source.isel(point=[number]), target.isel(point=points)
            n_diverged = sum(divergence.count(data, name) for data in here for name in data["algorithm"].values)
            for c in claims_of(*here):
                holds = is_on_its_side(c.value, c.relation, c.limit)
                known = {"claim": c.claim, "value": c.value, "ci_low": c.ci_low, "ci_high": c.ci_high, "limit": c.limit}
                about = {
                    "relation": c.relation,
                    "verdict": c.verdict,
                    "holds": holds,
                    "n_seeds": c.n_seeds,
                    "n_diverged": n_diverged,
                }
                rows.append({"universe": UNIVERSES.index(universe)} | readings_of(universe) | known | about)
    return pd.DataFrame(rows)


def main_effects(found: pd.DataFrame) -> pd.DataFrame:
    """One row per claim, reading and level: the shares of universes in which the claim is supported, and holds at all.

    It `holds` if its estimate, whatever its interval, is on the claim's side.
    `range` is the difference of `holds` between a reading's levels, `chance` what 95 % of random assignments of the
    universes stay below: a reading decides a claim if its range is larger.
    """
    rows = []
    for claim, of_claim in found.groupby("claim", sort=False):
        holds = of_claim["holds"].to_numpy(float)
        shuffled = np.random.default_rng(0).permuted(np.tile(holds, (_SHUFFLES, 1)), axis=1)
        for reading in LEVELS:
            levels = [level for level in map(level_name, LEVELS[reading]) if level in set(of_claim[reading])]
            member = np.stack([(of_claim[reading] == level).to_numpy() for level in levels])
            shares = (shuffled @ member.T) / member.sum(axis=1)
            chance = float(np.quantile(np.ptp(shares, axis=1), CONFIDENCE))
            share = (member @ holds) / member.sum(axis=1)
            for level, which, here in zip(levels, member, share, strict=True):
                supported = (of_claim["verdict"].to_numpy()[which] == "supported").mean()
                about = {"claim": claim, "reading": reading, "level": level, "universes": int(which.sum())}
                rows.append(about | {"supported": supported, "holds": here, "range": np.ptp(share), "chance": chance})
    return pd.DataFrame(rows)


def shares(found: pd.DataFrame, effects: pd.DataFrame) -> pd.DataFrame:
    """One row per claim: the share of universes with each verdict, the verdict in the first, and what decides it.

    `decided_by` lists the readings whose range is above chance (see `main_effects`), the largest first, with the range.
    """
    rows = []
    for claim, of_claim in found.groupby("claim", sort=False):
        deciding = effects.query(f"claim == {claim!r} and range > chance").drop_duplicates("reading")
        ranges = deciding.sort_values("range", ascending=False)
        about = of_claim.iloc[0][["claim", "relation", "limit"]].to_dict()
        row: dict[str, Any] = about | {"universes": len(of_claim)}
        row |= {verdict: float((of_claim.verdict == verdict).mean()) for verdict in VERDICTS}
        row["holds"] = float(of_claim.holds.mean())
        row["default"] = of_claim.loc[of_claim.universe == 0, "verdict"].item()
        row["decided_by"] = "; ".join(
            f"{reading} ({share:.2f})" for reading, share in zip(ranges.reading, ranges.range, strict=True)
        )
        rows.append(row)
    return pd.DataFrame(rows)


@style.styled
def draw_shares(table: pd.DataFrame, n_seeds: int) -> Figure:
    """Each claim's verdicts over the universes, the default reading's marked, with the reading that decides most.

    A tick shows the share of universes in which the estimate, whatever its interval, is on the claim's side.
    """
    figure = Figure(figsize=(style.TWO_COLUMNS[0], 0.155 * len(table) + 0.9))
    axes = figure.subplots()
    left = np.zeros(len(table))
    rows = np.arange(len(table))[::-1]
    hatches = {"supported": "", "undecided": "", "contradicted": "////"}
    for verdict in VERDICTS:
        width = 100 * table[verdict].to_numpy()
        axes.barh(
            rows, width, left=left, color=_COLOURS[verdict], hatch=hatches[verdict], edgecolor="white", linewidth=0.3,
            label=verdict, height=0.8,
        )  # fmt: skip
        chosen = (table["default"] == verdict).to_numpy()
        axes.plot((left + width / 2)[chosen], rows[chosen], "k", marker="D", linestyle="", markersize=2.5)
        left += width
    axes.plot([], [], "k", marker="D", linestyle="", markersize=2.5, label="default readings")
    tick = {"marker": "|", "linestyle": "", "markersize": 7, "markeredgewidth": 1.2}
    axes.plot(100 * table["holds"], rows, "k", **tick, label="estimate holds up to here")
    axes.set_yticks(rows, table.claim, fontsize=6)
    for row, text in zip(rows, table.decided_by, strict=True):
        axes.text(101, row, text.split(";")[0].replace("_", " "), fontsize=5.5, va="center")
    axes.set_xlim(0, 100)
    axes.set_ylim(-0.6, len(table) - 0.4)
    axes.set_xlabel("share of universes (%)")
    axes.set_title(
        f"Verdicts in {table.universes.max()} universes of {n_seeds} seeds; right: the reading that decides most"
    )
    axes.grid(visible=False)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


@style.styled
def draw_specification(found: pd.DataFrame, claim: str) -> Figure:
    """Specification curve of a claim: its effect in every universe in ascending order, and the readings below."""
    ordered = found.query(f"claim == {claim!r}").sort_values("value", ignore_index=True)
    figure = Figure(figsize=(style.TWO_COLUMNS[0], 4.8))
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(1, 1.6))
    for verdict in VERDICTS:
        here = ordered[ordered.verdict == verdict]
        bars = [here.value - here.ci_low, here.ci_high - here.value]
        look = {"color": _COLOURS[verdict], "marker": _MARKS[verdict], "markersize": 3, "linestyle": ""}
        top.errorbar(here.index, here.value, bars, label=verdict, elinewidth=0.7, **look)
    top.axhline(
        ordered.limit[0], color="black", linewidth=0.8, linestyle="--", label=f"limit (holds if {ordered.relation[0]})"
    )
    top.set_ylabel("effect")
    top.legend(ncols=4, loc="best")
    top.set_title(f"{claim}: {len(ordered)} universes, {ordered.n_seeds[0]} seeds, bars: 95 % intervals")
    ticks: dict[float, str] = {}
    for number, (reading, levels) in enumerate(LEVELS.items()):
        for level in map(level_name, levels):
            row = -(len(ticks) + 0.5 * number)  # half a row between readings
            ticks[row] = f"{reading}: {level}".replace("_", " ")
            here = ordered[ordered[reading] == level]
            bottom.scatter(
                here.index, np.full(len(here), row), s=5, c=here.verdict.map(_COLOURS), marker="s", linewidths=0
            )
    bottom.set_yticks(list(ticks), list(ticks.values()), fontsize=5.5)
    bottom.set_ylim(min(ticks) - 1, 1)
    bottom.set_xlabel("universes, ordered by the effect")
    bottom.grid(visible=False)
    return figure
