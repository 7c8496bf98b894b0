"""Figures: the numbers first, then the files; drawing is a function of results and never trains."""

import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy import stats

from jrcjax.training import Log
from paper_figs import claims, curves, statistics, style
from paper_figs.__main__ import main
from paper_figs.figures import FIGURES

ALGORITHMS = ("ddqn", "q_learning", "round_robin")


def results(seeds=6, episodes=800, optimum=4.0, reward=None, policy=None):
    """Results with known numbers: rewards and exact rewards per algorithm, plus small noise between seeds."""
    rng = np.random.default_rng(1)
    shape = (1, seeds, episodes)
    reward = reward or {"ddqn": 3.8, "q_learning": 3.0, "round_robin": -8.0}
    policy = policy or {"ddqn": 3.95, "q_learning": 3.0, "round_robin": -8.0}
    dims = ("algorithm", "point", "seed", "episode")
    noise = 0.01 * rng.standard_normal(shape)
    variables = {name: (dims, np.zeros((3, *shape))) for name in Log._fields}
    variables["reward"] = (dims, np.stack([reward[a] + noise for a in ALGORITHMS]))
    variables["policy_reward"] = (dims, np.stack([policy[a] + noise for a in ALGORITHMS]))
    variables["optimum_reward"] = (("point",), [optimum])
    variables["constant_reward"] = (("point",), [optimum - 0.5])
    coords = {"algorithm": list(ALGORITHMS), "point": [0], "seed": range(seeds), "episode": range(1, episodes + 1)}
    return xr.Dataset(variables, coords)


def test_intervals_are_students_t():
    values = np.random.default_rng(0).normal(size=(12, 3))
    mean = statistics.mean_over_seeds(values)
    reference = stats.ttest_1samp(values, 0).confidence_interval(0.95)
    np.testing.assert_allclose([mean.low, mean.high], [reference.low, reference.high])
    assert np.isnan(statistics.mean_over_seeds(values[:1]).low).all()


@pytest.mark.parametrize(("episodes", "width"), [(1000, 10), (20, 1), (100, 1), (150, 2), (101, 101)])
def test_bins_divide_the_episodes_and_give_at_most_a_hundred_points(episodes, width):
    assert statistics.bins_of(episodes) == width


def test_table_holds_bin_means_over_seeds_and_the_exact_optimum():
    data = results()
    table = curves.table(data, "5", "a")
    assert list(table.columns) == curves.COLUMNS
    ddqn = table[table.algorithm == "ddqn"]
    reward = data["reward"].sel(algorithm="ddqn").isel(point=0).values
    np.testing.assert_array_equal(ddqn.x, np.arange(8, 801, 8))
    np.testing.assert_allclose(ddqn["mean"].iloc[3], reward[:, 24:32].mean())
    assert (ddqn.ci_low < ddqn["mean"]).all()
    assert set(ddqn.n_seeds) == {6}
    optimum = table[table.algorithm == "optimum"]
    assert set(optimum["mean"]) == {4.0}
    assert set(optimum.n_seeds) == {0}


def test_drawn_curves_are_the_table():
    table = curves.table(results(), "5", "a")
    axes = curves.draw(table, "title").axes[0]
    lines = {line.get_label(): line for line in axes.get_lines()}
    assert set(lines) == {"optimum (exact)", "best constant action (exact)", "DDQN", "Q-learning", "Round Robin"}
    np.testing.assert_allclose(lines["DDQN"].get_ydata(), table[table.algorithm == "ddqn"]["mean"])
    np.testing.assert_allclose(lines["optimum (exact)"].get_ydata(), 4.0)
    assert "6 seeds" in axes.get_title()
    assert "slot" in axes.get_ylabel()


def test_one_seed_is_drawn_without_a_band():
    axes = curves.draw(curves.table(results(seeds=1), "5", "a"), "title").axes[0]
    assert "no interval" in axes.get_title()


def test_saved_pictures_are_the_same_bytes(tmp_path):
    table = curves.table(results(), "5", "a")
    first = style.save(curves.draw(table, "title"), tmp_path / "first")
    second = style.save(curves.draw(table, "title"), tmp_path / "second")
    assert [path.suffix for path in first] == [".pdf", ".png"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_fonts_are_embedded_as_type_42(tmp_path):
    pdf, _ = style.save(curves.draw(curves.table(results(), "5", "a"), "title"), tmp_path / "figure")
    assert b"/Subtype /Type3" not in pdf.read_bytes()
    assert b"/FontFile2" in pdf.read_bytes()


def verdicts(data):
    return {judgement.claim: judgement.verdict for judgement in claims.source_claims(data)}


def test_claims_in_a_world_where_they_are_true():
    assert set(verdicts(results()).values()) == {"supported"}


def test_claims_in_a_world_where_they_are_false():
    wrong = {"ddqn": 3.0, "q_learning": 3.99, "round_robin": 3.995}
    assert set(verdicts(results(reward=wrong, policy=wrong)).values()) == {"contradicted"}


def test_claims_that_seeds_cannot_decide():
    edge = {"ddqn": 3.8, "q_learning": 3.8, "round_robin": 3.8}
    data = results(reward=edge, policy=edge)
    # Seeds that straddle the limit, half on each side.
    sides = xr.DataArray(0.1 * np.where(np.arange(6) % 2, 1.0, -1.0), dims="seed")
    data["policy_reward"] = data["policy_reward"] + sides
    found = verdicts(data)
    assert [found[name] for name in ("C1 (reached)", "C1 (stable)", "C2 (Q-learning)")] == ["undecided"] * 3


def test_too_few_episodes_leave_claims_undecided_without_a_value():
    late = claims.source_claims(results(episodes=200))[:3]
    assert [judgement.verdict for judgement in late] == ["undecided"] * 3
    assert all(row["value"] is None for row in claims.as_json(late))


def test_verdicts_follow_the_tolerance():
    # The exact gap of DDQN in these results is 1.25 %.
    found = [claims.source_claims(results(), tolerance)[1].verdict for tolerance in (0.005, 0.02)]
    assert found == ["contradicted", "supported"]


def test_one_seed_decides_nothing_and_its_interval_is_null_in_json():
    rows = claims.as_json(claims.source_claims(results(seeds=1)))
    assert {row["verdict"] for row in rows} == {"undecided"}
    assert all(row["ci_low"] is None for row in rows)
    json.dumps(rows, allow_nan=False)


def test_bootstrap_covers_the_true_mean_as_often_as_it_says():
    rng = np.random.default_rng(5)
    n_seeds, worlds = 40, 600
    covered = 0
    for _ in range(worlds):
        _, low, high = claims.bootstrap_mean(rng.normal(1.0, 2.0, n_seeds))
        covered += low <= 1.0 <= high
    # 95 % less what the percentile bootstrap is known to lose at 40 seeds (about 1 %), and 4 standard errors.
    assert 0.94 - 4 * np.sqrt(0.95 * 0.05 / worlds) < covered / worlds < 0.95 + 4 * np.sqrt(0.95 * 0.05 / worlds)


@pytest.mark.slow
def test_one_command_writes_everything(tmp_path):
    out = tmp_path / "figures"
    command = [sys.executable, "-m", "paper_figs", "--only", "5", "--smoke", "--seeds", "3", "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for figure in FIGURES:
        for suffix in (".pdf", ".png", ".csv"):
            assert (out / f"{figure.name}{suffix}").stat().st_size > 0
    table = pd.read_csv(out / "fig5a.csv")
    assert {"figure", "panel", "algorithm", "x", "mean", "ci_low", "ci_high", "n_seeds"} <= set(table.columns)
    assert set(table.n_seeds) == {0, 3}
    assert {row["claim"] for row in json.loads((out / "claims.json").read_text())} > {"C1 (reached)"}
    page = (out / "report.html").read_text()
    assert "data:image/png;base64," in page
    assert "http" not in page  # self-contained
    again = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "all 3 seeds are there" in again.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--only", "4"], "only: [4]; allowed: 5"),
        (["--seeds", "-1"], "seeds: -1; allowed: an integer >= 1"),
        (["--preset", "x"], "preset: 'x' is unknown; allowed: 'paper', 'paper_table'"),
    ],
)
def test_command_line_errors_write_nothing(arguments, message, capsys, tmp_path):
    out = tmp_path / "figures"
    assert main([*arguments, "--out", str(out)]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()
