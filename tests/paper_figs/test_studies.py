"""Robustness and multiverse: the designs, the statistics on worlds with known answers, and a tiny run of each."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from rich.console import Console
from trees import by_name

import jrcjax
from jrcjax import exact
from jrcjax.learners.hparams import HParams
from jrcjax.readings import CountingRule, Distance, EventModel, MissConvention
from paper_figs.analysis import ranking
from paper_figs.claims.judge import Judgement, verdicts
from paper_figs.studies import multiverse
from sweeps.__main__ import main
from sweeps.engine.program import points_of
from sweeps.engine.run import run_sweep
from sweeps.results import store
from sweeps.studies.fig5b import FIG5B
from sweeps.studies.multiverse import (
    BASE_AT,
    LEVELS,
    MULTIVERSE,
    POINTS,
    SMOKE,
    UNIVERSES,
    Universe,
    grouped,
    orthogonal_array,
)
from sweeps.studies.registry import STUDIES

# --- robustness -----------------------------------------------------------------------------------------------------


def test_misranking_of_two_learners_is_the_chance_that_a_mean_has_the_wrong_sign():
    rng = np.random.default_rng(1)
    scores = np.stack([rng.normal(0.0, 1.0, 2000), rng.normal(0.3, 1.0, 2000)])
    difference = scores[1] - scores[0]
    for n in (1, 5, 30):
        drawn = rng.choice(difference, (20_000, n)).mean(axis=1)
        assert abs(ranking.misranking(scores, n) - (drawn < 0).mean()) < 0.02
    assert ranking.misranking(np.stack([np.zeros(9), np.ones(9)]), 1) == 0.0


def test_seeds_needed_give_the_right_sign_with_95_percent():
    rng = np.random.default_rng(2)
    differences = rng.normal(0.2, 1.0, 4000)
    n = int(ranking.seeds_needed(differences))
    right = [(rng.choice(differences, (20_000, m)).mean(axis=1) > 0).mean() for m in (n // 2, n)]
    assert right[0] < 0.93
    assert abs(right[1] - 0.95) < 0.01
    assert ranking.seeds_needed(np.ones(5)) == 1
    assert ranking.seeds_needed(np.array([1.0, -1.0])) == np.inf


# --- multiverse -----------------------------------------------------------------------------------------------------


def test_the_array_has_every_pair_of_levels_equally_often():
    rows, levels = orthogonal_array(), [len(of) for of in LEVELS.values()]
    assert levels == [3, 2, 3, 3, 2, 3, 4, 2]
    assert len(set(map(tuple, rows))) == len(rows) == 72
    for i, j in itertools.combinations(range(len(levels)), 2):
        counts = np.zeros((levels[i], levels[j]))
        np.add.at(counts, (rows[:, i], rows[:, j]), 1)
        assert (counts == 72 / counts.size).all()
    assert UNIVERSES[0] == Universe(**{name: of[0] for name, of in LEVELS.items()})


def test_the_first_universe_is_the_papers_default():
    sweep = MULTIVERSE.sweeps[0]
    for x, point in enumerate(POINTS):
        found = by_name((sweep.params_at(float(x), "paper"), sweep.hparams_at(float(x))))
        wanted = by_name((point.sweep.params_at(point.x, "paper"), point.sweep.hparams_at(point.x)))
        for name, leaf in found.items():
            np.testing.assert_array_equal(leaf, wanted[name], err_msg=name)


@pytest.mark.parametrize("figure", list(BASE_AT))
def test_the_target_environment_lies_in_every_figure(figure):
    sweep, target = STUDIES[figure].sweeps[0], jrcjax.paper_params("target")
    found, wanted = by_name(sweep.params_at(BASE_AT[figure], "paper")), by_name(target)
    for name, leaf in found.items():
        np.testing.assert_allclose(leaf, wanted[name], rtol=1e-6, err_msg=name)
    assert by_name(sweep.hparams_at(BASE_AT[figure])) == by_name(HParams())


def test_universes_read_the_paper_as_they_say():
    sweep = next(s for s in MULTIVERSE.sweeps if s.optimiser == "sgd")
    universes = grouped(UNIVERSES)["sgd"]
    for number, universe in list(enumerate(universes))[::5]:
        x = float(number * len(POINTS))
        params, hparams = sweep.params_at(x, "paper"), sweep.hparams_at(x)
        assert EventModel.names()[int(params.event_model)] == universe.event_model
        assert MissConvention.names()[int(params.miss_convention)] == universe.miss_convention
        read = (
            Distance.names()[int(params.radar.distance)],
            CountingRule.names()[int(params.radar.counting_rule)],
        )
        assert read == universe.resolution
        np.testing.assert_allclose(params.speed.event_probability[0], universe.low_speed_event_probability)
        assert bool(params.terminal_time_limit) == (universe.time_limit == "terminal")
        assert float(hparams.epsilon_slots) == 300 * universe.epsilon_episodes
        np.testing.assert_allclose(hparams.learning_rate, universe.optimiser.learning_rate)
        assert jrcjax.types.INITIAL_WEIGHTS[int(hparams.initial_weights)] == universe.initial_weights
        source = sweep.source.params_at(float(number), "paper")
        assert int(source.event_model) == int(params.event_model)
        assert sweep.source_points[int(x)] == number


def judged(value, low, high, claim="C"):
    verdict = str(verdicts(low, high, ">", 0.0))
    return Judgement(claim, "", "5", "", "", "", ">", 0.0, value, low, high, verdict, "", None, None, "", n_seeds=4)


def test_main_effects_find_the_reading_that_decides_and_no_other(monkeypatch):
    rng = np.random.default_rng(0)
    effects = {u: (1.0 if u.event_model == "noisy_or" else -1.0) for u in UNIVERSES}
    noise = {u: rng.normal() for u in UNIVERSES}

    def judged_in(universe):
        effect = effects[universe]
        return [judged(effect, effect - 0.5, effect + 0.5, "decided"), judged(noise[universe], -9, 9, "noise")]

    groups = grouped(UNIVERSES)
    sources = {name: xr.Dataset(coords={"point": range(len(of)), "algorithm": []}) for name, of in groups.items()}
    targets = {
        name: xr.Dataset(coords={"point": range(len(of) * len(POINTS)), "algorithm": []}) for name, of in groups.items()
    }
    found_by = {name: iter(of) for name, of in groups.items()}
    order = iter(u for name in groups for u in found_by[name])
    monkeypatch.setattr(multiverse, "claims_of", lambda source, target: judged_in(next(order)))
    found = multiverse.verdicts({n: (sources[n], targets[n]) for n in groups}, groups)
    table = multiverse.shares(found, multiverse.main_effects(found)).set_index("claim")
    assert table.loc["decided", "decided_by"] == "event_model (1.00)"
    np.testing.assert_allclose(table.loc["decided", ["supported", "contradicted"]].astype(float), [1 / 3, 2 / 3])
    assert table.loc["decided", "default"] == "contradicted"
    assert table.loc["noise", "undecided"] == 1.0
    # 5 % of eight readings may seem to decide noise; this noise has none of them.
    assert table.loc["noise", "decided_by"] == ""


# --- tiny runs ------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_tiny_robustness_study_writes_its_summary_and_goes_on(tmp_path, capsys):
    run = ["run", "robustness", "--smoke", "--episodes", "30", "--out", str(tmp_path)]
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


@pytest.mark.slow
def test_a_tiny_multiverse_judges_all_claims_as_the_figures_do(tmp_path):
    assert main(["run", "multiverse", "--smoke", "--episodes", "2", "--out", str(tmp_path)]) == 0
    found = pd.read_csv(tmp_path / "multiverse" / "summary" / "verdicts.csv")
    assert set(found.universe) == {0, 1}
    universes = pd.read_csv(tmp_path / "multiverse" / "summary" / "universes.csv")
    assert list(universes.columns) == ["universe", *LEVELS]
    assert list(universes.universe) == [0, 1]
    assert {claim.split()[0] for claim in found.claim} == {f"C{number}" for number in range(1, 16)}
    # The default universe is the figure, seed by seed.
    size = replace(SMOKE, episodes=2)
    alone = store.load(run_sweep(FIG5B, size, tmp_path, Console(quiet=True), resume=False), size.seeds)
    within = store.load(tmp_path / "multiverse" / "adam", size.seeds).isel(point=[0])
    np.testing.assert_allclose(within["reward"], alone["reward"], rtol=1e-4)


def test_a_multiverse_has_one_preset(tmp_path, capsys):
    assert main(["run", "multiverse", "--preset", "paper_table", "--out", str(tmp_path)]) == 2
    assert "preset: 'paper_table' is unknown; allowed: 'paper'\n" in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_points_of_a_multiverse_can_be_stacked():
    points = points_of(MULTIVERSE.smoke_sweeps[0], "paper")
    assert points.params.radar.miss_bank.shape[0] == 2 * len(POINTS)
    assert len(MULTIVERSE.sweeps) == 3
    assert sum(len(sweep.x_values) for sweep in MULTIVERSE.sweeps) == 72 * len(POINTS)
