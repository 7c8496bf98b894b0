"""The multiverse: readings are what they are whatever their number, and a tiny run judges all claims."""

import jax
import numpy as np
import pandas as pd
import pytest

import jrcjax
from jrcjax.config.paths import number_at, parameter_at
from sweeps.__main__ import main
from sweeps.engine.job import Job
from sweeps.preset import base_of
from sweeps.studies.multiverse import POINTS, SMOKE, sweeps_of
from sweeps.studies.readings import (
    PER_BLOCK,
    READINGS,
    SOURCE,
    as_text,
    choices,
    default_unit,
    is_static,
    range_of,
    unit_of,
    values_at,
)
from sweeps.studies.registry import SWEEPS


def test_a_reading_is_the_same_whatever_the_number_of_readings():
    many = unit_of(40)
    np.testing.assert_array_equal(unit_of(9), many[:9])
    np.testing.assert_array_equal(unit_of(5, first=20), many[20:25])
    np.testing.assert_array_equal(unit_of(1, first=1), many[1:2])
    assert values_at(many[0]) == {}
    blocks = sweeps_of(2 * PER_BLOCK + 8)
    assert [sweep.name for sweep in blocks] == [
        f"multiverse/{a}" for a in ("000000-000063", "000064-000127", "000128-000135")
    ]
    assert sweeps_of(PER_BLOCK, first=PER_BLOCK) == blocks[1:2]


def test_readings_lie_in_their_ranges_and_each_level_is_tried_equally_often():
    rows = pd.DataFrame([values_at(unit) for unit in unit_of(256, first=256)])
    for reading in [reading for reading in READINGS if not is_static(reading)]:
        values, where = rows[reading.path].to_numpy(), range_of(reading)
        if where.levels:
            counts = [np.sum(values == level) for level in where.levels]
            assert sum(counts) == len(values), reading.path
            # 256 points have one in each 256th of the range, so a level gains or loses at most one at either end.
            np.testing.assert_allclose(counts, len(values) / len(counts), atol=2, err_msg=reading.path)
        elif reading.path != "hparams.learning_rate":
            assert where.low <= values.min() < values.max() <= where.high, reading.path
    sgd = rows["config.optimiser"] == 1
    assert rows["hparams.learning_rate"][sgd].max() <= 1e-4
    assert rows["hparams.learning_rate"][~sgd].max() > 5e-3
    # What decides code is the same within a block, and equally often each over the blocks.
    static = [reading.path for reading in READINGS if is_static(reading)]
    assert set(static) == {f"config.{name}" for name in ("optimiser", "gradient_clipping", "target_update", "n_step")}
    many = pd.DataFrame([values_at(unit) for unit in unit_of(64 * PER_BLOCK)[1:]], index=range(1, 64 * PER_BLOCK))
    blocks = many.groupby(many.index // PER_BLOCK)[static]
    assert (blocks.nunique().to_numpy() == 1).all()
    for path, values in blocks.first().items():
        assert np.ptp(values.value_counts()) <= 2, path
    assert choices(next(reading for reading in READINGS if reading.path == SOURCE)) == ("same", "table1")


@pytest.fixture(scope="module")
def job():
    return Job(sweeps_of(1)[0], SMOKE)


def test_the_first_reading_is_the_papers_default_at_the_points_of_the_figures(job):
    params, hparams = job.points
    base = jrcjax.paper_params("target")
    np.testing.assert_array_equal(hparams.learning_rate, np.float32(1e-3))
    np.testing.assert_array_equal(params.event_model, 0)
    first = jax.tree.map(lambda leaf: leaf[0], params)
    jax.tree.map(np.testing.assert_array_equal, first, base)
    for name, path in (("fig6", 0.9), ("fig7", 0.6), ("fig8", 40.0)):
        sweep = SWEEPS[name]
        (column,) = sweep.design.columns
        here = job.sweep.design.values(column.name).tolist().index(path)
        there = sweep.design.values(column.name).tolist().index(path)
        of_figure = Job(sweep, SMOKE).points.params
        for a, b in zip(jax.tree.leaves(params), jax.tree.leaves(of_figure), strict=True):
            np.testing.assert_array_equal(a[here], b[there])
    uniform = next(i for i, point in enumerate(POINTS) if point.values.get("prioritised") == 0)
    np.testing.assert_array_equal(np.flatnonzero(hparams.priority_exponent == 0), [uniform])


@pytest.mark.slow
def test_a_tiny_multiverse_judges_all_claims_in_each_reading(tmp_path):
    run = ["run", "multiverse", "--smoke", "--episodes", "1", "--out", str(tmp_path)]
    assert main(run) == 0
    summary = tmp_path / "multiverse" / "summary"
    found = pd.read_csv(summary / "verdicts.csv")
    assert set(found.reading) == {0, 1}
    assert {claim.split()[0] for claim in found.claim} == {f"C{number}" for number in range(1, 16)}
    assert (pd.read_csv(summary / "claims.csv").readings == 2).all()
    assert main([*run, "--resume"]) == 0


def test_the_default_has_a_place_in_the_space():
    base = base_of("target", "paper")
    for path, value in values_at(default_unit()).items():
        if path == SOURCE:
            assert value == 0
        elif path.startswith("config."):
            default = getattr(base.config, path.removeprefix("config."))
            assert as_text(path, value) == default, path
        else:
            assert value == pytest.approx(number_at(parameter_at(path, base.points), base.points), rel=1e-5), path
