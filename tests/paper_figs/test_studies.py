"""Robustness and multiverse: the designs, the statistics on worlds with known answers, and a tiny run of each."""

import itertools
import json

import hypothesis
import hypothesis.extra.numpy as hnp
import hypothesis.strategies as st
import numpy as np
import pandas as pd
import pytest

import jrcjax
from jrcjax import exact
from paper_figs.analysis import ranking
from sweeps.__main__ import main

# --- robustness -----------------------------------------------------------------------------------------------------


def test_misranking_of_two_learners_is_the_chance_that_a_mean_has_the_wrong_sign():
    rng = np.random.default_rng(1)
    scores = np.stack([rng.normal(0.0, 1.0, 2000), rng.normal(0.3, 1.0, 2000)])
    difference = scores[1] - scores[0]
    for n in (1, 5, 30):
        drawn = rng.choice(difference, (20_000, n)).mean(axis=1)
        assert abs(ranking.misranking(scores, n) - (drawn < 0).mean()) < 0.02
    assert ranking.misranking(np.stack([np.zeros(9), np.ones(9)]), 1) == 0.0


def _wrong_share(study, whole):
    """The share of a study's orders, with ties in any order, in which a pair is as it is not in the whole."""
    places = range(len(study))
    orders = [order for order in itertools.permutations(places) if (np.diff(np.array(study)[list(order)]) >= 0).all()]
    return np.mean([(np.diff(np.array(whole)[list(order)]) < 0).any() for order in orders])


@hypothesis.given(scores=hnp.arrays(float, st.tuples(st.integers(2, 4), st.integers(2, 5)), elements=st.integers(0, 2)))
def test_misranking_counts_ties_half_and_knows_no_order_of_listing(scores):
    found = ranking.misranking(scores, 1)
    assert ranking.misranking(scores[::-1], 1) == pytest.approx(found, abs=1e-12)
    # A study of one seed is a column, each as likely.
    expected = np.mean([_wrong_share(column, scores.mean(axis=1)) for column in scores.T])
    assert found == pytest.approx(expected, abs=0.03)  # six deviations of the share of 10,000 draws


def test_two_learners_that_never_converge_cannot_be_ranked_wrongly_and_a_tie_is_half_wrong():
    never, sometimes = np.full(8, 1000.0), np.array([500.0] + [1000.0] * 7)
    assert ranking.misranking(np.stack([never, never]), 3) == 0.0
    for scores in (np.stack([never, sometimes]), np.stack([sometimes, never])):
        assert ranking.misranking(scores, 1) == pytest.approx(7 / 16, abs=0.02)
        assert ranking.misranking(scores, 8) == 0.0


def test_seeds_needed_give_the_right_sign_with_95_percent():
    rng = np.random.default_rng(2)
    differences = rng.normal(0.2, 1.0, 4000)
    n = int(ranking.seeds_needed(differences))
    right = [(rng.choice(differences, (20_000, m)).mean(axis=1) > 0).mean() for m in (n // 2, n)]
    assert right[0] < 0.93
    assert abs(right[1] - 0.95) < 0.01
    assert ranking.seeds_needed(np.ones(5)) == 1
    assert ranking.seeds_needed(np.array([1.0, -1.0])) == np.inf


# --- tiny runs ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_tiny_robustness_study_writes_its_summary_and_goes_on(tmp_path, capsys):
    run = ["run", "robustness", "--smoke", "--out", str(tmp_path)]
    assert main([*run, "--seeds", "2"]) == 0
    assert main([*run, "--seeds", "4", "--resume"]) == 0
    summary = tmp_path / "robustness" / "summary"
    assert str(summary / "robustness.png") in capsys.readouterr().out
    table = pd.read_csv(summary / "regret.csv")
    assert set(table.figure) == {"source", "target"}
    assert set(table.n_seeds) == {4}
    target = jrcjax.paper_params("target")
    best = exact.evaluate_policy(target, exact.optimal_policy(target))
    np.testing.assert_allclose(table[table.figure == "target"].optimum_reward, best.reward, rtol=1e-5)
    assert json.loads((summary / "manifests.json").read_text()).keys() == {"robustness/source", "robustness/target"}
