"""Sweeps end to end at a tiny size: parts on disk, resuming, refusing, and agreement with single runs."""

import contextlib
import io
import json
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rich.console import Console
from trees import by_name

import jrcjax
from jrcjax import exact
from jrcjax.provenance import provenance
from jrcjax.training import parallel
from jrcjax.training.source import train_source
from jrcjax.training.train import train
from jrcjax.training.transfer import target_key
from sweeps.__main__ import main
from sweeps.design import Column, Design, along
from sweeps.engine.job import Job
from sweeps.engine.plan import blocks, compile_ahead, expected_seconds, plan
from sweeps.engine.program import chunk_of, joined
from sweeps.engine.run import run_sweep, run_together
from sweeps.engine.sources import missing_sources, sources_of
from sweeps.results import store
from sweeps.results.configuration import configuration, digest_of
from sweeps.studies.registry import STUDIES, SWEEPS
from sweeps.studies.source import SOURCE
from sweeps.sweep import SMOKE, Size, size_of

FIG5A = SWEEPS["fig5a"]
SIZE = Size(seeds=3, episodes=2)
QUIET = Console(quiet=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return run_sweep(FIG5A, SIZE, tmp_path_factory.mktemp("results"), QUIET, resume=False)


def test_results_have_named_dimensions_and_the_optimum(folder):
    data = store.load(folder, SIZE.seeds)
    assert dict(data.sizes) == {"algorithm": 3, "point": 1, "seed": 3, "episode": 2}
    params = jrcjax.paper_params("source")
    best = exact.evaluate_policy(params, exact.optimal_policy(params))
    np.testing.assert_allclose(data["optimum_reward"].values, [best.reward], rtol=1e-6)
    assert np.isfinite(data["reward"].values).all()


@pytest.mark.parametrize("learner", ["ddqn", "q_learning", "round_robin"])
def test_a_seed_of_a_sweep_is_a_single_run_of_that_key(folder, learner):
    data = store.load(folder, SIZE.seeds)
    key = jax.random.fold_in(jax.random.key(0), 2)
    config = jrcjax.Config(episodes=SIZE.episodes)
    _, log = jrcjax.train(key, jrcjax.paper_params("source"), learner=learner, config=config)
    swept = data.sel(algorithm=learner, seed=2).isel(point=0)
    # Batched and single programs round differently, which 600 slots of training do not amplify beyond this.
    np.testing.assert_allclose(swept["reward"].values, log.reward, rtol=1e-4)
    np.testing.assert_allclose(swept["throughput"].values, log.throughput, rtol=1e-4)


def test_more_seeds_are_added_and_the_old_part_is_left_alone(folder):
    part = store.part_path(folder, range(0, 3))
    before = part.read_bytes()
    run_sweep(FIG5A, Size(seeds=5, episodes=2), folder.parent, QUIET, resume=True)
    assert part.read_bytes() == before
    assert sorted(p.name for p in folder.glob("*.nc")) == ["seeds-000000-000002.nc", "seeds-000003-000004.nc"]
    assert list(store.load(folder, 5)["seed"].values) == [0, 1, 2, 3, 4]
    manifest = json.loads((folder / store.MANIFEST).read_text())
    assert manifest["seeds"] == [0, 1, 2, 3, 4]
    assert {"configuration", "parts", "command", "versions", "machine", "git_commit"} <= manifest.keys()


def test_results_of_another_configuration_are_refused_with_the_difference(folder):
    with pytest.raises(store.ConfigurationMismatch, match=r"episodes: 2 there, 4 wanted"):
        run_sweep(FIG5A, Size(seeds=3, episodes=4), folder.parent, QUIET, resume=True)


def test_a_part_of_another_configuration_is_refused_also_without_a_manifest(tmp_path):
    folder = run_sweep(FIG5A, Size(seeds=1, episodes=2), tmp_path, QUIET, resume=False)
    (folder / store.MANIFEST).unlink()
    with pytest.raises(store.ConfigurationMismatch, match='preset: "paper" there, "paper_table" wanted'):
        run_sweep(FIG5A, Size(seeds=2, episodes=2, preset="paper_table"), tmp_path, QUIET, resume=True)


def test_the_digest_sees_every_number_of_an_environment():
    points = Job(FIG5A, SIZE).points.params
    other = points.replace(reward_weights=points.reward_weights.at[0, 2].add(1e-6))
    assert digest_of(points) == digest_of(Job(FIG5A, SIZE).points.params)
    assert digest_of(points) != digest_of(other)


def test_results_know_how_they_were_made_without_git(monkeypatch):
    monkeypatch.setenv("PATH", "")
    made = provenance()
    assert made["git_commit"] is None
    assert made["versions"]["jax"]


def test_existing_results_are_not_touched_without_resume(folder):
    with pytest.raises(ValueError, match="--resume"):
        run_sweep(FIG5A, SIZE, folder.parent, QUIET, resume=False)


def test_missing_seeds_are_named(folder):
    with pytest.raises(FileNotFoundError, match="seeds"):
        store.load(folder, 50)


def test_blocks_cover_what_is_missing_once_and_keep_to_the_grid():
    finished = {0, 1, 2, 17, 18}
    todo = list(blocks(40, finished, 16))
    assert sorted(seed for block in todo for seed in block) == sorted(set(range(40)) - finished)
    assert all(block.start // 16 == (block.stop - 1) // 16 for block in todo)


@pytest.mark.parametrize(("episodes", "chunk"), [(1000, 20), (20, 20), (7, 7), (53, 1), (96, 16)])
def test_chunks_divide_the_episodes(episodes, chunk):
    assert chunk_of(episodes) == chunk


@contextlib.contextmanager
def compilations():
    """Names of the functions that are compiled."""
    compiled = []

    def listen(event, duration, **about):
        if event == "/jax/core/compile/backend_compile_duration":
            compiled.append(about.get("fun_name"))

    jax.monitoring.register_event_duration_secs_listener(listen)
    try:
        yield compiled
    finally:
        jax.monitoring.unregister_event_duration_listener(listen)


def test_the_program_is_compiled_once_for_all_blocks(tmp_path):
    with compilations() as compiled:
        # Three blocks, with a number of episodes that no other test uses, so that nothing is compiled yet.
        run_sweep(FIG5A, Size(seeds=2 * FIG5A.seeds_per_part + 1, episodes=3), tmp_path, QUIET, resume=False)
    assert compiled.count("jit(checked)") == 2  # one program starts the agents, one advances them


def test_groups_are_joined_on_the_host_since_an_exchange_between_devices_can_stall():
    keys = jax.random.split(jax.random.key(0), 32)
    agents = parallel.over_agents(lambda shared, agent: agent)(0, (keys, jnp.arange(32.0)))
    assert len(agents[1].sharding.device_set) == 2
    with compilations() as compiled:
        joined_keys, numbers = joined([agents, agents])
    assert not {"jit(concatenate)", "jit(checked)"} & set(compiled)
    np.testing.assert_array_equal(numbers, np.tile(np.arange(32.0), 2))
    assert joined_keys.dtype == keys.dtype
    np.testing.assert_array_equal(jax.random.key_data(joined_keys)[32:], jax.random.key_data(keys))


def test_the_reference_of_stacked_points_is_that_of_each_alone():
    job = Job(FIG5A, Size(episodes=150, preset="paper_table"))
    assert job.points.params.radar.density.shape == (1,)
    params = jrcjax.paper_params("source", "paper_table")
    best = exact.evaluate_policy(params, exact.optimal_policy(params))
    reference = job.reference
    np.testing.assert_allclose(reference.optimum.reward[0], best.reward, rtol=1e-6)
    # Episode 151 and all after it explore with the smallest epsilon, episode 1 with nearly the largest.
    for episode, epsilon in ((149, 0.01), (0, 1 - 0.99 * 149.5 / 30_000)):
        policy = (1 - epsilon) * exact.optimal_policy(params) + epsilon / params.num_actions
        wanted = exact.evaluate_policy(params, policy).reward
        np.testing.assert_allclose(reference.explored.reward[0, episode], wanted, rtol=1e-5)


@pytest.mark.parametrize("field", ["seeds", "episodes"])
@pytest.mark.parametrize("value", [0, -1, 1.5, True, "3", None])
def test_bad_sizes_are_refused(field, value, tmp_path):
    with pytest.raises(ValueError, match=f"^{field}: "):
        run_sweep(FIG5A, Size(**{field: value}), tmp_path, QUIET, resume=False)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "fig99"], "name: 'fig99' is unknown; allowed: 'fig5a', 'fig5b', 'fig6'"),
        (["run", "fig5a", "--seeds", "0"], "seeds: 0; allowed: an int from 1 to 1000000"),
        (["run", "fig5a", "--preset", "table"], "preset: 'table'; allowed: paper, paper_table, best, or a file"),
    ],
)
def test_command_line_errors_name_field_value_and_allowed(arguments, message, capsys, tmp_path):
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_list_names_every_sweep(capsys):
    assert main(["list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == [*STUDIES, "custom"]


def test_options_overrule_the_smoke_size():
    assert size_of(None, None, "paper", smoke=True) == SMOKE
    assert size_of(7, None, "paper_table", smoke=True) == replace(SMOKE, seeds=7, preset="paper_table")
    assert size_of(None, 5, "paper", smoke=False) == Size(10, 5, "paper")


def test_keys_of_seeds_do_not_depend_on_how_many_there_are():
    few = [jax.random.fold_in(jax.random.key(0), i) for i in range(3)]
    many = jax.vmap(lambda i: jax.random.fold_in(jax.random.key(0), i))(jnp.arange(100))
    assert all((jax.random.key_data(a) == jax.random.key_data(b)).all() for a, b in zip(few, many[:3], strict=True))


# --- Sweeps that transfer ---------------------------------------------------------------------------------------------

TINY = Size(seeds=2, episodes=2, pretraining=12, demonstrations=70)
_P, _ALPHA = "env.speed.event_probability.high", "hparams.priority_exponent"
PAIR = replace(
    SWEEPS["fig6"],
    name="pair",
    design=Design((Column(_P, _P), Column(_ALPHA, _ALPHA)), ((0.1, None), (0.9, 0.0))),
)


def point_of(sweep, number):
    """Environment, hyperparameters and settings of one point."""
    job = Job(sweep, TINY)
    (config,) = [group.config for group in job.groups if number in group.rows]
    return *jax.tree.map(lambda leaf: leaf[number], job.points), config


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    return run_sweep(PAIR, TINY, tmp_path_factory.mktemp("results"), QUIET, resume=False)


@pytest.mark.parametrize("point", [0, 1])
def test_a_seed_of_a_transfer_sweep_is_a_single_run_of_that_key(pair, point):
    data = store.load(pair, TINY.seeds)
    key = jax.random.fold_in(jax.random.key(0), 1)
    target, hparams, config = point_of(PAIR, point)
    source = jrcjax.paper_params("source")
    alone = jrcjax.transfer(key, source, target, hparams, config=config, learners=PAIR.learners)
    for learner in PAIR.learners:
        swept = data.sel(algorithm=learner, seed=1).isel(point=point)
        for name in ("reward", "throughput", "miss_detection", "policy_reward"):
            # Batched and single programs round differently, which 600 slots of training do not amplify beyond this.
            np.testing.assert_allclose(swept[name].values, getattr(alone.logs[learner], name), rtol=1e-4)
    kept = sources_of(Job(SOURCE, TINY), range(2), pair.parent)
    for held, wanted in zip(jax.tree.leaves(kept), jax.tree.leaves(alone.source), strict=True):
        # Where a gradient is nothing but rounding, Adam's step has either sign and up to the learning rate's size.
        held, wanted = np.asarray(held[0, 1]), np.asarray(wanted)
        np.testing.assert_allclose(held, wanted, rtol=1e-4, atol=float(hparams.learning_rate))
        assert np.sum(~np.isclose(held, wanted, rtol=1e-4, atol=1e-5)) <= max(1, 0.01 * wanted.size)


def test_source_agents_are_trained_once_for_all_sweeps(pair):
    part = store.part_path(pair.parent / "source", range(0, 2))
    before = part.read_bytes()
    assert missing_sources(Job(SOURCE, TINY), range(2), pair.parent) == range(0)
    assert missing_sources(Job(SOURCE, TINY), range(4), pair.parent) == range(2, 4)
    run_sweep(replace(PAIR, name="other", learners=("dpr",)), TINY, pair.parent, QUIET, resume=False)
    assert part.read_bytes() == before
    assert [path.name for path in (pair.parent / "source").glob("*.nc")] == [part.name]


def test_sources_come_back_from_disk_as_they_were(pair):
    trained = sources_of(Job(SOURCE, TINY), range(2), pair.parent)
    some = sources_of(Job(SOURCE, TINY), range(1, 2), pair.parent)
    assert trained.demonstrations.state.shape == (1, 2, 70)
    jax.tree.map(lambda whole, part: np.testing.assert_array_equal(whole[:, 1:], part), trained, some)
    for a, b in zip(trained.demonstrations, some.demonstrations, strict=True):
        assert a.dtype == b.dtype


def test_a_source_of_several_points_hands_on_what_is_trained_at_each(tmp_path):
    sgd = (("config.optimiser", 1.0),)
    two = replace(SOURCE, name="two", design=along("p", "env.speed.event_probability.low", (0.005, 0.05)), fixed=sgd)
    found = sources_of(Job(two, TINY), range(2), tmp_path)
    key = jax.random.fold_in(jax.random.key(0), 1)
    for point in (0, 1):
        alone, _ = train_source(key, *point_of(two, point))
        for held, wanted in zip(jax.tree.leaves(found), jax.tree.leaves(alone), strict=True):
            np.testing.assert_allclose(held[point, 1], wanted, rtol=1e-4, atol=1e-5)
    # The learners at a point take over the source that the sweep names for it.
    sweep = replace(PAIR, name="crossed", learners=("dpr",), source=two, source_points=(1, 0), fixed=sgd)
    run_sweep(sweep, TINY, tmp_path, QUIET, resume=False)
    data = store.load(tmp_path / "crossed", 2)
    for point in (0, 1):
        source = jax.tree.map(lambda leaf: leaf[1 - point, 1], found)  # noqa: B023
        params, hparams, config = point_of(sweep, point)
        log = train(target_key(key), params, hparams, learner="dpr", config=config, source=source)[1]
        swept = data["policy_reward"].isel(algorithm=0, point=point, seed=1).values
        np.testing.assert_allclose(swept, log.policy_reward, rtol=1e-4)


def test_points_of_several_settings_are_programs_of_their_own_and_one_result(tmp_path):
    optimiser, rate = "config.optimiser", "hparams.learning_rate"
    rows = ((0.0, 1e-3), (1.0, 1e-5), (0.0, 1e-4))
    mixed = replace(
        FIG5A, name="mixed", learners=("ddqn",), design=Design((Column(optimiser, optimiser), Column(rate, rate)), rows)
    )
    job = Job(mixed, TINY)
    assert [(group.rows, group.config.optimiser) for group in job.groups] == [((0, 2), "adam"), ((1,), "sgd")]
    data = store.load(run_sweep(mixed, TINY, tmp_path, QUIET, resume=False), 2)
    np.testing.assert_array_equal(data[optimiser], [0, 1, 0])
    key = jax.random.fold_in(jax.random.key(0), 1)
    for point in range(3):
        params, hparams, config = point_of(mixed, point)
        log = train(key, params, hparams, learner="ddqn", config=config)[1]
        np.testing.assert_allclose(data["reward"].isel(algorithm=0, point=point, seed=1), log.reward, rtol=1e-4)


def test_sources_of_another_configuration_are_refused(pair):
    with pytest.raises(store.ConfigurationMismatch, match="demonstrations"):
        run_sweep(PAIR, replace(TINY, demonstrations=71), pair.parent, QUIET, resume=True)


def test_hyperparameters_of_points_are_part_of_the_configuration():
    found = configuration(Job(PAIR, TINY))
    assert found["hparams"]["priority_exponent"] == [0.4, 0.0]
    assert found["hparams"]["discount"] == 0.99
    assert found["config"]["pretraining"] == 12
    assert found["source"] == configuration(Job(SOURCE, TINY))


def test_a_transfer_sweep_compiles_once_for_all_blocks_and_that_ahead_of_them(tmp_path):
    size = replace(TINY, seeds=2 * FIG5A.seeds_per_part, episodes=1, pretraining=3)
    sweep = replace(PAIR, learners=("tlwd", "dpr"))
    again = replace(sweep, name="again", design=along(_P, _P, (0.2, 0.4, 0.6)))  # a program serves any few points
    bundles = plan([FIG5A, sweep], size, tmp_path)
    with compilations() as compiled, contextlib.closing(compile_ahead(bundles, tmp_path)) as ahead:
        for bundle in bundles:
            ahead.wait(bundle.job.sweep)
        # Source agents start and advance like those of Fig. 5(a), and demonstrate; the sweep's start and advance.
        assert compiled.count("jit(checked)") == 5
        assert list(run_together([FIG5A, sweep], size, tmp_path, QUIET)) == [FIG5A, sweep]
        run_sweep(again, size, tmp_path, QUIET, resume=False)
    assert compiled.count("jit(checked)") == 5


@pytest.mark.parametrize("name", list(SWEEPS))
def test_points_are_what_the_paper_varies(name):
    sweep = SWEEPS[name]
    params, hparams = Job(sweep, SIZE).points
    base = jrcjax.paper_params("source" if name == "fig5a" else "target")
    varied = {
        "fig6": {"speed.event_probability": params.speed.event_probability[:, 1]},
        "fig7": {
            f"{f}.prior": getattr(params, f).prior[:, 0] for f in ("channel", "road", "weather", "speed", "nearby")
        },
        "fig8": {"radar.density": params.radar.density},
        "fig9": {"priority_exponent": hparams.priority_exponent / 0.4, "importance_end": hparams.importance_end},
    }.get(name, {})
    for values in varied.values():
        wanted = (1.0, 0.0) if name == "fig9" else sweep.design.values(sweep.design.columns[0].name)
        np.testing.assert_allclose(values, wanted, rtol=1e-6)
    # Nothing else differs from the paper's environment.
    derived = {"fig8": ("radar.miss_bank",)}.get(name, ())
    wanted = by_name(base)
    for field, leaf in by_name(params).items():
        if field not in varied and field not in derived:
            np.testing.assert_array_equal(leaf, np.broadcast_to(wanted[field], leaf.shape))
    assert (sweep.source is None) == (name == "fig5a")


def seconds(sweeps, size, out):
    return expected_seconds(plan(sweeps, size, out), out)


def test_the_expected_time_grows_with_the_work_and_is_nothing_for_nothing(tmp_path):
    one, more = (seconds([FIG5A], Size(seeds=10, episodes=e), tmp_path) for e in (100, 300))
    np.testing.assert_allclose(more, 3 * one)
    assert seconds([SWEEPS["fig6"]], Size(), tmp_path) > seconds([SWEEPS["fig5b"]], Size(), tmp_path)
    assert seconds([], Size(), tmp_path) == 0


def test_the_expected_time_is_told_before_and_counts_what_is_there(tmp_path):
    console = Console(record=True, width=200, file=io.StringIO())
    run_sweep(FIG5A, Size(seeds=2, episodes=2), tmp_path, QUIET, resume=False)
    run_sweep(FIG5A, Size(seeds=3, episodes=2), tmp_path, console, resume=True)
    assert "fig5a: 3 agents (points x seeds x learners), 2 episodes each; expected 0 s" in console.export_text()
    assert seconds([FIG5A], Size(seeds=3, episodes=2), tmp_path) == 0
