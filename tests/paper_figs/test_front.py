"""The figure of the trade-off: its numbers and its picture."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from jrcjax import exact
from paper_figs.analysis import front
from paper_figs.plots import front as picture
from paper_figs.plots import style

PUBLISHED = Path(__file__).parents[2] / "published"


@pytest.fixture(scope="module")
def results():
    """Three seeds of two learners, of which only the last tenth of twenty episodes is the optimum."""

    def of(last):
        values = np.full((2, 1, 3, 20), 0.5)
        values[..., -2:] = last
        return ("algorithm", "point", "seed", "episode"), values

    policies = {"policy_throughput": of(0.75), "policy_miss_detection": of(0.375)}
    return xr.Dataset(policies, {"algorithm": ["tlwd", "round_robin"]})


@pytest.fixture(scope="module")
def numbers(environments, results):
    return front.table(environments["short-target"], results)


def test_no_row_lies_below_its_front(numbers):
    assert tuple(numbers.columns) == front.COLUMNS
    for convention in front.CONVENTIONS:
        of_one = numbers[(numbers["panel"] == "a") & (numbers["convention"] == convention)]
        corners = of_one[of_one["algorithm"] == "front"].sort_values("x")
        above = of_one[of_one["algorithm"].isin(["weighted", "optimum", "round_robin"])]
        assert len(above) == len(front.WORTH) + 2
        assert (above["mean"] >= np.interp(above["x"], corners["x"], corners["mean"]) - 1e-5).all()


def test_the_optimum_is_that_of_the_solver(numbers, environments):
    params = environments["short-target"]
    best = exact.evaluate_policy(params, exact.optimal_policy(params))
    (row,) = numbers.query("algorithm == 'optimum' and convention == 'all_slots'").itertuples()
    assert (row.x, row.mean) == pytest.approx((float(best.throughput), float(best.miss_detection)), rel=1e-5)


def test_learners_are_where_they_end(numbers):
    (row,) = numbers.query("n_seeds > 0").itertuples()
    assert (row.algorithm, row.x, row.mean, row.n_seeds) == ("tlwd", 0.75, 0.375, 3)


def test_each_panel_moves_one_parameter(numbers):
    for panel, (_, values) in front.VARIED.items():
        assert sorted(numbers[numbers["panel"] == panel]["value"].unique()) == sorted(values)


def test_picture(numbers, tmp_path):
    pdf, png = style.save(picture.draw(numbers, front.TITLE), tmp_path / front.NAME)
    assert (pdf.read_bytes()[:4], png.read_bytes()[:4]) == (b"%PDF", b"\x89PNG")


@pytest.mark.parametrize(("folder", "insets"), [("figures", 1), ("best", 0)])
def test_learners_are_enlarged_where_they_are_close_together(folder, insets):
    """In the best reading they are all over the panel, where an inset would show less than the panel itself."""
    first, *others = picture.draw(pd.read_csv(PUBLISHED / folder / "front.csv"), front.TITLE).axes
    assert len(first.child_axes) == insets
    assert not any(panel.child_axes for panel in others)
