"""The published table of error rates: complete, reproducible, and within its limits wherever these are in reach."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Annotation

from paper_figs.calibration import draw, simulate
from paper_figs.calibration.__main__ import main
from paper_figs.calibration.reach import BEYOND, COVERAGE, FALSE_VERDICTS, FEWEST, SEEDS
from paper_figs.calibration.worlds import WORLDS
from paper_figs.claims.results import Rules

PUBLISHED = Path(__file__).parents[2] / "published" / "calibration" / "calibration.csv"
FALSE = ["false_supported", "false_contradicted"]


@pytest.fixture(scope="module")
def published():
    return pd.read_csv(PUBLISHED, keep_default_na=False)


def test_every_rule_is_there_in_every_world_at_every_size(published):
    rows = [(world.rule, world.name, n) for world in WORLDS for n in SEEDS]
    assert list(zip(published.rule, published.world, published.n_seeds, strict=True)) == rows
    assert len(set(rows)) == len(rows)


def test_in_reach_false_verdicts_are_rare_and_intervals_cover(published):
    here = published[published.out_of_reach == 0]
    assert (here[FALSE] <= FALSE_VERDICTS).all(axis=None)
    assert here.coverage.between(*COVERAGE).all()


def test_intervals_that_are_too_wide_give_no_more_false_verdicts(published):
    here = published[published.what == "coverage"]
    assert (here[FALSE] <= FALSE_VERDICTS).all(axis=None)
    assert (here.coverage > COVERAGE[0]).all()


def test_what_is_out_of_reach_has_a_reason_and_is_needed(published):
    out = published[published.out_of_reach == 1]
    assert (out.reason != "").all()
    errors = out[out.what == "errors"]
    assert (errors[FALSE].max(axis=1) > FALSE_VERDICTS).all()
    for entry in BEYOND:
        concerned = out[(out.reason == entry.why) & out.n_seeds.isin(entry.seeds)]
        assert not concerned.empty


def test_few_seeds_give_no_verdicts(published):
    assert Rules().least_seeds == FEWEST
    few = published[published.n_seeds < FEWEST]
    assert (few[FALSE] == 0).all(axis=None)
    assert set(few.what) == {"verdicts"}


def test_rows_can_be_made_anew(published):
    for world in (WORLDS[0], WORLDS[-6]):
        for row in simulate.rows([world], [10]):
            found = published[(published.rule == row["rule"]) & (published.world == row["world"])]
            found = found[found.n_seeds == 10].iloc[0]
            np.testing.assert_allclose(
                found[["coverage", *FALSE]].astype(float), [row[c] for c in ["coverage", *FALSE]], atol=1e-6
            )


@pytest.mark.parametrize("world", WORLDS, ids=lambda world: f"{world.rule}: {world.name}")
def test_the_truth_of_a_world_is_what_many_seeds_show(world):
    value, low, high = (x.item() for x in world.interval(*world.draw(np.random.default_rng(1), 5000, 1)))
    assert value - 2 * (high - low) < world.truth < value + 2 * (high - low)


def test_the_command_writes_table_and_figure(tmp_path, monkeypatch):
    monkeypatch.setattr("paper_figs.calibration.__main__._SMOKE_STUDIES", 20)
    assert main(["--smoke", "--out", str(tmp_path)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {f"calibration.{end}" for end in ("csv", "pdf", "png")}
    columns = {"rule", "world", "n_seeds", "coverage", "false_supported", "false_contradicted", "out_of_reach"}
    assert columns <= set(pd.read_csv(tmp_path / "calibration.csv").columns)


def test_what_is_beyond_a_panel_stands_at_its_end_with_its_value(published):
    worst = published.assign(false=published[FALSE].max(axis=1)).query("n_seeds >= 5 and false > 0.12")
    errors, coverage = draw.draw(published).axes
    assert sorted(text.get_text() for text in errors.texts) == sorted(f"{100 * share:.3g}" for share in worst.false)
    assert len(worst) == 2
    assert len(coverage.texts) == 0
    places = [text.xy for text in errors.texts if isinstance(text, Annotation)]
    assert all(errors.get_xlim()[0] < x < errors.get_xlim()[1] for x, _ in places)
    assert len(set(places)) == 2
