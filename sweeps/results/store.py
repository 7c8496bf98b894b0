"""Results of a sweep on disk: what is in a part (`sweeps.results.parts`), which parts go together, the manifest.

A part holds the configuration that made it; a folder never mixes configurations. The manifest says what is in the
folder, for a reader; it follows from the parts and is written anew whenever it does not fit them.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import jax
import numpy as np
import xarray as xr

from jrcjax import files, numerics
from jrcjax.exact import LongRun
from jrcjax.learners.hparams import HParams
from jrcjax.model.params import EnvParams
from jrcjax.named import named_arrays, named_settings
from jrcjax.provenance import provenance
from jrcjax.training.rollout import Log
from sweeps import interrupts
from sweeps.engine.program import Reference, points_of
from sweeps.results.parts import Part, finished_seeds, part_path, parts_of, read_part, write_part
from sweeps.sweep import Size, Sweep

__all__ = [
    "MANIFEST", "ConfigurationMismatch", "add_part", "check_configuration", "check_folder", "configuration", "dataset",
    "digest_of", "finished_seeds", "load", "part_path", "write_manifest", "write_part",
]  # fmt: skip

MANIFEST = "manifest.json"


class ConfigurationMismatch(ValueError):
    """A folder holds results of another configuration."""


def digest_of(points: EnvParams) -> str:
    """Hash of every number and setting of the environments, but for what is derived from the others."""
    digest = hashlib.sha256(repr(named_settings(points)).encode())
    for name, leaf in named_arrays(points).items():
        digest.update(f"{name} {leaf.dtype} {leaf.shape} ".encode() + np.asarray(leaf).tobytes())
    return digest.hexdigest()[:16]


def configuration(sweep: Sweep, size: Size) -> dict[str, Any]:
    """What must agree for two parts to be of one result. The number of seeds is not part of it."""
    points = points_of(sweep, size.preset)
    found = {
        "sweep": sweep.name,
        "preset": size.preset,
        "episodes": size.episodes,
        "learners": sweep.learners,
        "x": {sweep.x_name: sweep.x_values},
        "environments": digest_of(points.params),
        "hparams": {name: _plain(getattr(points.hparams, name)) for name in vars(HParams())},
        "numerics": numerics.in_force(),
        "config": {name: value for name, value in asdict(sweep.config(size)).items() if name != "episodes"},
    }
    if sweep.recipe:
        found["recipe"] = asdict(sweep.recipe)
    if sweep.source:
        found["source"] = configuration(sweep.source, size)
        found["source points"] = sweep.source_points
    return json.loads(json.dumps(found))


def _plain(values: jax.Array) -> float | list[float]:
    """A number that is the same at all points, or one for each; a float32 as the number that was meant."""
    numbers = [float(str(value)) for value in np.asarray(values)]
    return numbers[0] if len(set(numbers)) == 1 else numbers


def check_folder(folder: Path, sweep: Sweep, size: Size) -> None:
    """Refuses a folder with results of another configuration, and sets aside what is of another sweep.

    Raises:
      ConfigurationMismatch: naming each field that differs, with both values.
    """
    parts = parts_of(folder)
    wanted = configuration(sweep, size) if parts else {}
    for part in parts:
        if part.configuration.get("sweep") != sweep.name:
            files.set_aside(part.path, f"it is of the sweep {part.configuration.get('sweep')!r}")
        else:
            check_configuration(part, wanted)


def check_configuration(part: Part, wanted: dict[str, Any]) -> None:
    """Refuses a part of another configuration than `wanted`.

    Raises:
      ConfigurationMismatch: naming each field that differs, with both values.
    """
    if differing := _differing(part.configuration, wanted):
        raise ConfigurationMismatch(
            f"{part.path} holds results of another configuration ({'; '.join(differing)}); "
            "choose another --out, or remove the folder"
        )


def _differing(there: dict[str, Any], wanted: dict[str, Any], prefix: str = "") -> list[str]:
    """What differs between two configurations, by dotted field."""
    found = []
    for key in sorted({*there, *wanted}):
        a, b = there.get(key), wanted.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            found += _differing(a, b, f"{prefix}{key}.")
        elif a != b:
            found.append(f"{prefix}{key}: {json.dumps(a)} there, {json.dumps(b)} wanted")
    return found


def dataset(sweep: Sweep, size: Size, seeds: range, log: dict[str, Log], exact: Reference) -> xr.Dataset:
    """Results of some seeds with named dimensions: algorithm, point, seed, episode (from 1).

    `first_diverged` is the first episode after which an agent's values had diverged, -1 if there is none.
    """
    dims = ("algorithm", "point", "seed", "episode")
    stacked = {name: np.stack([getattr(log[learner], name) for learner in sweep.learners]) for name in Log._fields}
    diverged = stacked.pop("diverged")
    first = np.where(diverged.any(axis=-1), diverged.argmax(axis=-1) + 1, -1)
    variables: dict[str, Any] = {name: (dims, values) for name, values in stacked.items()}
    variables["first_diverged"] = (dims[:-1], first)
    for policy in Reference._fields:
        run: LongRun = getattr(exact, policy)
        values = {name: np.asarray(value) for name, value in run._asdict().items()}
        variables |= {f"{policy}_{name}": (("point", "episode")[: v.ndim], v) for name, v in values.items()}
    coords = {
        "algorithm": list(sweep.learners),
        "point": np.arange(len(sweep.x_values)),
        sweep.x_name: ("point", np.asarray(sweep.x_values, float)),
        "seed": np.array(seeds),
        "episode": np.arange(1, size.episodes + 1),
    }
    about = {"configuration": configuration(sweep, size), "provenance": provenance()}
    return xr.Dataset(variables, coords, {name: json.dumps(value, sort_keys=True) for name, value in about.items()})


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
        if differing := _differing(part.configuration, parts[0].configuration):
            raise ConfigurationMismatch(f"{part.path} does not go with {parts[0].path}: {'; '.join(differing)}")
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
