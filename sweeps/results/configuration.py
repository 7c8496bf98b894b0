"""What results are of: the configuration that a part holds, its coordinates, and the way back to a sweep."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
from typing import Any

import jax
import numpy as np

from jrcjax import numerics
from jrcjax.config.paths import Parameter, leaf_of
from jrcjax.model.params import EnvParams
from jrcjax.named import named_arrays, named_settings
from sweeps.design import Column, Design
from sweeps.engine.job import Job
from sweeps.preset import base_of
from sweeps.sweep import Sweep


def digest_of(points: EnvParams) -> str:
    """Hash of every number and setting of the environments, but for what is derived from the others."""
    digest = hashlib.sha256(repr(named_settings(points)).encode())
    for name, leaf in named_arrays(points).items():
        digest.update(f"{name} {leaf.dtype} {leaf.shape} ".encode() + np.asarray(leaf).tobytes())
    return digest.hexdigest()[:16]


@functools.lru_cache(maxsize=64)
def configuration(job: Job) -> dict[str, Any]:
    """What must agree for two parts to be of one result. The number of seeds is not part of it."""
    sweep, size, hparams = job.sweep, job.size, job.points.hparams
    configs = [{k: v for k, v in dataclasses.asdict(g.config).items() if k != "episodes"} for g in job.groups]
    found = {
        "sweep": sweep.name,
        "preset": size.preset,
        "episodes": size.episodes,
        "learners": sweep.learners,
        "environment": sweep.environment,
        "design": {c.name: [row[i] for row in sweep.design.rows] for i, c in enumerate(sweep.design.columns)},
        "paths": {column.name: column.path for column in sweep.design.columns},
        "points": len(sweep.design),
        "fixed": dict(sweep.fixed),
        "environments": digest_of(job.points.params),
        "hparams": {field.name: _plain(getattr(hparams, field.name)) for field in dataclasses.fields(hparams)},
        "numerics": numerics.in_force(),
        "config": {name: _one_or_all([config[name] for config in configs]) for name in configs[0]},
    }
    found |= {name: True for name in ("own", "hands_on") if getattr(sweep, name)}
    if job.source:
        found["source"] = configuration(job.source)
        found["source points"] = job.source_points.tolist()
    return json.loads(json.dumps(found))


def _plain(values: jax.Array) -> float | list[float]:
    """A number that is the same at all points, or one for each; a float32 as the number that was meant."""
    return _one_or_all([float(str(value)) for value in np.asarray(values)])


def _one_or_all(values: list) -> Any:
    """What is the same for all, or the list."""
    return values[0] if all(value == values[0] for value in values) else values


def sweep_of(configuration: dict[str, Any]) -> Sweep:
    """The sweep of a person's own, from what its results say of it."""
    paths, values = configuration["paths"], configuration["design"]
    rows = tuple(zip(*values.values(), strict=True)) if values else ((),) * configuration["points"]
    return Sweep(
        name=configuration["sweep"],
        description="",
        learners=tuple(configuration["learners"]),
        environment=configuration["environment"],
        design=Design(tuple(Column(name, path) for name, path in paths.items()), rows),
        fixed=tuple(configuration["fixed"].items()),
        source=sweep_of(configuration["source"]) if "source" in configuration else None,
        source_points=tuple(configuration.get("source points", ())),
        hands_on=configuration.get("hands_on", False),
        own=configuration.get("own", False),
    )


def coordinates(job: Job) -> dict[str, np.ndarray]:
    """The columns of a design [points], by name, with the base's value where a point is as the base."""
    design, base = job.sweep.design, base_of(job.sweep.environment, job.size.preset).points
    found = {column.name: design.values(column.name) for column in design.columns}
    for name, parameter in design.parameters(base).items():
        missing = np.isnan(found[name])
        if missing.any():
            found[name][missing] = _held(job, parameter)[missing]
    return found


def _held(job: Job, parameter: Parameter) -> np.ndarray:
    """A parameter as the points of a job have it, [points]."""
    entry = parameter.entries[0]
    if parameter.container != "config":
        leaf = np.asarray(leaf_of(getattr(job.points, parameter.container), entry))
        return np.array([float(str(value)) for value in leaf[(slice(None), *entry.index)]])
    found = np.zeros(len(job.sweep.design))
    for group in job.groups:
        value = getattr(group.config, entry.fields[0])
        found[list(group.rows)] = parameter.readings.index(value) if parameter.readings else value
    return found


def differing(there: dict[str, Any], wanted: dict[str, Any], prefix: str = "") -> list[str]:
    """What differs between two configurations, by dotted field."""
    found = []
    for key in sorted({*there, *wanted}):
        a, b = there.get(key), wanted.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            found += differing(a, b, f"{prefix}{key}.")
        elif a != b:
            found.append(f"{prefix}{key}: {_short(a)} there, {_short(b)} wanted")
    return found


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 200 else f"{text[:200]} ..."
