"""Sweeps of one's own: any parameter by its path, any values, and what is refused before anything is run."""

import math

import jax
import numpy as np
import pandas as pd
import pytest
import xarray as xr

import jrcjax
from jrcjax.config.paths import Points, parameter_at
from jrcjax.config.stacking import with_value
from jrcjax.model.params import Factor
from jrcjax.readings import EventModel
from jrcjax.training.transfer import TARGET_LEARNERS
from paper_figs.plots import curves
from sweeps.__main__ import main
from sweeps.engine.job import Job
from sweeps.engine.verify import size_of_part
from sweeps.preset import preset_text
from sweeps.results import store
from sweeps.results.parts import Part
from sweeps.studies.custom import Options, custom_sweep
from sweeps.studies.registry import SWEEPS
from sweeps.studies.source import SOURCE
from sweeps.sweep import SMOKE, Size

TENTHS = "0.1:0.9:9"


@pytest.fixture(scope="module")
def point():
    return Points(jrcjax.paper_params("target"), jrcjax.HParams())


def assert_same(found, wanted):
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=1e-6), found, wanted)


def points_of(sweep):
    return Job(sweep, Size()).points


def at(point, path, value):
    return with_value(point, parameter_at(path, point), value)


@pytest.mark.parametrize(
    ("name", "vary"),
    [
        ("fig6", f"env.speed.event_probability.high={TENTHS}"),
        ("fig6", f"env.speed.event_probability.1={TENTHS}"),
        ("fig7", f"env.all.prior.low={TENTHS}"),
    ],
)
def test_the_papers_sweeps_can_be_asked_for(name, vary):
    sweep = custom_sweep(Options(vary=(vary,)), "paper")
    assert sweep.design.rows == SWEEPS[name].design.rows
    assert_same(points_of(sweep), points_of(SWEEPS[name]))


def test_hyperparameters_and_readings_vary_and_others_are_set():
    options = Options(vary=("hparams.discount=0.5,0",), set=("env.event_model=marginal", "hparams.target_period=7"))
    points = points_of(custom_sweep(options, "paper"))
    np.testing.assert_allclose(points.hparams.discount, [0.0, 0.5])
    np.testing.assert_array_equal(points.hparams.target_period, 7)
    np.testing.assert_array_equal(points.params.event_model, EventModel.MARGINAL)
    own = custom_sweep(Options(vary=("env.event_model=noisy_or,conditional",)), "paper")
    assert own.design.rows == ((0.0,), (2.0,))
    assert points_of(own).params.event_model.dtype == np.int32


def test_several_parameters_give_the_grid_and_settings_their_programs():
    rate, optimiser = "hparams.learning_rate", "config.optimiser"
    sweep = custom_sweep(
        Options(vary=(f"{rate}=1e-4,1e-3", f"{optimiser}=adam,sgd"), learners=("ddqn", "dpr")), "paper"
    )
    assert sweep.design.rows == ((1e-4, 0.0), (1e-4, 1.0), (1e-3, 0.0), (1e-3, 1.0))
    job = Job(sweep, SMOKE)
    assert [(g.rows, g.config.optimiser) for g in job.groups] == [((0, 2), "adam"), ((1, 3), "sgd")]
    np.testing.assert_array_equal(job.points.hparams.learning_rate, np.float32([1e-4, 1e-4, 1e-3, 1e-3]))
    # The source agents are trained with the same, each combination once.
    assert sweep.source.design.rows == sweep.design.rows
    assert sweep.source_points == (0, 1, 2, 3)
    of_table1 = custom_sweep(Options(vary=(f"{rate}=1e-4,1e-3",), learners=("dpr",), source="table1"), "paper")
    assert of_table1.source is SOURCE
    # Demonstrations come with their n-step returns, so n is the learners' in any case.
    of_n = custom_sweep(Options(vary=("config.n_step=1,5",), learners=("tlwd",), source="table1"), "paper")
    assert [g.config.n_step for g in Job(of_n.source, SMOKE).groups] == [1, 5]
    # What the source's learner does not read needs no source agents of its own.
    assert custom_sweep(Options(vary=("hparams.margin=1,2",), learners=("tlwd",)), "paper").source is SOURCE
    both = Options(vary=("hparams.margin=1,2", f"{rate}=1e-4,1e-3"), learners=("tlwd",))
    assert custom_sweep(both, "paper").source_points == (0, 1, 0, 1)


def test_table_ones_source_agents_are_not_a_presets():
    options = Options(vary=("hparams.margin=1,2",), learners=("tlwd",), source="table1")
    shared = preset_text({}, {"config.n_step": 5, "hparams.margin_weight": 2.0, "env.event_model": "marginal"})
    assert custom_sweep(options, shared).source is SOURCE
    own = {"hparams.learning_rate": 1e-4, "config.optimiser": "rmsprop"}
    said = preset_text({}, own | {"source": "table1"})
    job = Job(custom_sweep(options, said), Size(preset=said)).source
    assert (float(job.points.hparams.learning_rate[0]), job.groups[0].config.optimiser) == (np.float32(1e-3), "adam")
    for path, value in own.items():
        with pytest.raises(ValueError, match=f"source: 'table1'; allowed: .* beside \"{path}\" in the preset's"):
            custom_sweep(options, preset_text({}, {path: value}))


def test_a_sample_fills_its_ranges_and_begins_like_a_larger_one():
    vary = (
        "hparams.learning_rate=1e-6:1e-2:log",
        "config.optimiser=adam,sgd",
        "hparams.target_period=1:4",
        "hparams.margin=2:3",
    )
    few, many = (custom_sweep(Options(vary=vary, sample=n, sample_seed=5), "paper").design for n in (20, 64))
    assert many.rows[:20] == few.rows
    rate = np.log10(many.values("hparams.learning_rate"))
    counts, _ = np.histogram(rate, np.linspace(-6, -2, 9))
    np.testing.assert_array_equal(counts, 8)  # as even as a Sobol' sequence is
    np.testing.assert_array_equal(np.unique(many.values("config.optimiser"), return_counts=True)[1], 32)
    np.testing.assert_array_equal(
        np.unique(many.values("hparams.target_period"), return_counts=True), [[1, 2, 3, 4], [16] * 4]
    )
    assert custom_sweep(Options(vary=vary, sample=20, sample_seed=6), "paper").design.rows != few.rows


def test_a_table_gives_any_points_and_its_empty_cells_are_the_base(tmp_path):
    file = tmp_path / "points.csv"
    file.write_text("env.event_model, hparams.margin\nmarginal, 2\n, 0.5\nnoisy_or,\n")
    sweep = custom_sweep(Options(table=file), "paper")
    points = points_of(sweep)
    np.testing.assert_array_equal(points.params.event_model, [1, 0, 2])
    np.testing.assert_array_equal(points.hparams.margin, [2.0, 0.5, 1.0])
    file.write_text("env.event_model,hparams.margin\nmarginal,2\n,\n\nnoisy_or,0.5\n")
    points = points_of(custom_sweep(Options(table=file), "paper"))
    np.testing.assert_array_equal(points.params.event_model, [1, 0, 2])  # the line of empty cells is the base
    np.testing.assert_array_equal(points.hparams.margin, [2.0, 1.0, 0.5])
    for text, message in (
        ("env.event_model\n", "allowed: a line of paths"),
        ("env.event_model,hparams.margin\nmarginal\n", "allowed: a line of paths"),
        ("env.event_model,env.event_model\nmarginal,marginal\n", "allowed: each column once"),
        ("env.evnt_model\nmarginal\n", "'evnt_model'; allowed: after env one of"),
        ("env.event_model\nmarginl\n", "env.event_model: 'marginl'; allowed: conditional, marginal"),
        ("env.all.prior.low,env.road.prior.high\n0.5,0.5\n", "allowed: columns that do not set the same number"),
    ):
        file.write_text(text)
        with pytest.raises(ValueError, match=message):
            custom_sweep(Options(table=file), "paper")


def test_densities_beyond_those_of_the_base_share_one_shape(environments, tmp_path):
    base, file = environments["short-target"], tmp_path / "short.toml"
    jrcjax.save_params(file, base)
    params = points_of(custom_sweep(Options(vary=("env.radar.density=10,40",), base=str(file)), "paper")).params
    np.testing.assert_array_equal(params.radar.density, [10.0, 40.0])  # whose banks fit, or it would be refused
    np.testing.assert_array_equal(params.radar.miss_bank[0], base.radar.miss_bank)
    assert params.radar.max_objects[1] > base.radar.max_objects[1]


@pytest.mark.parametrize(
    "vary",
    [
        (f"env.speed.event_probability.high={TENTHS}",),
        ("env.radar.density=10,40", "hparams.learning_rate=1e-4,1e-3"),
        ("env.radar.bank_seed=0,1,2",),
        ("config.n_step=1,10",),
        ("env.radar.density=40",),
    ],
)
def test_programs_can_be_compiled_before_a_bank_is_drawn(vary, environments, tmp_path, monkeypatch):
    file = tmp_path / "short.toml"
    jrcjax.save_params(file, environments["short-target"])
    job = Job(custom_sweep(Options(vary=vary, base=str(file)), "paper"), SMOKE)
    with monkeypatch.context() as without:
        without.setattr("jrcjax.radar.bank._known_bank", lambda described: pytest.fail("a bank was drawn"))
        shapes = job.shapes
    wanted = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(leaf.shape, leaf.dtype), job.table)
    assert jax.tree.structure(shapes) == jax.tree.structure(wanted)
    assert jax.tree.leaves(shapes) == jax.tree.leaves(wanted)


def three_level_roads(params):
    return params.replace(road=Factor(prior=(0.5, 0.3, 0.2), event_probability=(0.0, 0.1, 0.2)))


def test_an_entry_of_a_distribution_takes_from_the_others_in_proportion(point):
    base = point._replace(params=three_level_roads(point.params))
    after = at(base, "env.road.prior.1", 0.4)
    np.testing.assert_allclose(after.params.road.prior, [0.6 * 5 / 7, 0.4, 0.6 * 2 / 7], rtol=1e-6)
    jrcjax.check_params(after.params)
    certain = at(base, "env.road.prior.0", 1.0)
    np.testing.assert_array_equal(certain.params.road.prior, [1.0, 0.0, 0.0])
    none = at(certain, "env.road.prior.0", 0.0)
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
        ("speed.prior.0", "speed.prior.0: 'speed'; allowed: env, hparams, config before the first dot"),
        ("config.episodes", "'episodes'; allowed: after config one of batch_size, "),
        ("config.hidden.0", "'hidden'; allowed: after config one of batch_size, "),
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
        ("hparams.discount", "0.5,0.5", "allowed: values that differ in float32"),
        ("hparams.discount", "0.5,0.5000000001", "allowed: values that differ in float32"),
        ("hparams.discount", "1e-60", "allowed: a number that fits float32, and is not 0 in it"),
        ("hparams.target_period", "3e9", "allowed: a number that fits 32 bits"),
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
        (["--vary", "env.radar.density=-1,5"], "radar.density: -1.0; allowed: a number > 0"),
        (["--vary", "hparams.margin=5,9", "--set", "hparams.margin=7"], "set: 'hparams.margin'; allowed: another"),
        (
            ["--vary", "hparams.margin=5,9", "--vary", "hparams.margin=7"],
            "vary: 'hparams.margin'; allowed: each path once",
        ),
        (["--vary", "env.all.prior.low=.5,.6", "--vary", "env.road.prior.high=.5"], "allowed: columns that do not set"),
        (
            ["--vary", "hparams.margin=0:1:999", "--vary", "hparams.discount=0:.9:999"],
            "'a grid of 998001 points'; allowed",
        ),
        (
            ["--vary", "hparams.margin=0:1:400", "--vary", "hparams.discount=0:.9:90"],
            "points x 1 seeds x 1 learners'; allow",
        ),
        (["--vary", "hparams.margin=1:0", "--sample", "8"], "hparams.margin: '1:0'; allowed: low < high"),
        (["--vary", "hparams.margin=0:1", "--sample", "1"], "sample: 1; allowed: an int from 2 to 100000"),
        (["--vary", "env.radar.density=5,9", "--source", "x"], "source: 'x' is unknown; allowed: 'same', 'table1'"),
        (
            ["--vary", "env.radar.density=5,9", "--source", "table1"],
            "source: 'table1'; allowed: same with learners",
        ),
        (["--vary", "env.radar.density=5,9", "--seed", "30"], "seed: 30; allowed: a seed beside --sample"),
        (
            ["--vary", "env.radar.density=5,9", "--wait", "9"],
            "wait: 9; allowed: a number of seconds beside --",
        ),
        (["--vary", "env.radar.density=5,9", "--set", "foo"], "set: 'foo'; allowed: PATH=VALUE"),
        (["--vary", "env.radar.density=5,9", "--learners", "sarsa"], "learners: 'sarsa' is unknown; allowed:"),
        (["--vary", "env.radar.density=5,9", "--learners", "ddqn", "ddqn"], "allowed: one or more different learners"),
        (["--vary", "env.radar.density=5,9", "--base", "mars"], "base: 'mars'; allowed: source, target, or a file"),
        (["--vary", "env.radar.density=5,9", "--name", "fig6"], "name: 'fig6'; allowed: letters, digits"),
        (["--vary", "env.radar.density=5,9", "--name", "../up"], "name: '../up'; allowed: letters, digits"),
        (
            ["--vary", "env.radar.density=5,9", "--preset", "x"],
            "preset: 'x'; allowed: paper, paper_table, best, or a file",
        ),
    ],
)
def test_bad_options_write_nothing(options, message, capsys, tmp_path):
    assert main(["run", "custom", *options, "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_other_sweeps_do_not_take_these_options(capsys, tmp_path):
    assert main(["run", "fig6", "--vary", "env.radar.density=5,9", "--out", str(tmp_path)]) == 2
    assert "name: 'fig6'; allowed: custom, for which alone --vary is" in capsys.readouterr().err


def test_learners_that_transfer_bring_sources_where_their_environment_allows(point, tmp_path):
    vary = ("env.event_model=marginal,noisy_or",)
    assert custom_sweep(Options(vary=vary), "paper").source is None
    assert custom_sweep(Options(vary=vary, learners=("ddqn", "tlwd")), "paper").source is SOURCE
    file = tmp_path / "three.toml"
    jrcjax.save_params(file, three_level_roads(point.params))
    assert custom_sweep(Options(vary=vary, base=str(file)), "paper").source is None
    with pytest.raises(ValueError, match="learners: 'dpr'; allowed: learners without transfer"):
        custom_sweep(Options(vary=vary, learners=("ddqn", "dpr"), base=str(file)), "paper")


def test_the_base_may_be_a_file(tmp_path):
    file = tmp_path / "short.toml"
    file.write_text('environment = "source"\nmax_steps_in_episode = 7\n')
    job = Job(custom_sweep(Options(vary=("hparams.discount=0.5,0.9",), base=str(file)), "paper"), SMOKE)
    assert job.spec.episode_slots == 7
    np.testing.assert_array_equal(job.points.params.nearby.prior[1], [np.float32(0.3), np.float32(0.7)])
    with pytest.raises(FileNotFoundError):
        custom_sweep(Options(vary=("hparams.discount=0.5,0.9",), base="absent.toml"), "paper")


def test_one_command_runs_and_draws_it(capsys, tmp_path):
    command = ["run", "custom", "--vary", "env.event_model=noisy_or,conditional", "--learners", *TARGET_LEARNERS]
    size = ["--smoke", "--out", str(tmp_path), "--name", "own"]
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


def test_results_tell_the_size_of_a_run_whose_points_change_a_part_of_it(tmp_path):
    file = tmp_path / "points.csv"
    file.write_text("hparams.margin,config.pretraining\n1,7\n2,\n3,5\n")
    size = Size(seeds=1, episodes=2, pretraining=9, demonstrations=30)
    for options in (
        Options(vary=("hparams.margin=1,2",), set=("config.pretraining=7",), learners=("tlwd",)),
        Options(vary=("config.pretraining=5,7",), learners=("tlwd",)),
        Options(table=file, learners=("tlwd",)),
        Options(table=file, learners=("ddqn",)),
    ):
        made = store.configuration(Job(custom_sweep(options, "paper"), size))
        assert size_of_part(Part(tmp_path, range(1), made, {}, "")) == size
        assert store.configuration(Job(store.sweep_of(made), size)) == made


@pytest.fixture
def summary_of(tmp_path, capsys):
    """Runs a custom sweep of Q-learning, which compiles fast; returns its folder."""

    def run(*options):
        size = ["--learners", "q_learning", "round_robin", "--smoke", "--episodes", "1", "--out", str(tmp_path)]
        assert main(["run", "custom", *options, *size]) == 0
        written = capsys.readouterr().out
        folder = tmp_path / "custom"
        assert all(str(path) in written for path in folder.glob("custom*"))
        return folder

    return run


def test_two_parameters_give_maps_and_where_learners_differ(summary_of):
    folder = summary_of("--vary", "env.speed.event_probability.high=0.2,0.8", "--vary", "hparams.discount=0.5,0.7,0.9")
    numbers, between, converged = (
        pd.read_csv(folder / f"custom{of}.csv") for of in ("", "-differences", "-convergence")
    )
    axes = ["env.speed.event_probability.high", "hparams.discount"]
    assert len(numbers[axes].drop_duplicates()) == 6
    data = xr.load_dataset(folder / "seeds-000000-000001.nc", engine="h5netcdf")
    assert set(between.other) == {"round_robin"}
    for at in between.query("panel == 'a'").to_dict("records"):
        point = data.isel(point=at["point"])
        assert [float(point[axis]) for axis in axes] == pytest.approx([at[axis] for axis in axes])
        gap = point["reward"].sel(algorithm="q_learning") - point["reward"].sel(algorithm="round_robin")
        assert at["mean"] == pytest.approx(float(gap.mean()), rel=1e-4)
        assert bool(at["significant"]) == (not at["ci_low"] <= 0 <= at["ci_high"])
    assert len(converged) == 2 * 6
    assert (converged.reached == 0).all()  # within a single episode nobody shows that it stays
    assert (converged["median"] == math.inf).all()
    for metric in ("reward", "throughput", "miss-detection"):
        assert (folder / f"custom-{metric}.pdf").stat().st_size > 0


def test_a_sample_gives_profiles_and_what_decides(summary_of):
    ranges = ("--vary", "env.speed.event_probability.high=0.05:0.9", "--vary", "hparams.margin=0.1:10:log")
    folder = summary_of(*ranges, "--sample", "32", "--seed", "3")
    assert len(pd.read_csv(folder / "custom.csv").point.unique()) == 32
    found = pd.read_csv(folder / "custom-sensitivity.csv").query("algorithm == 'Round Robin'").set_index("input")
    # Its policy reads no hyperparameter, so that its reward is the events' alone.
    assert found.total["env.speed.event_probability.high"] > 0.8
    assert found.total["hparams.margin"] < 0.2
    assert (folder / "custom-sensitivity.pdf").stat().st_size > 0


def test_a_table_is_run_point_by_point(summary_of, tmp_path):
    table = tmp_path / "points.csv"
    table.write_text("env.speed.event_probability.high,hparams.discount\n0.2,0.9\n0.8,\n,0.5\n")
    folder = summary_of("--table", str(table))
    numbers = pd.read_csv(folder / "custom.csv").drop_duplicates("point").set_index("point")
    default = float(jrcjax.HParams().discount)
    rows = [(0.2, 0.9), (0.8, default), (0.4, 0.5)]
    np.testing.assert_allclose(numbers[["env.speed.event_probability.high", "hparams.discount"]], rows, rtol=1e-6)


def test_points_that_are_as_many_as_a_grid_has_and_no_grid_get_no_maps(summary_of, tmp_path):
    table = tmp_path / "points.csv"
    table.write_text("env.speed.event_probability.high,hparams.discount\n0.2,0.9\n0.2,0.9\n0.8,0.5\n0.8,0.5\n")
    folder = summary_of("--table", str(table))
    assert len(pd.read_csv(folder / "custom.csv").point.unique()) == 4
    assert not (folder / "custom-differences.csv").exists()
