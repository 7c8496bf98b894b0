"""Parts of results on disk: immutable netCDF files, one per block of seeds, each sealed with a checksum.

A part is whole or absent. One that is not what was written, or does not hold the seeds that its name says, is named on
stderr, set aside under another name, and counts as absent.
"""

from __future__ import annotations

import functools
import hashlib
import io
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from jrcjax import files


class Part(NamedTuple):
    """What a part says of itself."""

    path: Path
    seeds: range
    configuration: dict[str, Any]
    provenance: dict[str, Any]
    digest: str
    """`digest_of_results`, the same for the same numbers wherever and whenever they were computed."""


def part_path(folder: Path, seeds: range) -> Path:
    """File of a block of seeds."""
    return folder / f"seeds-{seeds.start:06d}-{seeds.stop - 1:06d}.nc"


def digest_of_results(data: xr.Dataset) -> str:
    """Hash of all arrays and of the configuration, and of nothing else."""
    found = hashlib.sha256(str(data.attrs["configuration"]).encode())
    for name in sorted(map(str, data.variables)):
        variable = data.variables[name]
        values = variable.values
        text = values.dtype.kind in "OTU"  # comes back from disk in another type
        found.update(json.dumps([name, variable.dims, values.shape, "text" if text else values.dtype.str]).encode())
        found.update(json.dumps(values.tolist()).encode() if text else np.ascontiguousarray(values).tobytes())
    return found.hexdigest()


def write_part(folder: Path, seeds: range, data: xr.Dataset) -> Path:
    """Writes one part, whole or not at all.

    Raises:
      OSError: naming the file, for instance when the disk is full.
    """
    path = part_path(folder, seeds)
    # No fill values: xarray would read every NaN back as the same one.
    encoding: dict[str, Any] = {str(name): {"_FillValue": None} for name in data.variables}
    for name in data.data_vars:
        if data[name].ndim > 1:
            encoding[str(name)] |= {"zlib": True, "complevel": 4}
    data = data.assign_attrs(digest=digest_of_results(data))
    files.write_whole(path, files.sealed(bytes(data.to_netcdf(engine="h5netcdf", encoding=encoding))))
    return path


def read_part(path: Path) -> xr.Dataset:
    """One part, in memory.

    Raises:
      DamagedFile: if it is not what was written.
    """
    return xr.load_dataset(io.BytesIO(files.unsealed(path)), engine="h5netcdf")


def parts_of(folder: Path) -> list[Part]:
    """The parts in a folder, each checked bit for bit; those that are damaged are set aside."""
    found = []
    for path in sorted(folder.glob("seeds-*.nc")):
        try:
            found.append(described(path))
        except files.DamagedFile as reason:
            files.set_aside(path, reason)
    return found


def described(path: Path) -> Part:
    """What a part says of itself.

    Raises:
      DamagedFile: if it is not what was written, or no part, or has not the name of its seeds.
    """
    stat = files.status_of(path)
    return _described(path, (stat.st_ino, stat.st_size, stat.st_mtime_ns))


@functools.cache
def _described(path: Path, as_of: tuple[int, int, int]) -> Part:
    """Read once per process, unless the file changed since."""
    try:
        data = read_part(path)
        numbers = data["seed"].values.tolist()
        about = {name: json.loads(data.attrs[name]) for name in ("configuration", "provenance")}
        digest = digest_of_results(data)
    except (files.DamagedFile, MemoryError):
        raise
    except Exception as error:  # whatever readers of netCDF and of JSON say
        raise files.DamagedFile(f"it is not a part of results ({str(error)[:200]})") from error
    if not all(isinstance(said, dict) for said in about.values()) or "finished" not in about["provenance"]:
        raise files.DamagedFile("it does not say where it comes from")
    if digest != data.attrs.get("digest"):
        raise files.DamagedFile("its digest is not that of its content")
    seeds = range(numbers[0], numbers[-1] + 1)
    if list(seeds) != numbers or part_path(path.parent, seeds).name != path.name:
        raise files.DamagedFile(f"it holds seeds {numbers[0]} to {numbers[-1]}")
    return Part(path, seeds, **about, digest=digest)


def finished_seeds(folder: Path) -> set[int]:
    """Seeds whose parts are there and sound."""
    return {seed for part in parts_of(folder) for seed in part.seeds}
