"""The claims under many readings of the paper: a space-filling design over all that it leaves open.

Readings are run in blocks, each of which is a sweep with its own source agents, so that any number of them can be
added, resumed, or sent to other machines.
"""

from __future__ import annotations

import csv
import hashlib
import itertools
import json
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jrcjax.checks import refuse, require_integer
from jrcjax.training.transfer import TARGET_LEARNERS
from sweeps import design
from sweeps.studies import fig9
from sweeps.studies.fig6 import FIG6
from sweeps.studies.fig7 import FIG7
from sweeps.studies.fig8 import FIG8
from sweeps.studies.readings import PER_BLOCK, READINGS, SOURCE, unit_of, values_at
from sweeps.studies.source import ALWAYS_SHARED
from sweeps.sweep import Size, Study, Sweep

SIZE = Size(seeds=2, episodes=450)
"""The claims speak of episodes up to 400, and of what follows."""
_NUMBER, _SMOKE_NUMBER, _MOST = 512, 2, 2**20
_LANES = 128  # seeds times points in a part, as far as points allow


class Point(NamedTuple):
    """An environment in which a claim of the paper is judged: some numbers of the target, by column."""

    figures: tuple[str, ...]
    """The figures that it belongs to."""
    values: Mapping[str, float]


def _of(sweep: Sweep, value: float) -> Point:
    (column,) = sweep.design.columns
    return Point((sweep.name,), {column.name: value})


_ALL = ("fig5b", "fig6", "fig7", "fig8", "fig9")
POINTS = (
    Point(_ALL, fig9.PRIORITISED),  # the target as it is
    *(_of(FIG6, p) for p in (0.6, 0.8, 0.9)),
    *(_of(FIG7, tau) for tau in (0.1, 0.6, 0.9)),
    *(_of(FIG8, omega) for omega in (8.0, 40.0)),
    Point(("fig9",), {fig9.PATHS.get(name) or name: value for name, value in fig9.UNIFORM.items()}),
)
"""The points of every reading."""
_FIGURE_PATHS = {column.name: column.path for sweep in (FIG6, FIG7, FIG8) for column in sweep.design.columns}
_POINT_PATHS = {"reading": "", "point_of_reading": "", "prioritised": "", **_FIGURE_PATHS}


def _paths(values: Sequence[Mapping[str, float]]) -> dict[str, str]:
    return {path: path for path in dict.fromkeys(path for row in values for path in row)}


def points_of(figures: Collection[str]) -> tuple[int, ...]:
    """Places in POINTS of what some figures need, of the target as it is at least."""
    return tuple(i for i, point in enumerate(POINTS) if not i or set(point.figures) & set(figures))


def block_sweep(
    study: str,
    numbers: Sequence[int],
    values: Sequence[Mapping[str, float]],
    points: Sequence[int] = range(len(POINTS)),
    seeds_per_part: int = Sweep.seeds_per_part,
) -> Sweep:
    """Points of some readings, as one program for each optimiser and n.

    Args:
      study: folder of the results.
      numbers: of the readings, ascending.
      values: of each reading by path; what is left out is as by default.
      points: places in POINTS.
      seeds_per_part: see `Sweep`.
    """
    number = {"prioritised": 1.0}
    rows = [
        {"reading": float(reading), "point_of_reading": float(i)} | _target(of) | number | dict(POINTS[i].values)
        for reading, of in zip(numbers, values, strict=True)
        for i in points
    ]
    uniform = {path: path for path in fig9.PATHS.values() if path}
    sources = [{"reading": float(n)} | _source(of) for n, of in zip(numbers, values, strict=True)]
    name = f"{study}/{numbers[0]:06d}-{numbers[-1]:06d}"
    if len(numbers) <= numbers[-1] - numbers[0]:  # some of them, which others may start and end like
        name += f"-{digest_of(tuple(numbers))}"
    source = Sweep(
        name=f"{name}-source",
        description="source agents of these readings",
        learners=("ddqn", "q_learning", "round_robin"),
        environment="source",
        design=design.table(sources, {"reading": ""} | _paths([_source(of) for of in values])),
        hands_on=True,
        own=True,
        seeds_per_part=seeds_per_part,
    )
    return Sweep(
        name=name,
        description="the claims' points in these readings",
        learners=TARGET_LEARNERS,
        design=design.table(rows, _POINT_PATHS | _paths([_target(of) for of in values]) | uniform),
        source=source,
        source_points=tuple(np.repeat(range(len(numbers)), len(points)).tolist()),
        own=True,
        seeds_per_part=seeds_per_part,
    )


def digest_of(content: object) -> str:
    """Eight digits that tell names of folders apart."""
    return hashlib.sha256(repr(content).encode()).hexdigest()[:8]


def _target(values: Mapping[str, float]) -> dict[str, float]:
    return {path: value for path, value in values.items() if path != SOURCE}


def _source(values: Mapping[str, float]) -> dict[str, float]:
    """What of a reading holds in the source: all, or its environment and n alone if the source is Table I's."""
    own = _target(values)
    if not values.get(SOURCE):
        return own
    return {path: value for path, value in own.items() if path.startswith("env.") or path in ALWAYS_SHARED}


class Selection(NamedTuple):
    """Which readings of each block are run, and at which points."""

    per_block: int = PER_BLOCK
    """How many, see `some_of`."""
    asked: Collection[int] | None = None
    """The readings asked for of these; all if None."""
    without: Collection[int] = ()
    """Readings to leave out."""
    figure: str | None = None
    """Whose points are run, with the target as it is; all if None."""

    def of(self, block: Sequence[int]) -> list[int]:
        """The readings of a block that are run."""
        some = some_of(block, self.per_block)
        return [n for n in some if (self.asked is None or n in self.asked) and n not in self.without]


ALL = Selection()


def sweeps_of(number: int, first: int = 0, selection: Selection = ALL) -> tuple[Sweep, ...]:
    """The blocks of readings `first`, which is the first of a block, to `first + number`, as far as selected."""
    values = {first + i: values_at(unit) for i, unit in enumerate(unit_of(number, first))}
    blocks = [selection.of(list(block)) for _, block in itertools.groupby(values, lambda n: n // PER_BLOCK)]
    name, points = "multiverse", tuple(range(len(POINTS)))
    if selection.figure is not None:
        name, points = f"{name}/{selection.figure}", points_of({selection.figure})
    return tuple(block_sweep(name, of, [values[n] for n in of], points, _per_part(of, points)) for of in blocks if of)


def some_of(block: Sequence[int], number: int) -> list[int]:
    """So many readings of a block, ascending: a simple random sample that is always the same, and part of larger ones.

    Readings at the same place of every block would have much in common: points of a Sobol' sequence whose numbers
    differ by a multiple of a power of two agree in the leading digits of many coordinates.
    """
    order = np.random.default_rng(block[0] // PER_BLOCK).permutation(PER_BLOCK)
    return sorted(sorted(block, key=lambda n: order[n % PER_BLOCK])[:number])


def _per_part(readings: Sequence[int], points: Sequence[int]) -> int:
    """Seeds of a part, more of them where few readings and points would not fill the devices' blocks."""
    return max(SIZE.seeds, min(Sweep.seeds_per_part, _LANES // (len(readings) * len(points))))


MULTIVERSE = Study(
    name="multiverse",
    description=f"all claims in {_NUMBER} readings of the paper, over {len(READINGS)} questions that it leaves open",
    sweeps=(),
    size=SIZE,
    presets=("paper",),  # where they differ is a reading itself
    summary="paper_figs.studies.summaries:summarise_multiverse",
)


def study_of(number: int | None, smoke: bool, first: int = 0, selection: Selection = ALL) -> Study:
    """The study of the readings from `first` on, up to so many in all, as far as selected.

    Raises:
      ValueError: naming the argument, the value and what is allowed.
    """
    usual = _SMOKE_NUMBER if smoke else _NUMBER
    number = usual if number is None else number
    require_integer("readings", number, 1, _MOST)
    if first not in range(0, number, PER_BLOCK):
        refuse("first", first, f"a multiple of {PER_BLOCK} from 0 on, less than readings = {number}")
    require_integer("per_block", selection.per_block, 1, PER_BLOCK)
    return MULTIVERSE.with_sweeps(sweeps_of(number - first, first, selection))


def verdicts_file(out: Path) -> Path:
    """Where the summary of a multiverse keeps its verdicts, a row per reading and statement."""
    return out / MULTIVERSE.name / "summary" / "verdicts.csv"


def require_summary(out: Path, size: Size) -> None:
    """Raises ValueError naming `keep` or `episodes` unless there is a summary of runs of this length in `out`."""
    path = verdicts_file(out)
    if not path.is_file():
        refuse("keep", True, f"where an earlier run left its summary, and {path} is missing")
    kept = _lengths(path.parent)
    if kept - {size.episodes}:
        refuse("episodes", size.episodes, f"{', '.join(map(str, sorted(kept)))}, as in the summary that is kept")


def require_nothing_lost(out: Path, sweeps: Sequence[Sweep], size: Size) -> None:
    """Raises ValueError naming `keep` if the summary in `out` tells of runs that these sweeps do not make again."""
    path = verdicts_file(out)
    if not path.is_file():
        return
    with path.open(encoding="utf-8", newline="") as file:
        there = {(int(row["reading"]), int(row["n_seeds"])) for row in csv.DictReader(file)}
    made = {(int(n), size.seeds) for sweep in sweeps if sweep.source for n in sweep.source.design.values("reading")}
    lost = there - made if _lengths(path.parent) == {size.episodes} else there
    if lost:
        readings = len({reading for reading, _ in lost})
        what = f"what the summary in {path.parent} says of {readings} readings, which this run does not make"
        refuse("keep", False, f"True, which keeps {what} with as many seeds and episodes; or another --out")


def _lengths(summary: Path) -> set[int]:
    """The numbers of episodes of the runs that a summary rests on."""
    manifests = json.loads((summary / "manifests.json").read_text(encoding="utf-8"))
    return {manifest["configuration"]["episodes"] for manifest in manifests.values()}
