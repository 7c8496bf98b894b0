"""Results of a sweep on disk: what is in a part (`sweeps.results.parts`), which parts go together, the manifest.

A part holds the configuration that made it; a folder never mixes configurations. The manifest says what is in the
folder, for a reader; it follows from the parts and is written anew whenever it does not fit them.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from jrcjax import files
from jrcjax.provenance import provenance
from jrcjax.training.rollout import Log
from sweeps import interrupts
from sweeps.engine.job import Job
from sweeps.results.configuration import configuration, coordinates, differing, sweep_of
from sweeps.results.parts import Part, finished_seeds, part_path, parts_of, read_part, write_part

__all__ = [
    "MANIFEST", "ConfigurationMismatch", "about", "add_part", "check_configuration", "check_folder", "configuration",
    "dataset", "finished_seeds", "lacking", "load", "part_path", "points_of", "sweep_of", "write_manifest",
    "write_part",
]  # fmt: skip

MANIFEST = "manifest.json"


class ConfigurationMismatch(ValueError):
    """A folder holds results of another configuration."""


def check_folder(folder: Path, job: Job) -> None:
    """Refuses a folder with results of another configuration, and sets aside what is of another sweep.

    Raises:
      ConfigurationMismatch: naming each field that differs, with both values.
    """
    parts = parts_of(folder)
    wanted = configuration(job) if parts else {}
    for part in parts:
        if part.configuration.get("sweep") != job.sweep.name:
            files.set_aside(part.path, f"it is of the sweep {part.configuration.get('sweep')!r}")
        else:
            check_configuration(part, wanted)


def lacking(job: Job, seeds: Iterable[int], out: Path) -> set[int]:
    """Those of the seeds that the folder of the job's sweep in `out` has no results of.

    Raises:
      ConfigurationMismatch: if it holds results of another configuration.
    """
    folder = out / job.sweep.name
    check_folder(folder, job)
    return set(seeds) - finished_seeds(folder)


def check_configuration(part: Part, wanted: dict[str, Any]) -> None:
    """Refuses a part of another configuration than `wanted`.

    Raises:
      ConfigurationMismatch: naming each field that differs, with both values.
    """
    if found := differing(part.configuration, wanted):
        raise ConfigurationMismatch(
            f"{part.path} holds results of another configuration ({'; '.join(found)}); "
            "choose another --out, or remove the folder"
        )


def dataset(job: Job, seeds: range, log: dict[str, Log]) -> xr.Dataset:
    """Results of some seeds with named dimensions: algorithm, point, seed, episode (from 1).

    What varies between points is a coordinate along `point`, by the name of its column. `first_diverged` is the first
    episode after which an agent's values had diverged, -1 if there is none.
    """
    dims = ("algorithm", "point", "seed", "episode")
    learners = job.sweep.learners
    stacked = {name: np.stack([getattr(log[learner], name) for learner in learners]) for name in Log._fields}
    diverged = stacked.pop("diverged")
    first = np.where(diverged.any(axis=-1), diverged.argmax(axis=-1) + 1, -1)
    variables: dict[str, Any] = {name: (dims, values) for name, values in stacked.items()}
    variables["first_diverged"] = (dims[:-1], first)
    for policy, run in job.reference._asdict().items():
        values = {name: np.asarray(value) for name, value in run._asdict().items()}
        variables |= {f"{policy}_{name}": (("point", "episode")[: v.ndim], v) for name, v in values.items()}
    coords = {
        "algorithm": list(learners),
        **points_of(job),
        "seed": np.array(seeds),
        "episode": np.arange(1, job.size.episodes + 1),
    }
    return xr.Dataset(variables, coords, about(job))


def points_of(job: Job) -> dict[str, Any]:
    """The coordinates of a job's points: their numbers, and what varies between them."""
    varies = {name: ("point", values) for name, values in coordinates(job).items()}
    return {"point": np.arange(len(job.sweep.design)), **varies}


def about(job: Job) -> dict[str, str]:
    """What a part says of itself: the configuration of its job, and where it comes from."""
    said = {"configuration": configuration(job), "provenance": provenance()}
    return {name: json.dumps(value, sort_keys=True) for name, value in said.items()}


def add_part(folder: Path, seeds: range, data: xr.Dataset) -> None:
    """Writes one part and the manifest with it; an interrupt waits until both are there.

    Raises:
      OSError: naming the file, for instance when the disk is full.
    """
    with interrupts.held_off():
        write_part(folder, seeds, data)
        write_manifest(folder)


def write_manifest(folder: Path) -> None:
    """Writes what the folder holds and how it came about, if it is not written there already."""
    parts = parts_of(folder)
    if not parts:
        return
    manifest = {
        "configuration": parts[0].configuration,
        "seeds": sorted({seed for part in parts for seed in part.seeds}),
        "parts": {part.path.name: part.digest for part in parts},
        **_origins([part.provenance for part in parts]),
    }
    text = json.dumps(manifest, indent=2) + "\n"
    path = folder / MANIFEST
    if not path.is_file() or path.read_bytes() != text.encode():
        files.write_text(path, text)


def _origins(made: list[dict[str, Any]]) -> dict[str, Any]:
    """Where all parts come from, field by field: one value if it is the same everywhere, else all of them in a list.

    Of the time it is the latest.
    """
    found = {"finished": max(origin["finished"] for origin in made)}
    for field in {name: None for origin in made for name in origin if name != "finished"}:
        values = [origin.get(field) for origin in made]
        different = [value for i, value in enumerate(values) if value not in values[:i]]
        found[field] = different[0] if len(different) == 1 else different
    return found


def load(folder: Path, seeds: int) -> xr.Dataset:
    """The results of seeds 0 to `seeds` - 1 from all parts, in memory.

    Raises:
      FileNotFoundError: if some of these seeds have not been run.
      ConfigurationMismatch: if the parts are not of one configuration.
    """
    parts = [part for part in parts_of(folder) if part.seeds.start < seeds]
    missing = set(range(seeds)) - {seed for part in parts for seed in part.seeds}
    if missing:
        raise FileNotFoundError(f"{folder}: no results for seeds {in_words(missing)}; run the sweep first")
    return joined(parts).sel(seed=slice(0, seeds - 1))


def joined(parts: list[Part]) -> xr.Dataset:
    """All seeds of some parts in ascending order, each once.

    Raises:
      ConfigurationMismatch: if the parts are not of one configuration.
    """
    for part in parts:
        if found := differing(part.configuration, parts[0].configuration):
            raise ConfigurationMismatch(f"{part.path} does not go with {parts[0].path}: {'; '.join(found)}")
    whole = xr.concat(
        [read_part(part.path) for part in parts],
        "seed",
        data_vars="minimal",
        coords="minimal",
        compat="override",
        join="override",
        combine_attrs="override",
    )
    return whole.drop_duplicates("seed").sortby("seed")


def in_words(seeds: set[int]) -> str:
    """Seeds as a person lists them: "0 to 15, 20"."""
    runs: list[list[int]] = []
    for seed in sorted(seeds):
        if runs and runs[-1][-1] == seed - 1:
            runs[-1] = [runs[-1][0], seed]
        else:
            runs.append([seed, seed])
    return ", ".join(f"{a}" if a == b else f"{a} to {b}" for a, b in runs)
