"""The figures of a sweep of one's own: lines for one parameter, maps for two, profiles and indices for a sample."""

from __future__ import annotations

import math
from pathlib import Path

import pandas as pd
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from jrcjax.config.paths import Parameter
from paper_figs.analysis import designs
from paper_figs.analysis.sensitivity import LEAST_POINTS, sensitivity
from paper_figs.plots import maps, points, samples, style
from sweeps.preset import base_of
from sweeps.results import store
from sweeps.sweep import Size, Sweep


def summarise(sweeps: tuple[Sweep, ...], size: Size, out: Path) -> list[Path]:
    """Writes figures as PDF and PNG and the plotted numbers as CSV beside a sweep's results.

    Args:
      sweeps: the sweep that was run.
      size: how much of it to draw.
      out: the folder of all results.

    Returns:
      The files.
    """
    (sweep,) = sweeps
    base = base_of(sweep.environment, size.preset).points
    varied = sweep.design.parameters(base)
    data, slots = store.load(out / sweep.name, size.seeds), base.params.max_steps_in_episode
    places = [data[name].values.tolist() for name in varied]
    path = out / sweep.name / sweep.name
    converged = style.save_table(
        designs.convergence(data, tuple(varied)), path.with_name(f"{path.name}-convergence.csv")
    )
    if len(varied) == 1:
        return [*_lines(data, path, next(iter(varied.values())), slots), converged]
    cells = math.prod(len(set(along)) for along in places)
    if len(varied) == 2 and len(set(zip(*places, strict=True))) == len(sweep.design) == cells:
        return [*_maps(data, path, varied, slots), converged]
    return [*_sample(data, path, varied, slots), converged]


def _readings(varied: dict[str, Parameter]) -> dict[str, tuple[str, ...]]:
    return {name: parameter.readings for name, parameter in varied.items()}


def _lines(data: xr.Dataset, path: Path, parameter: Parameter, slots: int) -> list[Path]:
    data = data.sortby(parameter.path)
    table = points.table(data, path.name, parameter.path, slots)
    figure = points.draw(table, path.name, x_label=parameter.path)
    _fit_axis(figure, data[parameter.path].values.tolist(), parameter.readings)
    if parameter.readings:
        table["reading"] = [parameter.readings[int(x)] for x in table.x]
    return [style.save_table(table, path.with_name(f"{path.name}.csv")), *style.save(figure, path)]


def _fit_axis(figure: Figure, values: list[float], readings: tuple[str, ...]) -> None:
    """Names the ticks after readings, and spreads values of several orders of magnitude."""
    for axes in figure.axes:
        if readings:
            axes.set_xticks(values, [readings[int(x)].replace("_", " ") for x in values])
            axes.set_xlim(min(values) - 0.5, max(values) + 0.5)
        elif min(values) > 0 and max(values) / min(values) >= maps.LOGARITHMIC:
            axes.set_xscale("log")
            axes.xaxis.set_minor_locator(NullLocator())


def _maps(data: xr.Dataset, path: Path, varied: dict[str, Parameter], slots: int) -> list[Path]:
    columns = tuple(varied)
    numbers, between = designs.table(data, path.name, columns, slots), designs.differences(data, columns)
    written = [
        style.save_table(numbers, path.with_name(f"{path.name}.csv")),
        style.save_table(between, path.with_name(f"{path.name}-differences.csv")),
    ]
    for panel, (metric, _, _) in points.PANELS.items():
        figure = maps.draw(numbers, between, panel, columns, _readings(varied))  # pyright: ignore[reportArgumentType]
        written += style.save(figure, path.with_name(f"{path.name}-{metric.replace('_', '-')}"))
    return written


def _sample(data: xr.Dataset, path: Path, varied: dict[str, Parameter], slots: int) -> list[Path]:
    columns = tuple(varied)
    numbers = designs.table(data, path.name, columns, slots)
    written = [style.save_table(numbers, path.with_name(f"{path.name}.csv"))]
    for panel, (metric, _, _) in points.PANELS.items():
        figure = samples.draw_profiles(numbers, panel, columns, _readings(varied))
        written += style.save(figure, path.with_name(f"{path.name}-{metric.replace('_', '-')}"))
    if data.sizes["point"] < LEAST_POINTS:
        return written
    inputs = pd.DataFrame({name: data[name].values for name in columns})
    reward = data["reward"].mean(["seed", "episode"])
    found = {
        style.LOOKS[str(name)].label: sensitivity(inputs, reward.sel(algorithm=name).values)
        for name in data["algorithm"].values
    }
    tables = {
        "sensitivity": [
            s.table.assign(algorithm=name, surrogate_error=s.error, surrogate=s.surrogate) for name, s in found.items()
        ],
        "interactions": [s.pairs.assign(algorithm=name) for name, s in found.items()],
    }
    written += [
        style.save_table(pd.concat(of), path.with_name(f"{path.name}-{kind}.csv")) for kind, of in tables.items()
    ]
    figure = samples.draw_indices(found, "Sensitivity of the average reward per slot")
    return [*written, *style.save(figure, path.with_name(f"{path.name}-sensitivity"))]
