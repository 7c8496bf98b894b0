"""Traffic from nuScenes: `python -m jrcjax.config.nuscenes DIR [--out FILE.toml]` writes a parameter file.

DIR holds the data set's own JSON tables, such as `v1.0-trainval`. What is measured, over all samples (key frames):

- *density*: mean number of cars and pedestrians whose centre lies in a square of 45 m x 45 m, as the paper counts them
  (section VI-A.2). The square is centred on the ego vehicle and turned with it, or lies ahead of it as a radar's does
  (`--square ahead`); the ego pose is that of the sample's lidar key frame.
- *sizes*: mean and standard deviation of their lengths and widths, each object once per sample in which it is counted.

Cars are the category `vehicle.car`; pedestrians are adults, children, construction workers and police officers on foot.
Tables are read row by row; only what is needed of each sample and each object is kept. Needs ijson (extra "nuscenes").
"""

from __future__ import annotations

import codecs
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import tyro

from jrcjax.checks import refuse
from jrcjax.files import write_text
from jrcjax.radar.modes import REFERENCE_SIDE
from jrcjax.types import choice

CLASSES = {
    "cars": ("vehicle.car",),
    "pedestrians": (
        "human.pedestrian.adult",
        "human.pedestrian.child",
        "human.pedestrian.construction_worker",
        "human.pedestrian.police_officer",
    ),
}
"""Names of nuScenes' categories by class of objects."""
SQUARES = ("around", "ahead")
_MOST_CHARACTERS = 300  # of what a reader of JSON says


class Traffic(NamedTuple):
    """Statistics of the classes of objects, in the order of CLASSES."""

    samples: int
    """Key frames."""
    counted: tuple[int, ...]
    """[C] objects counted in all samples together."""
    size_mean: tuple[tuple[float, float], ...]
    """[C] mean length and width in m."""
    size_std: tuple[tuple[float, float], ...]
    """[C] their standard deviations in m."""

    @property
    def mean_count(self) -> tuple[float, ...]:
        """[C] mean number of objects per sample."""
        return tuple(count / self.samples for count in self.counted)


@dataclass
class _Pose:
    """Position in m and direction of the ego vehicle in the global frame."""

    x: float
    y: float
    cos: float
    sin: float


@dataclass
class _Sizes:
    """Sums over the objects of one class."""

    count: int = 0
    total: tuple[float, float] = (0.0, 0.0)
    squares: tuple[float, float] = (0.0, 0.0)

    def add(self, size: tuple[float, float]) -> None:
        """Counts one object of a length and a width."""
        self.count += 1
        self.total = self.total[0] + size[0], self.total[1] + size[1]
        self.squares = self.squares[0] + size[0] ** 2, self.squares[1] + size[1] ** 2

    @property
    def mean(self) -> tuple[float, float]:
        """Of length and width in m."""
        return self.total[0] / self.count, self.total[1] / self.count

    @property
    def std(self) -> tuple[float, float]:
        """Of length and width in m."""
        variance = [square / self.count - mean**2 for square, mean in zip(self.squares, self.mean, strict=True)]
        return math.sqrt(max(variance[0], 0.0)), math.sqrt(max(variance[1], 0.0))


def traffic(folder: str | Path, square: str = "around") -> Traffic:
    """Reads the tables of nuScenes.

    Args:
      folder: with sample.json, sample_annotation.json and the others.
      square: one of SQUARES, where the square of 45 m x 45 m lies.

    Raises:
      ValueError: naming the table and what is wrong with it: it is missing, or one of its columns is, a token that no
        row has, or no object of a class.
      ModuleNotFoundError: without ijson.
    """
    choice("square", square, SQUARES)
    folder = Path(folder)
    poses = _poses(folder)
    kinds = _class_of_instances(folder)
    low = 0.0 if square == "ahead" else -REFERENCE_SIDE / 2
    sums = {name: _Sizes() for name in CLASSES}
    for table, row in _rows(folder, "sample_annotation", "sample_token", "instance_token", "translation", "size"):
        pose = _linked(table, row, "sample_token", poses, "sample")
        kind = _linked(table, row, "instance_token", kinds, "instance")
        if kind is None:
            continue
        x, y, _ = _vector(table, row, "translation", 3)
        width, length, _ = _vector(table, row, "size", 3)
        ahead = (x - pose.x) * pose.cos + (y - pose.y) * pose.sin
        left = (y - pose.y) * pose.cos - (x - pose.x) * pose.sin
        if low <= ahead <= low + REFERENCE_SIDE and abs(left) <= REFERENCE_SIDE / 2:
            sums[kind].add((length, width))
    for name, sizes in sums.items():
        if not sizes.count:
            refuse(str(folder / "sample_annotation.json"), f"no {name} in range", f"some {name} in some sample")
    counted = tuple(sizes.count for sizes in sums.values())
    means, deviations = (tuple(getattr(sizes, what) for sizes in sums.values()) for what in ("mean", "std"))
    return Traffic(len(poses), counted, means, deviations)


def to_toml(found: Traffic, square: str = "around") -> str:
    """A file for `jrcjax.load_params`: the paper's target environment with these objects."""
    total = sum(found.counted)
    names = ", ".join(CLASSES)
    counts = ", ".join(f"{mean:.4g} {name}" for name, mean in zip(CLASSES, found.mean_count, strict=True))
    where = "centred on the ego vehicle and turned with it" if square == "around" else "ahead of the ego vehicle"
    return f"""\
# Objects as in nuScenes: means over {found.samples} samples of what lies in 45 m x 45 m {where}.
# Per sample {counts}. Classes of objects in this order: {names}.
environment = "target"

[radar]
density = {total / found.samples!r}  # objects per 45 m x 45 m
class_share = {[count / total for count in found.counted]}
size_mean = {[list(size) for size in found.size_mean]}  # length and width in m per class
size_std = {[list(size) for size in found.size_std]}  # their standard deviations in m
"""


def _rows(folder: Path, name: str, *columns: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """(where, row) of a table, one row after the other; all rows have the columns."""
    import ijson  # pyright: ignore[reportMissingImports]  # only here, so that the rest works without it

    path, number = folder / f"{name}.json", -1
    if not path.is_file():
        found = sorted(str(table.parent) for table in folder.glob("*/sample.json"))
        refuse(str(path), "missing", f"a folder with nuScenes' tables{f', perhaps {found[0]}' if found else ''}")
    with path.open("rb") as file:
        if file.read(len(codecs.BOM_UTF8)) != codecs.BOM_UTF8:
            file.seek(0)
        try:
            for number, row in enumerate(ijson.items(file, "item", use_float=True)):
                where = f"{path}: row {number}"
                for column in columns:
                    if not isinstance(row, dict) or column not in row:
                        refuse(where, f"no column {column!r}", f"a row with {', '.join(columns)}")
                yield where, row
        except ijson.JSONError as error:
            # The reader of JSON says what it is in the first line, and shows the place in the second.
            said = [" ".join(line.split()) for line in str(error).strip().splitlines()[:2]]
            what = f"no JSON after row {number}: {' near '.join(said)}"
            refuse(str(path), what[:_MOST_CHARACTERS], "a JSON array of rows, whose numbers are finite")
    if number < 0:
        refuse(str(path), "no rows", "a JSON array of rows")


def _linked(where: str, row: dict[str, Any], column: str, known: dict[str, Any], table: str) -> Any:
    """What is known of the row of another table that a token names."""
    token = row[column]
    if not isinstance(token, str) or token not in known:
        refuse(f"{where}: {column}", str(token), f"the token of a row of {table}.json")
    return known[token]


def _vector(where: str, row: dict[str, Any], column: str, length: int) -> list[float]:
    value = row[column]
    numbers = isinstance(value, list) and all(isinstance(x, int | float) and math.isfinite(x) for x in value)
    if not numbers or len(value) != length:
        refuse(f"{where}: {column}", str(value), f"a list of {length} finite numbers")
    return value


def _poses(folder: Path) -> dict[str, _Pose]:
    """The ego pose of every sample: that of its lidar key frame."""
    lidars = {row["token"]: row["modality"] == "lidar" for _, row in _rows(folder, "sensor", "token", "modality")}
    is_lidar = {
        row["token"]: _linked(where, row, "sensor_token", lidars, "sensor")
        for where, row in _rows(folder, "calibrated_sensor", "token", "sensor_token")
    }
    samples = {row["token"]: "" for _, row in _rows(folder, "sample", "token")}
    columns = ("sample_token", "ego_pose_token", "calibrated_sensor_token", "is_key_frame")
    for where, row in _rows(folder, "sample_data", *columns):
        if row["is_key_frame"] and _linked(where, row, "calibrated_sensor_token", is_lidar, "calibrated_sensor"):
            _linked(where, row, "sample_token", samples, "sample")
            samples[row["sample_token"]] = row["ego_pose_token"]
    for token, pose in samples.items():
        if not pose:
            refuse(f"{folder / 'sample.json'}: token", token, "a sample with a lidar key frame in sample_data.json")
    poses: dict[str, _Pose | None] = dict.fromkeys(samples.values())
    for where, row in _rows(folder, "ego_pose", "token", "translation", "rotation"):
        if row["token"] in poses:
            poses[row["token"]] = _pose(where, row)
    found = {}
    for sample, token in samples.items():
        if poses[token] is None:
            where = f"{folder / 'sample_data.json'}: ego_pose_token"
            refuse(where, token, "the token of a row of ego_pose.json")
        found[sample] = poses[token]
    return found


def _pose(where: str, row: dict[str, Any]) -> _Pose:
    x, y, _ = _vector(where, row, "translation", 3)
    w, i, j, k = _vector(where, row, "rotation", 4)
    # The forward direction (1, 0, 0) turned by the quaternion, seen from above.
    heading = math.atan2(2.0 * (w * k + i * j), w * w + i * i - j * j - k * k)
    return _Pose(x, y, math.cos(heading), math.sin(heading))


def _class_of_instances(folder: Path) -> dict[str, str | None]:
    """The class of every object, None for those of no class."""
    of_name = {name: kind for kind, names in CLASSES.items() for name in names}
    names = {row["token"]: str(row["name"]) for _, row in _rows(folder, "category", "token", "name")}
    for kind, known in CLASSES.items():
        if not set(known) & set(names.values()):
            found = f"no {kind} among {', '.join(sorted(set(names.values())))}"
            refuse(f"{folder / 'category.json'}: name", found[:_MOST_CHARACTERS], " or ".join(known))
    of_category = {token: of_name.get(name) for token, name in names.items()}
    return {
        row["token"]: _linked(where, row, "category_token", of_category, "category")
        for where, row in _rows(folder, "instance", "token", "category_token")
    }


@dataclass(frozen=True)
class Arguments:
    """Traffic density and sizes of cars and pedestrians in nuScenes, as a parameter file."""

    folder: tyro.conf.Positional[Path]
    """Folder with the data set's JSON tables, such as v1.0-trainval."""
    out: Path | None = None
    """The file to write; standard output if there is none."""
    square: str = "around"
    """Where the square of 45 m x 45 m lies: around the ego vehicle, or ahead of it."""


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status."""
    given = tyro.cli(Arguments, prog="python -m jrcjax.config.nuscenes", args=args)
    try:
        text = to_toml(traffic(given.folder, given.square), given.square)
        if given.out is None:
            print(text, end="")
        else:
            write_text(given.out, text)
            print(given.out)
    except ModuleNotFoundError as error:
        print(f"error: {error}; install jrcjax[nuscenes]", file=sys.stderr)
        return 2
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
