"""Results on disk: immutable parts (netCDF), one per block of seeds, and a manifest.

A part is written under a temporary name, synced and renamed, so it is whole or absent. Its attributes hold the
configuration that made it; a folder never mixes configurations.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import jax
import numpy as np
import xarray as xr

from jrcjax.episodes import Log
from jrcjax.exact import LongRun
from jrcjax.hparams import HParams
from jrcjax.params import EnvParams
from jrcjax.provenance import provenance
from sweeps.program import Reference, points_of
from sweeps.sweep import Size, Sweep

MANIFEST = "manifest.json"


class ConfigurationMismatch(ValueError):
    """A folder holds results of another configuration."""


def digest_of(points: EnvParams) -> str:
    """Hash of every number of the environments, but for the bank, which follows from the others."""
    bare = dataclasses.replace(points, radar=dataclasses.replace(points.radar, miss_bank=np.zeros(0)))
    content = b"".join(np.asarray(leaf).tobytes() for leaf in jax.tree.leaves(bare))
    return hashlib.sha256(content + repr(jax.tree.structure(bare)).encode()).hexdigest()[:16]


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
        "config": {name: value for name, value in asdict(sweep.config(size)).items() if name != "episodes"},
    }
    if sweep.source:
        found["source"] = configuration(sweep.source, size)
        found["source points"] = sweep.source_points
    return json.loads(json.dumps(found))


def _plain(values: jax.Array) -> float | list[float]:
    """A number that is the same at all points, or one for each; a float32 as the number that was meant."""
    numbers = [float(str(value)) for value in np.asarray(values)]
    return numbers[0] if len(set(numbers)) == 1 else numbers


def check_folder(folder: Path, sweep: Sweep, size: Size) -> None:
    """Refuses a folder with results of another configuration.

    Raises:
      ConfigurationMismatch: naming each field that differs, with both values.
    """
    wanted = configuration(sweep, size)
    for path in sorted(folder.glob("seeds-*.nc")):
        with xr.open_dataset(path, engine="h5netcdf") as part:
            found = json.loads(part.attrs["configuration"])
        differing = [
            f"{key}: {json.dumps(found.get(key))} there, {json.dumps(wanted.get(key))} wanted"
            for key in sorted({*found, *wanted})
            if found.get(key) != wanted.get(key)
        ]
        if differing:
            raise ConfigurationMismatch(
                f"{path} holds results of another configuration ({'; '.join(differing)}); "
                "choose another --out, or remove the folder"
            )


def dataset(sweep: Sweep, size: Size, seeds: range, log: dict[str, Log], exact: Reference) -> xr.Dataset:
    """Results of some seeds with named dimensions: algorithm, point, seed, episode (from 1)."""
    dims = ("algorithm", "point", "seed", "episode")
    stacked = {name: np.stack([getattr(log[learner], name) for learner in sweep.learners]) for name in Log._fields}
    variables: dict[str, Any] = {name: (dims, values) for name, values in stacked.items()}
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


def part_path(folder: Path, seeds: range) -> Path:
    """File of a block of seeds."""
    return folder / f"seeds-{seeds.start:06d}-{seeds.stop - 1:06d}.nc"


def write_part(folder: Path, seeds: range, data: xr.Dataset) -> Path:
    """Writes one part, whole or not at all."""
    path = part_path(folder, seeds)
    encoding = {name: {"zlib": True, "complevel": 4} for name in data.data_vars if data[name].ndim > 1}
    _whole(path, lambda temporary: data.to_netcdf(temporary, engine="h5netcdf", encoding=encoding))
    return path


def write_manifest(folder: Path, sweep: Sweep, size: Size) -> None:
    """Writes what the folder holds and how it came about."""
    manifest = {
        "configuration": configuration(sweep, size),
        "seeds": sorted(finished_seeds(folder)),
        "parts": sorted(path.name for path in folder.glob("seeds-*.nc")),
        **provenance(),
    }
    text = json.dumps(manifest, indent=2) + "\n"
    _whole(folder / MANIFEST, lambda temporary: Path(temporary).write_text(text))


def _whole(path: Path, write) -> None:
    """Writes a file under a temporary name, syncs it, and gives it its name."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=path.suffix)
    os.close(handle)
    try:
        write(temporary)
        with open(temporary, "rb") as written:
            os.fsync(written.fileno())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def finished_seeds(folder: Path) -> set[int]:
    """Seeds whose parts are there."""
    found: set[int] = set()
    for path in folder.glob("seeds-*.nc"):
        first, last = path.stem.removeprefix("seeds-").split("-")
        found |= set(range(int(first), int(last) + 1))
    return found


def load(folder: Path, seeds: int) -> xr.Dataset:
    """The results of seeds 0 to `seeds` - 1 from all parts, in memory.

    Raises:
      FileNotFoundError: if some of these seeds have not been run.
    """
    missing = set(range(seeds)) - finished_seeds(folder)
    if missing:
        raise FileNotFoundError(f"{folder}: no results for seeds {sorted(missing)[:5]}...; run the sweep first")
    parts = [xr.load_dataset(path, engine="h5netcdf") for path in sorted(folder.glob("seeds-*.nc"))]
    whole = xr.concat(parts, "seed", data_vars="minimal", coords="minimal", compat="override", join="override")
    return whole.sortby("seed").sel(seed=slice(0, seeds - 1))
