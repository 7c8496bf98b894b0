"""Sensitivity indices on functions whose indices are known."""

import joblib
import numpy as np
import pandas as pd
import pytest

from paper_figs.analysis.sensitivity import sensitivity
from paper_figs.studies import multiverse
from sweeps.design import sobol


def sample(number, noise, function):
    unit = sobol(4, number, seed=1)
    output = function(unit) + noise * np.random.default_rng(2).standard_normal(number)
    return pd.DataFrame(unit, columns=list("abcd")), output


def test_the_indices_of_a_linear_function_lie_in_their_intervals():
    weights = np.array([3.0, 2.0, 1.0, 0.0])
    found = sensitivity(*sample(96, 0.2, lambda unit: unit @ weights))
    truth = weights**2 / (weights**2).sum()
    for order in ("first", "total"):
        table = found.table
        assert (table[f"{order}_low"] <= truth + 1e-12).all()
        assert (table[f"{order}_high"] >= truth - 1e-12).all()
        assert ((table[f"{order}_high"] - table[f"{order}_low"]) < 0.3).all()
    assert 0 < found.error < 0.2
    assert (found.pairs.interaction_low <= 1e-12).all()


def test_the_points_of_a_block_are_left_out_together_unless_it_is_the_only_one():
    inputs, output = sample(64, 0.2, lambda unit: unit[:, 0])
    single = sensitivity(inputs, output, blocks=np.zeros(64))
    pd.testing.assert_frame_equal(single.table, sensitivity(inputs, output).table)
    # A surrogate that sees the others of a block knows its level; one that doesn't has to guess it.
    inputs["a"], of_blocks = np.arange(64) // 16, np.repeat([0.0, 2.0, 1.0, -1.0], 16)
    together = sensitivity(inputs, of_blocks, blocks=np.arange(64) // 16)
    assert together.error > 0.5 > sensitivity(inputs, of_blocks).error


def test_an_interaction_is_told_from_what_inputs_do_alone():
    # The product of two centred inputs is all interaction.
    found = sensitivity(*sample(128, 0.0, lambda unit: (unit[:, 0] - 0.5) * (unit[:, 1] - 0.5)))
    first, total = found.table["first"], found.table["total"]
    assert (first < 0.15).all()
    assert (total[:2] > 0.7).all()
    pair = found.pairs.query("input == 'a' and other == 'b'")
    assert pair.interaction_low.item() > 0.5


def test_what_never_changes_is_decided_by_nothing_and_few_points_by_no_one():
    inputs, _ = sample(64, 0.0, lambda unit: unit[:, 0])
    assert (sensitivity(inputs, np.ones(64)).table["total"] == 0).all()
    with pytest.raises(ValueError, match="points: 8; allowed: at least 30"):
        sensitivity(inputs[:8], np.arange(8.0))


def of_claim(claim, values):
    """Verdicts of one claim in as many readings of the multiverse as there are values."""
    return pd.DataFrame({"reading": np.arange(len(values)), "claim": claim, "n_seeds": 1, "value": values})


def test_who_is_left_out_is_told_beside_what_decides():
    places = multiverse.places(257)
    step, values = places["step size (SGD: a hundredth)"], places["weight of the margin"].to_numpy(float).copy()
    values[np.where(places["loss"] == 1, step > 0.2, step > 0.9)] = np.nan  # nobody converges, mostly with one answer
    with joblib.parallel_config(backend="sequential"):
        tables = multiverse.decisive(of_claim("C5 (highest)", values), 450)
    effect, known = (tables[name].set_index("input") for name in ("sensitivity", "known"))
    assert (effect.readings == np.isfinite(values[1:]).sum()).all()
    assert (known.readings == 256).all()
    assert effect.total["weight of the margin"] > 0.9
    assert effect.drop("weight of the margin").total_low.max() < 0.05
    # p = P(known) is 0.9 and 0.2 with even odds: Var E(known | loss) = 0.35^2 of Var = 0.55 * 0.45.
    assert known.first_low["loss"] <= 0.35**2 / (0.55 * 0.45) <= known.first_high["loss"]
    assert known.total_low["weight of the margin"] < 0.05
    assert known.total.nlargest(2).index.tolist() == ["loss", "step size (SGD: a hundredth)"]


def test_what_decides_in_a_multiverse_with_known_answers():
    places = multiverse.places(257)
    rng, step, weight = np.random.default_rng(0), "step size (SGD: a hundredth)", "weight of the margin"
    values = 3 * places[step] + 2 * places[weight] + rng.normal(0, 0.2, len(places))
    values[rng.random(len(places)) < 0.2] = np.nan  # nobody converges
    with joblib.parallel_config(backend="sequential"):
        table = multiverse.decisive(of_claim("C5 (highest)", values), 450)["sensitivity"].set_index("input")
    assert (table.readings == np.isfinite(values[1:]).sum()).all()
    for question, share in ((step, 9 / 13), (weight, 4 / 13)):
        for order in ("first", "total"):
            assert table[f"{order}_low"][question] <= share <= table[f"{order}_high"][question]
    others = table.drop([step, weight])
    assert others.total_low.max() < 0.05
    assert len(others) == 23  # of 29 questions two are Q-learning's, and two count what is not rewarded


def test_runs_that_never_converge_have_a_part_in_what_decides():
    places = multiverse.places(129)
    values = np.where(places["loss"] == 0, np.inf, 100.0)
    with joblib.parallel_config(backend="sequential"):
        table = multiverse.decisive(of_claim("C7 (DDQN)", values), 450)["sensitivity"].set_index("input")
    assert (table.readings == 128).all()
    assert table.total["loss"] > 0.9
    assert table.drop("loss").total.max() < 0.1
    assert "weight of the margin" not in table.index


def test_an_infinite_ratio_is_no_effect():
    values = multiverse.places(129)["loss"].to_numpy(float).copy()
    values[5:15] = np.inf
    with joblib.parallel_config(backend="sequential"):
        table = multiverse.decisive(of_claim("C12 (throughput, DDQN)", values), 450)["sensitivity"]
    assert (table.readings == 118).all()
    assert table.set_index("input").total["loss"] > 0.9
