"""Sweeps of one's own: any parameter by its path, any values, and what is refused before anything is run."""

import jax
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import jrcjax
from jrcjax.config.paths import parameter_at
from jrcjax.model.params import Factor
from jrcjax.readings import EventModel
from paper_figs.plots import curves
from sweeps.__main__ import main
from sweeps.engine.program import Points, points_of
from sweeps.engine.sources import SOURCE
from sweeps.studies.custom import Options, custom_sweep
from sweeps.studies.registry import SWEEPS

TENTHS = "0.1:0.9:9"


@pytest.fixture(scope="module")
def point():
    return Points(jrcjax.paper_params("target"), jrcjax.HParams())


def assert_same(found, wanted):
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-6), found, wanted)


@pytest.mark.parametrize(
    ("name", "vary"),
    [
        ("fig6", f"env.speed.event_probability.high={TENTHS}"),
        ("fig6", f"env.speed.event_probability.1={TENTHS}"),
        ("fig7", f"env.all.prior.low={TENTHS}"),
    ],
)
def test_the_papers_sweeps_can_be_asked_for(name, vary):
    sweep = custom_sweep(Options(vary=vary), "paper").sweep
    assert sweep.x_values == SWEEPS[name].x_values
    assert_same(points_of(sweep, "paper"), points_of(SWEEPS[name], "paper"))


def test_hyperparameters_and_readings_vary_and_others_are_set():
    options = Options(vary="hparams.discount=0.5,0", set=("env.event_model=marginal", "hparams.target_period=7"))
    sweep = custom_sweep(options, "paper").sweep
    points = points_of(sweep, "paper")
    np.testing.assert_allclose(points.hparams.discount, [0.0, 0.5])
    np.testing.assert_array_equal(points.hparams.target_period, 7)
    np.testing.assert_array_equal(points.params.event_model, EventModel.MARGINAL)
    own = custom_sweep(Options(vary="env.event_model=noisy_or,conditional"), "paper")
    assert own.sweep.x_values == (0.0, 2.0)
    assert points_of(own.sweep, "paper").params.event_model.dtype == np.int32


def test_densities_beyond_those_of_the_base_share_one_shape(environments, monkeypatch):
    base = environments["short-target"]
    monkeypatch.setattr("sweeps.studies.custom._base", lambda base_name, preset: base)
    sweep = custom_sweep(Options(vary="env.radar.density=10,40"), "paper").sweep
    params = points_of(sweep, "paper").params  # which checks that the banks fit
    np.testing.assert_array_equal(params.radar.density, [10.0, 40.0])
    np.testing.assert_array_equal(params.radar.miss_bank[0], base.radar.miss_bank)
    assert params.radar.max_objects[1] > base.radar.max_objects[1]


def three_level_roads(params):
    return params.replace(road=Factor(prior=(0.5, 0.3, 0.2), event_probability=(0.0, 0.1, 0.2)))


def test_an_entry_of_a_distribution_takes_from_the_others_in_proportion(point):
    base = point._replace(params=three_level_roads(point.params))
    after = parameter_at("env.road.prior.1", base).set_in(base, 0.4)
    np.testing.assert_allclose(after.params.road.prior, [0.6 * 5 / 7, 0.4, 0.6 * 2 / 7], rtol=1e-6)
    jrcjax.check_params(after.params)
    certain = parameter_at("env.road.prior.0", base).set_in(base, 1.0)
    np.testing.assert_array_equal(certain.params.road.prior, [1.0, 0.0, 0.0])
    none = parameter_at("env.road.prior.0", base).set_in(certain, 0.0)
    np.testing.assert_array_equal(none.params.road.prior, [0.0, 0.5, 0.5])
    with pytest.raises(ValueError, match=r"one of 0, 1, 2$"):
        parameter_at("env.road.prior.low", base)
    with pytest.raises(ValueError, match=r"'2'; allowed: after env.all.prior one of 0, 1, low, high"):
        parameter_at("env.all.prior.2", base)


@pytest.mark.parametrize(
    ("path", "text", "values"),
    [
        ("env.speed.prior.low", TENTHS, (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)),
        ("hparams.learning_rate", "1e-4:1e-2:3:log", (1e-4, 1e-3, 1e-2)),
        ("hparams.margin", "3, 1,2", (1.0, 2.0, 3.0)),
        ("hparams.initial_weights", "source,random", (0.0, 1.0)),
        ("hparams.target_period", "100:300:3", (100.0, 200.0, 300.0)),
    ],
)
def test_values_are_read_as_a_person_means_them(path, text, values, point):
    assert parameter_at(path, point).values_of(text) == values


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("speed.prior.0", "speed.prior.0: 'speed'; allowed: env or hparams before the first dot"),
        ("config.batch_size", "allowed: env or hparams .* Config decide shapes"),
        ("env.sped.prior.0", "env.sped.prior.0: 'sped'; allowed: after env one of channel, road, weather, speed"),
        ("env.speed", "env.speed: ''; allowed: after env.speed one of prior, event_probability, persistence"),
        ("env.speed.prior.2", "'2'; allowed: after env.speed.prior one of 0, 1, low, high"),
        ("env.radar.bandwidth.low", "'low'; allowed: after env.radar.bandwidth one of 0, 1"),
        ("env.all.packets.0", "'packets'; allowed: after env.all one of prior, event_probability, persistence"),
        ("env.radar.density.0", "'0'; allowed: nothing more, env.radar.density is a number"),
        ("env.radar.placements", "'placements'; allowed: numbers that leave shapes and code alone"),
        ("env.max_steps_in_episode", "allowed: numbers that leave shapes and code alone"),
        ("env.radar.miss_bank.0.0", "'miss_bank'; allowed: what a radar is made from"),
        ("hparams.lr", "'lr'; allowed: after hparams one of discount,"),
    ],
)
def test_paths_that_lead_nowhere_are_refused_with_the_way_on(path, message, point):
    with pytest.raises(ValueError, match=message):
        parameter_at(path, point)


@pytest.mark.parametrize(
    ("path", "text", "message"),
    [
        ("hparams.discount", "high", "hparams.discount: 'high'; allowed: a number"),
        ("hparams.discount", "nan", "allowed: a finite number"),
        ("hparams.discount", "", "allowed: a number"),
        ("hparams.discount", "0:1", r"allowed: start:stop:count"),
        ("hparams.discount", "0:1:1", r"allowed: start:stop:count"),
        ("hparams.discount", "0:1:3:4", r"allowed: start:stop:count"),
        ("hparams.discount", "0:1:3:log", "allowed: numbers > 0 on a logarithmic scale"),
        ("hparams.discount", "0.5,0.5", "allowed: values that differ"),
        ("hparams.target_period", "1.5", "hparams.target_period: '1.5'; allowed: an integer"),
        ("env.event_model", "0", "env.event_model: '0'; allowed: conditional, marginal, noisy_or"),
        ("env.event_model", "0:2:3", "allowed: conditional, marginal, noisy_or"),
    ],
)
def test_values_that_mean_nothing_are_refused(path, text, message, point):
    with pytest.raises(ValueError, match=message):
        parameter_at(path, point).values_of(text)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "vary: ''; allowed: PATH=VALUES"),
        (["--vary", "env.radar.density"], "vary: 'env.radar.density'; allowed: PATH=VALUES"),
        (["--vary", "env.speed.event_probability.low=0.5,1.5"], "speed.event_probability: [1.5, "),
        (["--vary", "hparams.discount=0.5,1"], "hparams.discount: 1.0; allowed: a number in [0, 1)"),
        (["--vary", "env.radar.density=-1,5"], "radar.density: -1.0; allowed: a number of objects > 0"),
        (["--vary", "hparams.margin=5,9", "--set", "hparams.margin=7"], "set: 'hparams.margin'; allowed: another"),
        (["--vary", "env.radar.density=5,9", "--set", "foo"], "set: 'foo'; allowed: PATH=VALUE"),
        (["--vary", "env.radar.density=5,9", "--learners", "sarsa"], "learners: 'sarsa' is unknown; allowed:"),
        (["--vary", "env.radar.density=5,9", "--learners", "ddqn", "ddqn"], "allowed: one or more different learners"),
        (["--vary", "env.radar.density=5,9", "--base", "mars"], "base: 'mars'; allowed: source, target, or a file"),
        (["--vary", "env.radar.density=5,9", "--name", "fig6"], "name: 'fig6'; allowed: letters, digits"),
        (["--vary", "env.radar.density=5,9", "--name", "../up"], "name: '../up'; allowed: letters, digits"),
        (["--vary", "env.radar.density=5,9", "--preset", "x"], "preset: 'x'; allowed: paper, paper_table, or a file"),
    ],
)
def test_bad_options_write_nothing(options, message, capsys, tmp_path):
    assert main(["run", "custom", *options, "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_other_sweeps_do_not_take_these_options(capsys, tmp_path):
    assert main(["run", "fig6", "--vary", "env.radar.density=5,9", "--out", str(tmp_path)]) == 2
    assert "name: 'fig6'; allowed: custom, for which alone --vary is" in capsys.readouterr().err


def test_learners_that_transfer_bring_sources_where_their_environment_allows(point, monkeypatch):
    vary = "hparams.discount=0.5,0.9"
    assert custom_sweep(Options(vary=vary), "paper").sweep.source is None
    assert custom_sweep(Options(vary=vary, learners=("ddqn", "tlwd")), "paper").sweep.source is SOURCE
    monkeypatch.setattr("sweeps.studies.custom._base", lambda base, preset: three_level_roads(point.params))
    assert custom_sweep(Options(vary=vary), "paper").sweep.source is None
    with pytest.raises(ValueError, match="learners: 'dpr'; allowed: learners without transfer"):
        custom_sweep(Options(vary=vary, learners=("ddqn", "dpr")), "paper")


def test_the_base_may_be_a_file(tmp_path):
    file = tmp_path / "short.toml"
    file.write_text('environment = "source"\nmax_steps_in_episode = 7\n')
    own = custom_sweep(Options(vary="hparams.discount=0.5,0.9", base=str(file)), "paper")
    assert own.slots == 7
    np.testing.assert_array_equal(own.sweep.params_at(0.5, "paper").nearby.prior, [np.float32(0.3), np.float32(0.7)])
    with pytest.raises(FileNotFoundError):
        custom_sweep(Options(vary="hparams.discount=0.5,0.9", base="absent.toml"), "paper")


def test_one_command_runs_and_draws_it(capsys, tmp_path):
    command = ["run", "custom", "--vary", "env.event_model=noisy_or,conditional", "--learners", "q_learning", "dpr"]
    size = ["--smoke", "--episodes", "1", "--out", str(tmp_path), "--name", "own"]
    assert main([*command, *size]) == 0
    folder = tmp_path / "own"
    assert str(folder / "own.pdf") in capsys.readouterr().out
    table = pd.read_csv(folder / "own.csv")
    assert list(table.columns) == [*curves.COLUMNS, "reading"]
    assert set(table.algorithm) >= {"q_learning", "dpr", "optimum"}
    data = xr.load_dataset(folder / "seeds-000000-000001.nc", engine="h5netcdf")
    drawn = table.query("panel == 'a' and algorithm == 'dpr' and reading == 'noisy_or'")["mean"].item()
    assert drawn == pytest.approx(float(data["reward"].sel(algorithm="dpr").isel(point=1).mean()), rel=1e-5)
    for suffix in (".pdf", ".png"):
        assert (folder / f"own{suffix}").stat().st_size > 0
    assert main(["verify", str(folder)]) == 0
    assert "the same, bit for bit" in capsys.readouterr().out
    other = ["run", "custom", "--vary", "env.event_model=marginal,conditional", *size, "--resume"]
    assert main(other) == 2
    assert "holds results of another configuration" in capsys.readouterr().err
