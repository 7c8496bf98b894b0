"""The reading in which most of the paper's text holds: a search over all that the text leaves open, then fresh seeds.

CMA-ES with margin (Hamano et al. 2022) proposes readings, one generation after the other, from each start in turn; a
generation is one block. What it maximises is the agreement: the mean over the paper's claims C1 to C15 of the share of
their statements whose estimate is on the claim's side, all figures in one reading. The best of hundreds looks better
than it is, so it is confirmed with seeds that nothing was chosen by; and since it may be a world with nothing to learn,
so is the best of those where it takes more than one action.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from jrcjax.checks import refuse
from jrcjax.files import write_text
from paper_figs.claims.judge import shortfall
from paper_figs.claims.table import CLAIMS, number_of
from paper_figs.plots import readings as plot
from paper_figs.plots import style
from paper_figs.studies import multiverse
from sweeps.engine.job import Job
from sweeps.preset import preset_text
from sweeps.results import store
from sweeps.studies.multiverse import block_sweep, points_of, verdicts_file
from sweeps.studies.readings import PER_BLOCK, READINGS, as_text, default_unit, is_static, range_of, unit_of, values_at
from sweeps.studies.reconstruction import NAME, Effort, confirmation_sweep, generation_sweep, of_seeds
from sweeps.sweep import Size, Sweep

BEST = "best"
"""The best reading's name as a preset; the summary holds it as a file."""
PRESET_FILE = f"{BEST}.toml"
_SIGMA = 0.25  # of the first generation, in the unit cube
_STATIC = np.array([is_static(reading) for reading in READINGS])
_LEVELS = np.array([len(range_of(reading).levels) for reading in READINGS])
DEFAULT = "default"
"""Name of the first reading of a multiverse."""
ALL = "all"
"""What the reading is the best for that agrees most with all claims together."""
TRADE_OFF = "trade-off"
"""What the reading is the best for that agrees most of those with a trade-off."""
LEAST_LOSS = 0.01
"""A target has a trade-off if the best policy that ignores the state loses this share of the optimum or more."""


class Tried(NamedTuple):
    """A reading, and what its estimates say."""

    name: str
    """Where it comes from: "default", "multiverse 17" or "search 203"."""
    unit: np.ndarray
    """Its place in the unit cube."""
    verdicts: pd.DataFrame
    """A row per statement, see `multiverse.verdicts`."""

    @property
    def agreement(self) -> float:
        """See `multiverse.agreement`."""
        return float(multiverse.agreement(self.verdicts).mean())


def search(effort: Effort, size: Size, out: Path, run: Callable[..., Path]) -> list[Path]:
    """Searches, confirms, and writes tables, figure and preset.

    Args:
      effort: how much to search and to confirm.
      size: of the runs that are searched.
      out: the folder of all results. If a multiverse's summary is there, its readings are tried already, and the search
        starts from the best of them. What an earlier search tried or confirmed is not run again; its verdicts are kept
        in OUT/reconstruction/summary.
      run: runs a sweep; takes the size as a keyword.

    Returns:
      The files in OUT/reconstruction/summary.

    Raises:
      ValueError: naming `readings`, if a longer search has left its summary there.
    """
    _require_as_many(effort, out / NAME / "summary")
    known = _of_multiverse(out)
    optimisers = [_Optimiser(unit, effort.per_generation, seed) for seed, unit in enumerate(_starts(known, effort))]
    found: list[Tried] = []
    while len(found) < effort.readings:
        optimiser = optimisers[len(found) // effort.per_generation % len(optimisers)]
        units, first = optimiser.ask(), len(found)
        verdicts = _kept(generation_sweep(first, units), size, out, run)
        generation = [Tried(f"search {first + i}", *each) for i, each in enumerate(zip(units, verdicts, strict=True))]
        optimiser.tell([one.agreement for one in generation])
        found += generation
    tried = known + found
    lost = lost_by_one_action([one.unit for one in tried])
    used = max([size.seeds, *(int(one.verdicts.n_seeds.max()) for one in known)])
    chosen, fresh = choice_of(tried, lost), of_seeds(size, used + effort.confirm)
    tables = {"tried": tried_table(tried, lost), "closest": closest_table(tried)}
    confirmed, written = [], []
    for choice in chosen:
        sweep = confirmation_sweep(choice.reading.unit, choice.figures)
        confirmed += _kept(sweep, fresh, out, run, first_seed=used)
        # Each reading takes long, so the summary says what is confirmed so far.
        tables["confirmed"] = confirmed_table(chosen[: len(confirmed)], confirmed)
        written = _write(out / NAME / "summary", tables, chosen[0].reading)
    return written


def _require_as_many(effort: Effort, summary: Path) -> None:
    """Refuses a search that would replace the summary of a longer one, such as a tiny one."""
    path = summary / "tried.csv"
    if not path.is_file():
        return
    there = int(pd.read_csv(path).reading.str.startswith("search ").sum())
    if -(-effort.readings // effort.per_generation) * effort.per_generation < there:  # whole generations are tried
        refuse("readings", effort.readings, f"at least {there}, as in the summary in {summary}; or another --out")


class Choice(NamedTuple):
    """A reading to confirm, and what it is the best for."""

    reading: Tried
    best_for: tuple[str, ...]
    """"all", "trade-off", or numbers of claims."""

    def speaks_of(self, claims: pd.Series) -> pd.Series:
        """Which statements it is to confirm: all, or those of the claims that it is the best for."""
        return claims.map(lambda claim: bool({ALL, TRADE_OFF, number_of(claim)} & set(self.best_for))).astype(bool)

    @property
    def figures(self) -> set[str]:
        """The figures that these statements are about."""
        names = pd.Series([claim.claim for claim in CLAIMS])
        return {claim.sweep for claim, wanted in zip(CLAIMS, self.speaks_of(names), strict=True) if wanted}


class _Optimiser:
    """CMA-ES over all that does not decide code, which stays as it is at the start."""

    def __init__(self, start: np.ndarray, population: int, seed: int):
        from cmaes import CMAwM

        levels, self._start = _LEVELS[~_STATIC], start
        edge = np.where(levels > 0, 0.5 / np.maximum(levels, 1), 0.0)
        steps = np.where(levels > 0, 1.0 / np.maximum(levels, 1), 0.0)
        bounds = np.stack([edge, 1.0 - edge], axis=1)
        mean = np.clip(start[~_STATIC], bounds[:, 0], bounds[:, 1])
        self._cma = CMAwM(mean, _SIGMA, bounds=bounds, steps=steps, population_size=population, seed=seed)
        self._asked: list[np.ndarray] = []

    def ask(self) -> list[np.ndarray]:
        """Places of the next generation in the unit cube."""
        units = []
        self._asked = []
        for _ in range(self._cma.population_size):
            place, asked = self._cma.ask()
            unit = self._start.copy()
            unit[~_STATIC] = np.clip(place, 0.0, np.nextafter(1.0, 0.0))
            units.append(unit)
            self._asked.append(asked)
        return units

    def tell(self, agreements: list[float]) -> None:
        """Says how well the last generation agrees with the paper."""
        self._cma.tell([(asked, -agreement) for asked, agreement in zip(self._asked, agreements, strict=True)])


def _of_multiverse(out: Path) -> list[Tried]:
    """The readings of a multiverse, if there is one."""
    path = verdicts_file(out)
    if not path.is_file():
        return []
    readings = multiverse.estimates(pd.read_csv(path, keep_default_na=True)).groupby("reading")
    return [
        Tried(f"multiverse {n}" if n else DEFAULT, unit_of(1, int(n))[0] if n else default_unit(), of)  # pyright: ignore
        for n, of in readings
    ]


def _starts(known: list[Tried], effort: Effort) -> list[np.ndarray]:
    """The best known readings with different code; the default and the first of other blocks where none is known."""
    if not known:
        others = [unit_of(1, PER_BLOCK * block)[0] for block in range(1, effort.starts)]
        return [default_unit(), *others]
    different: dict[tuple[float, ...], np.ndarray] = {}
    for one in sorted(known, key=lambda one: -one.agreement):
        different.setdefault(tuple(values_at(one.unit)[r.path] for r in READINGS if is_static(r)), one.unit)
    return list(different.values())[: effort.starts]


def lost_by_one_action(units: Sequence[np.ndarray]) -> np.ndarray:
    """The share of the optimum that the best policy that ignores the state loses in the target, exact, [readings].

    Where it is 0 radar and data are no trade-off: an agent that ignores what it observes is optimal.
    """
    parts, one_episode = [], Size(seeds=1, episodes=1)
    for first in range(0, len(units), PER_BLOCK):
        values = [values_at(unit) for unit in units[first : first + PER_BLOCK]]
        sweep = block_sweep(NAME, range(len(values)), values, points_of(()))
        of = Job(sweep, one_episode).reference
        parts.append((of.optimum.reward - of.constant.reward) / np.abs(of.optimum.reward))
    return np.concatenate(parts)


def choice_of(tried: list[Tried], lost: np.ndarray) -> list[Choice]:
    """The readings to confirm: the best for all claims together, also of those with a trade-off, and for each claim.

    Args:
      tried: all readings.
      lost: by one action in each, see `lost_by_one_action`.
    """
    share = pd.DataFrame([multiverse.agreement(one.verdicts) for one in tried])
    agreement = share.mean(axis=1)
    best = {ALL: int(agreement.argmax())}
    if (lost >= LEAST_LOSS).any():
        best[TRADE_OFF] = int(agreement.where(lost >= LEAST_LOSS).argmax())
    for claim in share.columns:  # of those where it holds best, the one that agrees most
        best[claim] = int((share[claim] + 1e-3 * agreement).argmax())
    chosen: dict[int, list[str]] = {}
    for what, place in best.items():
        chosen.setdefault(place, []).append(what)
    return [Choice(tried[place], tuple(what)) for place, what in chosen.items()]


def _kept(sweep: Sweep, size: Size, out: Path, run: Callable[..., Path], first_seed: int = 0) -> list[pd.DataFrame]:
    """The verdicts in each reading of a block, from the seeds after the first ones; run unless they are kept."""
    key = hashlib.sha256(repr((sweep, size, first_seed)).encode()).hexdigest()[:8]
    path = out / NAME / "summary" / f"{sweep.name.removeprefix(NAME + '/')}-{key}.csv"
    if not path.is_file():
        run(sweep, size=size)
        path.parent.mkdir(parents=True, exist_ok=True)
        style.save_table(_verdicts(sweep, size, out, first_seed), path)
    return [of for _, of in pd.read_csv(path).groupby("reading")]


def _verdicts(sweep: Sweep, size: Size, out: Path, first_seed: int) -> pd.DataFrame:
    assert sweep.source
    data = [
        store.load(out / part.name, size.seeds).isel(seed=slice(first_seed, None)) for part in (sweep.source, sweep)
    ]
    return multiverse.verdicts(list(multiverse.of_readings(*data)))


def _write(folder: Path, tables: Mapping[str, pd.DataFrame], best: Tried) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    preset = preset_text({}, {path: as_text(path, value) for path, value in values_at(best.unit).items()})
    return [
        *(style.save_table(table, folder / f"{name}.csv") for name, table in tables.items()),
        write_text(folder / PRESET_FILE, preset),
        *style.save(plot.draw_search(tables["tried"], tables["confirmed"], LEAST_LOSS), folder / NAME),
    ]


def tried_table(tried: list[Tried], lost: np.ndarray) -> pd.DataFrame:
    """One row per reading that was tried: the agreement of its estimates, what one action loses, and values by path."""
    return pd.DataFrame(
        [
            {"reading": one.name, "agreement": one.agreement, "lost_by_one_action": share}
            | {path: as_text(path, value) for path, value in values_at(one.unit).items()}
            for one, share in zip(tried, lost, strict=True)
        ]
    )


def confirmed_table(chosen: list[Choice], confirmed: list[pd.DataFrame]) -> pd.DataFrame:
    """One row per chosen reading and statement: what the search promised, and what fresh seeds gave."""
    parts = []
    for choice, of in zip(chosen, confirmed, strict=True):
        wanted = choice.speaks_of(of.claim).to_numpy()
        promised, of = choice.reading.verdicts[wanted], of[wanted]
        columns = {
            "reading": choice.reading.name,
            "best_for": " ".join(choice.best_for),
            "claim": of.claim,
            "promised_value": promised.value.to_numpy(),
            "promised": promised.holds.to_numpy(bool),
            "promised_seeds": promised.n_seeds.to_numpy(int),
            **{name: of[name] for name in ("value", "ci_low", "ci_high", "verdict", "negligible", "n_seeds")},
            "holds": of.holds.astype(bool),
        }
        parts.append(pd.DataFrame(columns))
    return pd.concat(parts, ignore_index=True)


def closest_table(tried: list[Tried]) -> pd.DataFrame:
    """One row per statement: in how many readings its estimate is on its side, and the one that comes closest to it."""
    claims, rows = {claim.claim: claim for claim in CLAIMS}, []
    found = pd.concat([one.verdicts.assign(reading=one.name) for one in tried])
    for name, of in found.groupby("claim", sort=False):
        known = of[np.isfinite(of.value.to_numpy(float))]
        row = {"claim": name, "tried": len(of), "known": len(known), "holds": int(of.holds.astype(bool).sum())}
        if len(known) and name in claims:
            short = shortfall(known.value.to_numpy(float), claims[str(name)].relation, claims[str(name)].limit)
            closest = known.iloc[int(short.argmin())]
            row |= {"closest": closest.reading, "value": closest.value, "shortfall": float(short.min())}
        rows.append(row)
    return pd.DataFrame(rows)
