"""Trained agents on disk: bit-exact, acting, evaluated, handed on; and files that are none."""

import functools
import os
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from rich.console import Console
from safetensors.numpy import load_file, save_file

import jrcjax
from jrcjax import exact
from jrcjax.agents import layout
from jrcjax.config.toml import to_toml
from jrcjax.model import states
from jrcjax.model.params import Factor
from jrcjax.provenance import provenance
from jrcjax.training import rollout
from jrcjax.training.source import source_of
from sweeps.design import along
from sweeps.engine.job import Job
from sweeps.engine.run import run_sweep
from sweeps.results import store
from sweeps.results.agents import agents_path
from sweeps.sweep import Size, Sweep

CONFIG = jrcjax.Config(episodes=3, demonstrations=50, pretraining=10, replay_capacity=200, hidden=(9,))
KEY = jax.random.key(3)
LEARNERS = ("ddqn", "q_learning")
HPARAMS = jrcjax.HParams(discount=jnp.float32(0.9), target_period=jnp.int32(11))


def assert_same(found, wanted):
    """The same tree, types and bits."""
    assert jax.tree.structure(found) == jax.tree.structure(wanted)
    for a, b in zip(jax.tree.leaves(found), jax.tree.leaves(wanted), strict=True):
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(np.asarray(a), np.asarray(b))


@pytest.fixture(scope="module")
def params(environments):
    return environments["short-target"]


@functools.cache
def trainer(learner):
    """(environment, source) to agent and log, compiled once."""

    def run(params, source):
        return jrcjax.train(KEY, params, HPARAMS, learner=learner, config=CONFIG, source=source)

    return jax.jit(run)


@pytest.fixture(scope="module")
def other(params):
    """An environment like it."""
    return params.replace(speed=Factor(prior=(0.3, 0.7), event_probability=(0.01, 0.2)), event_model=jnp.int32(1))


@pytest.fixture(scope="module")
def trained(params):
    """Agent and log of each learner."""
    return {name: trainer(name)(params, None) for name in LEARNERS}


@pytest.fixture(scope="module")
def saved(params, trained, tmp_path_factory):
    """The same agents, from disk."""
    folder = tmp_path_factory.mktemp("agents")
    loaded = {}
    for name, (agent, _) in trained.items():
        path = folder / f"{name}.safetensors"
        assert jrcjax.save_agent(path, agent, params, HPARAMS, learner=name, config=CONFIG) == path
        loaded[name] = jrcjax.load_agent(path)
    return loaded


@pytest.fixture(scope="module")
def file(params, trained, tmp_path_factory):
    path = tmp_path_factory.mktemp("agent") / "ddqn.safetensors"
    return jrcjax.save_agent(path, trained["ddqn"][0], params, HPARAMS, learner="ddqn", config=CONFIG)


@pytest.mark.parametrize("name", LEARNERS)
def test_an_agent_comes_back_bit_by_bit_with_all_that_made_it(name, saved, trained, params):
    agent, live = saved[name], trained[name][0]
    values = {"q": live.learner.q} if name == "q_learning" else {"weights": live.learner.weights}
    assert_same(agent.values, values)
    assert_same(agent.params, params)
    assert_same(agent.hparams, HPARAMS)
    assert_same(jax.random.key_data(agent.key), jax.random.key_data(live.key))
    assert (agent.learner, agent.config, agent.point, agent.seed) == (name, CONFIG, 0, 0)
    assert agent.provenance["versions"]["jax"] == jax.__version__
    jrcjax.check_params(agent.params)


@pytest.mark.parametrize("name", LEARNERS)
def test_its_policy_is_that_of_the_live_agent(name, saved, trained, params):
    rule = rollout.learner_for(name, params, CONFIG)
    np.testing.assert_array_equal(saved[name].policy(), rule.policy(trained[name][0].learner))


@pytest.mark.parametrize("name", LEARNERS)
def test_its_exact_figures_are_those_that_the_log_ends_with(name, saved, trained):
    log, found = trained[name][1], saved[name].evaluate(episodes=1).exact
    wanted = (log.policy_reward[-1], log.policy_throughput[-1], log.policy_miss_detection[-1])
    np.testing.assert_allclose(found, wanted, rtol=1e-5)
    np.testing.assert_allclose(exact.evaluate_policy(saved[name].params, saved[name].policy()), wanted, rtol=1e-5)


def test_it_acts_on_numpy_observations(saved, params):
    agent = saved["ddqn"]
    actions = np.asarray(agent.policy()).argmax(axis=1)
    ids = np.arange(params.num_states)
    observations = np.array(states.features_of(jnp.asarray(ids), params.shape))
    np.testing.assert_array_equal(agent.act(observations), actions)
    assert [int(agent.act(row)) for row in observations] == actions.tolist()
    assert agent.act([0, 1, 1, 0, 1]) == actions[0b01101]


def test_it_acts_in_gymnasiums_environment(saved, params):
    pytest.importorskip("gymnasium", reason="gymnasium comes with the benchmarks' peers")
    from jrcjax.adapters.gymnasium_env import GymnasiumEnv

    agent, env = saved["ddqn"], GymnasiumEnv(params, seed=1)
    observation, _ = env.reset()
    for _ in range(5):
        observation, *_ = env.step(agent.act(observation))


def test_it_explores_as_often_as_it_is_told(saved, params):
    observations = np.zeros((4000, 5))
    greedy = saved["ddqn"].act(observations[0])
    actions = saved["ddqn"].act(observations, 0.4, np.random.default_rng(0))
    other = np.bincount(actions, minlength=4) / len(actions)
    wanted = np.where(np.arange(4) == greedy, 0.7, 0.1)
    assert np.abs(other - wanted).max() < 4 * np.sqrt(0.25 / 4000)
    assert set(saved["ddqn"].act(observations, 1.0, np.random.default_rng(1))) == {0, 1, 2, 3}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0, 0, 0, 0],), r"observations: .*shape \(4,\).*; allowed: shape \[5\] or \[N, 5\]"),
        (([0, 0, 0, 0, 0.5],), r"observations: 0.5; allowed: .*scaled to \[0, 1\]"),
        (([0, 0, 0, 0, 2.0],), r"observations: 2.0; allowed"),
        (([0, 0, 0, 0, np.nan],), r"observations: nan; allowed"),
        ((["a"] * 5,), r"observations: .<U1"),
        (([0, 0, 0, 0, 0], 0.1), r"rng: 'None'; allowed: a numpy.random.Generator"),
        (([0, 0, 0, 0, 0], 1.1), r"epsilon: 1.1; allowed: a probability"),
    ],
)
def test_what_it_cannot_act_on_is_refused(arguments, message, saved):
    with pytest.raises(ValueError, match=message):
        saved["ddqn"].act(*arguments)


def test_it_is_evaluated_in_any_environment_like_it(saved, params, other):
    agent = saved["ddqn"]
    found = agent.evaluate(other, episodes=400, key=jax.random.key(1))
    wanted = exact.evaluate_policy(other, agent.policy())
    np.testing.assert_allclose(found.exact, wanted, rtol=1e-5)
    assert found.reward.shape == (400,)
    # The simulated mean is the exact one within what 400 episodes, of 20 slots each, can tell.
    assert abs(found.reward.mean() - wanted.reward) < 4 * found.reward.std() / np.sqrt(400)
    uniform = agent.evaluate(other, episodes=1, epsilon=1.0).exact
    even = jnp.full((params.num_states, params.num_actions), 1 / params.num_actions)
    np.testing.assert_allclose(uniform, exact.evaluate_policy(other, even), rtol=1e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"episodes": 0}, "episodes: '0'; allowed: an integer >= 1"),
        ({"epsilon": -0.1}, "epsilon: -0.1"),
        ({"key": jax.random.split(KEY, 2)}, "key: .*; allowed: one key"),
        ({"params": "roads"}, r"params: .levels \(2, 3, 2, 2, 2\) and 4 actions.; allowed: levels \(2, 2, 2, 2, 2\)"),
    ],
)
def test_evaluations_that_do_not_fit_are_refused(change, message, saved, params):
    if "params" in change:
        change = {"params": params.replace(road=Factor(prior=(0.5, 0.3, 0.2), event_probability=(0.0, 0.1, 0.2)))}
    with pytest.raises(ValueError, match=message):
        saved["ddqn"].evaluate(**change)


def test_what_it_hands_on_is_what_the_source_agent_in_memory_hands_on(saved, params):
    source, _ = jax.jit(jrcjax.train_source, static_argnums=3)(KEY, params, HPARAMS, CONFIG)
    from_disk = saved["ddqn"].source()
    assert_same(from_disk.weights, source.weights)
    for name in ("state", "action", "next_state", "n_state"):
        assert_same(getattr(from_disk.demonstrations, name), getattr(source.demonstrations, name))
    np.testing.assert_allclose(from_disk.demonstrations.n_return, source.demonstrations.n_return, rtol=1e-5)
    more = saved["ddqn"].source(jrcjax.Config(demonstrations=70, hidden=(9,)))
    assert more.demonstrations.state.shape == (70,)


def test_a_transfer_from_it_is_the_transfer_from_memory(saved, trained, params, other, tmp_path):
    agent = trained["ddqn"][0]
    policy = saved["ddqn"].policy()
    hand_on = jax.jit(source_of, static_argnames="config")
    in_memory = hand_on(agent.key, policy, agent.learner.weights, params, HPARAMS, config=CONFIG)
    (from_disk, log), (from_memory, other_log) = (
        trainer("tlwd")(other, source) for source in (saved["ddqn"].source(), in_memory)
    )
    assert_same(from_disk.learner, from_memory.learner)
    assert_same(log, other_log)
    path = jrcjax.save_agent(tmp_path / "tlwd", from_disk, other, HPARAMS, learner="tlwd", config=CONFIG)
    np.testing.assert_allclose(jrcjax.load_agent(path).evaluate().exact.reward, log.policy_reward[-1], rtol=1e-5)


def test_agents_without_a_network_hand_nothing_on(saved):
    with pytest.raises(ValueError, match="learner: 'q_learning'; allowed: one with a network"):
        saved["q_learning"].source()
    with pytest.raises(ValueError, match=r"source.weights: .*as config.hidden has them"):
        saved["ddqn"].source(jrcjax.Config(demonstrations=50))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"learner": "round_robin"}, "learner: 'round_robin' is unknown; allowed: 'q_learning', 'ddqn', 'dpr', 'tlwd'"),
        ({"learner": "q_learning"}, r"agents.q_learning: .*allowed: \{'q': \(1, 1, 32, 4\)\}"),
        ({"config": jrcjax.Config()}, r"agents.ddqn: .*\(1, 1, 9, 5\).*allowed: .*\(1, 1, 24, 5\)"),
        ({"agent": 3}, "agent: int; allowed: AgentState"),
    ],
)
def test_agents_that_are_not_what_is_said_are_not_saved(change, message, trained, params, tmp_path):
    arguments = {"agent": trained["ddqn"][0], "learner": "ddqn", "config": CONFIG} | change
    with pytest.raises(ValueError, match=message):
        jrcjax.save_agent(tmp_path / "agent", env_params=params, **arguments)
    assert list(tmp_path.iterdir()) == []


def stacked(tree, points, seeds=None):
    """The same for so many points, and seeds."""
    axes = (points,) if seeds is None else (points, seeds)
    return jax.tree.map(lambda leaf: jnp.broadcast_to(leaf, (*axes, *leaf.shape)), tree)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"hparams": stacked(HPARAMS.replace(discount=1.5), 2)}, r"hparams\.discount: 1\.5; allowed"),
        ({"hparams": stacked(HPARAMS, 1)}, r"params.*: 'float32 of shape \(2,.*; allowed: float32 of shape \(1,"),
        ({"hparams": HPARAMS}, "params.*: 'float32 of shape"),
        ({"hparams": 3}, "hparams: int; allowed: HParams"),
        ({"env_params": "target"}, "params: str; allowed: EnvParams"),
        ({"env_params": None}, "params: NoneType; allowed: EnvParams"),
        ({"config": 3}, "config: int; allowed: Config"),
        ({"config": jrcjax.Config(hidden=(1,) * 101)}, "config.hidden: .*; allowed: a list of at most 100"),
        ({"seeds": [2_000_000]}, "seeds: 2000000; allowed: an int from 0 to 1000000"),
        ({"seeds": [0.5]}, "seeds: 0.5; allowed: an int from 0 to 1000000"),
        ({"seeds": []}, r"seeds: '\[\]'; allowed: a list of different ones"),
        ({"seeds": [0, 0]}, "seeds: .*a list of different ones"),
        ({"seeds": [0, 1]}, "agents.ddqn.key: 'uint32 of shape"),
        ({"agents": {}}, "agents: '{}'; allowed: the agents of at least one learner"),
        ({"agents": [1]}, "agents: list; allowed: dict"),
        ({"agents": {"ddqn": 3}}, "agents.ddqn: int; allowed: AgentState"),
        ({"agents": {"ddqn": rollout.AgentState(KEY, {})}}, r"key: 'shape \(\)'; allowed: a key for each point"),
    ],
)
def test_what_could_not_be_loaded_is_not_saved(change, message, trained, params, file):
    before = file.read_bytes()
    agent = rollout.AgentState(trained["ddqn"][0].key, {"weights": trained["ddqn"][0].learner.weights})
    arguments = {
        "agents": {"ddqn": stacked(agent, 2, 1)}, "env_params": stacked(params, 2), "hparams": stacked(HPARAMS, 2),
        "config": CONFIG, "seeds": np.arange(1),
    }  # fmt: skip
    with pytest.raises(ValueError, match=message):
        jrcjax.save_agents(file, **(arguments | change))
    assert file.read_bytes() == before
    path = jrcjax.save_agents(file.parent / "sound", **arguments)
    assert jrcjax.load_agent(path, point=np.int64(1)).point == 1
    path.unlink()


def test_agents_of_another_process_are_saved(trained, params, tmp_path, monkeypatch):
    """They come as arrays of NumPy, and so do the words of their keys; what was saved at the same time is the same."""
    when = provenance()
    monkeypatch.setattr("jrcjax.agents.file.provenance", lambda: when)
    here = stacked(trained["ddqn"][0]._replace(learner={"weights": trained["ddqn"][0].learner.weights}), 1, 1)
    there = jax.device_get(here._replace(key=jax.random.key_data(here.key)))
    rest = {"env_params": stacked(params, 1), "hparams": stacked(HPARAMS, 1), "config": CONFIG, "seeds": (0,)}
    files = [
        jrcjax.save_agents(tmp_path / name, {"ddqn": one}, **rest)
        for name, one in zip("ab", (here, there), strict=True)
    ]
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"env_params": "target"}, "params: str; allowed: EnvParams"),
        ({"hparams": {"discount": 0.9}}, "hparams: dict; allowed: HParams"),
        ({"hparams": jrcjax.HParams(discount="much")}, "hparams.discount: "),
    ],
)
def test_arguments_of_another_kind_are_refused_by_name(change, message, trained, params, tmp_path):
    arguments = {"env_params": params, "hparams": HPARAMS} | change
    with pytest.raises(ValueError, match=message):
        jrcjax.save_agent(tmp_path / "agent", trained["ddqn"][0], learner="ddqn", config=CONFIG, **arguments)


def test_an_optimiser_without_a_name_leaves_the_agent_usable(trained, params, tmp_path):
    config = jrcjax.Config(episodes=3, hidden=(9,), optimiser=optax.lion(1e-3))
    path = jrcjax.save_agent(tmp_path / "agent", trained["ddqn"][0], params, learner="ddqn", config=config)
    agent = jrcjax.load_agent(path)
    assert agent.config.optimiser == "optax"
    agent.act(np.zeros(5))
    with pytest.raises(ValueError, match=r"config.optimiser: 'optax'; allowed"):
        jrcjax.train(KEY, params, learner="ddqn", config=agent.config)


def test_an_old_style_key_is_kept(trained, params, tmp_path):
    agent = trained["ddqn"][0]._replace(key=jax.random.PRNGKey(3))
    loaded = jrcjax.load_agent(jrcjax.save_agent(tmp_path / "agent", agent, params, learner="ddqn", config=CONFIG))
    assert_same(jax.random.key_data(loaded.key), jax.random.PRNGKey(3))


def test_files_that_are_none_are_refused(file, tmp_path):
    with pytest.raises(FileNotFoundError):
        jrcjax.load_agent(tmp_path / "absent")
    broken = tmp_path / "broken"
    whole = file.read_bytes()
    for content in (b"", b"hello, this is a text", whole[:100], whole[:-1]):
        broken.write_bytes(content)
        with pytest.raises(ValueError, match="broken: damaged, or not a file that save_agent wrote"):
            jrcjax.load_agent(broken)
    for make, reason in ((Path.mkdir, "it is a folder"), (os.mkfifo, "it is a named pipe")):
        make(tmp_path / "other")
        with pytest.raises(ValueError, match=f"other: {reason}"):
            jrcjax.load_agent(tmp_path / "other")
        (tmp_path / "other").rename(tmp_path / reason.replace(" ", "-"))
    save_file({"a": np.zeros(3)}, broken)
    with pytest.raises(ValueError, match="broken: a safetensors file without agents"):
        jrcjax.load_agent(broken)


def test_every_flipped_bit_is_seen(file, tmp_path):
    """In the metadata, in the numbers and in the checksum itself."""
    whole, broken = file.read_bytes(), tmp_path / "broken"
    for bit in np.random.default_rng(0).integers(8 * len(whole), size=60):
        changed = bytearray(whole)
        changed[bit // 8] ^= 1 << bit % 8
        broken.write_bytes(changed)
        with pytest.raises(ValueError, match="broken: "):
            jrcjax.load_agent(broken)


def rewritten(file, target, about=None, tensors=None):
    """A copy that says something else, sealed as if it were meant."""
    there = layout.read(file)
    tensors = {name: value for name, value in (there.tensors | (tensors or {})).items() if value is not None}
    target.write_bytes(layout.content_of(tensors, {**there.about, **(about or {})}))
    return target


TAMPERED = {
    "version": ({"version": "3"}, None, "version: \"'3'\"; allowed: 3"),
    "another version": ({"version": 4}, None, "version: '4'; allowed: 3"),
    "another field": ({"more": 1}, None, "jrcjax agents: .*more.*; allowed: version, learners"),
    "no learners": ({"learners": []}, None, r"learners: '\[\]'; allowed: a list"),
    "an unknown learner": ({"learners": ["sarsa"]}, None, "learners: 'sarsa' is unknown"),
    "nested learners": ({"learners": [["ddqn"]]}, None, r"learners: \['ddqn'\] is unknown"),
    "a learner that is not there": ({"learners": ["ddqn", "dpr"]}, None, "agents.dpr.key: 'missing'"),
    "too many points": ({"points": 10**9}, None, "points: 1000000000; allowed"),
    "more points than there are": ({"points": 10**6}, None, r"params.*: 'float32 of shape \(1,.*; allowed"),
    "points as a text": ({"points": "1"}, None, "points: "),
    "seeds of another kind": ({"seeds": ["0"]}, None, "seeds: "),
    "one seed twice": ({"seeds": [0, 0]}, None, "seeds: .*a list of different ones"),
    "no configuration": ({"config": None}, None, "config: 'None'; allowed: an object with episodes"),
    "half a configuration": ({"config": {"episodes": 3}}, None, "config: .*; allowed: an object with episodes"),
    "no settings": ({"settings": {}}, None, "settings: .*; allowed: an object with"),
    "an unknown generator": ({"key_implementation": "mt19937"}, None, "key_implementation: .*allowed: 'threefry2x32'"),
    "no provenance": ({"provenance": 3}, None, "provenance: '3'; allowed: an object"),
    "a prior that is none": (None, {"params.speed.prior": np.full((1, 2), np.nan, np.float32)}, "speed.prior: "),
    "a bank above 1": (None, {"params.radar.miss_bank": np.full((1, 2, 8), 2, np.float32)}, "radar.miss_bank: "),
    "a discount that is none": (None, {"hparams.discount": np.full(1, np.nan, np.float32)}, "hparams.discount: "),
    "a missing field": (None, {"hparams.discount": None}, "hparams.discount: 'missing'"),
    "another type": (None, {"hparams.discount": np.full(1, 0.9)}, "hparams.discount: 'float64 of shape"),
    "more than that": (None, {"hparams.warmth": np.zeros(1, np.float32)}, "tensors: 'hparams.warmth'"),
}


@pytest.mark.parametrize("kind", TAMPERED)
def test_a_file_of_others_is_refused_by_field(kind, file, tmp_path):
    about, tensors, message = TAMPERED[kind]
    with pytest.raises(ValueError, match=f"other: {message}") as error:
        jrcjax.load_agent(rewritten(file, tmp_path / "other", about, tensors))
    assert len(str(error.value)) < 2000


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_an_agent_that_diverged_is_refused(number, file, tmp_path):
    name = next(name for name in layout.read(file).tensors if name.startswith("agents.ddqn.weights"))
    tensor = layout.read(file).tensors[name].copy()
    tensor[..., 0] = number
    with pytest.raises(ValueError, match=rf"other: {name}: .*; allowed: finite numbers"):
        jrcjax.load_agent(rewritten(file, tmp_path / "other", tensors={name: tensor}))


def test_a_file_of_another_shape_is_refused(file, tmp_path):
    wider = layout.read(file).about["config"] | {"hidden": [10]}
    with pytest.raises(ValueError, match=r"agents.ddqn: .*\(9, 5\).*allowed: .*\(10, 5\)"):
        jrcjax.load_agent(rewritten(file, tmp_path / "wider", {"config": wider}))


def test_any_reader_of_safetensors_reads_the_file(file):
    assert load_file(file)["hparams.discount"] == np.float32(0.9)


def test_numbers_as_people_write_them_are_saved(trained, params, tmp_path):
    hparams, params = jrcjax.HParams(learning_rate=3e-4, discount=0.9), params.replace(event_model=1)
    agent = trained["ddqn"][0]
    path = jrcjax.save_agent(tmp_path / "agent", agent, params, hparams, learner="ddqn", config=CONFIG)
    loaded = jrcjax.load_agent(path)
    assert (loaded.hparams.learning_rate, loaded.params.event_model) == (np.float32(3e-4), 1)


def test_an_interrupted_save_leaves_the_old_file(file, trained, params, monkeypatch):
    before = file.read_bytes()

    def fails(descriptor):
        raise OSError("disk full")

    monkeypatch.setattr("os.fsync", fails)
    with pytest.raises(OSError, match="disk full"):
        jrcjax.save_agent(file, trained["ddqn"][0], params, learner="ddqn", config=CONFIG)
    assert file.read_bytes() == before
    assert [path.name for path in file.parent.iterdir()] == [file.name]


# --- Agents of a sweep ------------------------------------------------------------------------------------------------

SIZE = Size(seeds=2, episodes=2)
QUIET = Console(quiet=True)


@pytest.fixture(scope="module")
def small(params):
    return Sweep(
        name="small",
        description="",
        learners=("q_learning", "round_robin", "ddqn"),
        environment=to_toml(params),
        design=along("discount", "hparams.discount", (0.5, 0.9)),
    )


@pytest.fixture(scope="module")
def folder(small, tmp_path_factory):
    return run_sweep(small, SIZE, tmp_path_factory.mktemp("results"), QUIET, resume=False, save_agents=True)


@pytest.mark.parametrize("learner", ["q_learning", "ddqn"])
@pytest.mark.parametrize(("point", "seed"), [(0, 1), (1, 0)])
def test_an_agent_of_a_sweep_is_the_one_that_its_results_tell_of(folder, small, learner, point, seed):
    agent = jrcjax.load_agent(agents_path(folder, range(2)), learner=learner, point=point, seed=seed)
    assert (agent.learner, agent.point, agent.seed) == (learner, point, seed)
    told = store.load(folder, 2).sel(algorithm=learner, seed=seed).isel(point=point, episode=-1)
    np.testing.assert_allclose(agent.evaluate(episodes=1).exact.reward, float(told["policy_reward"]), rtol=1e-5)
    assert_same((agent.params, agent.hparams), jax.tree.map(lambda a: a[point], tuple(Job(small, SIZE).points)))
    assert agent.hparams.discount == np.float32((0.5, 0.9)[point])


@pytest.mark.parametrize(
    ("which", "message"),
    [
        ({}, "learner: 'None'; allowed: one of 'ddqn', 'q_learning', which the file holds"),
        ({"learner": "round_robin"}, "learner: 'round_robin'; allowed: one of 'ddqn', 'q_learning'"),
        ({"learner": "ddqn"}, "point: 'None'; allowed: one of 0, 1"),
        ({"learner": "ddqn", "point": 2}, "point: 2; allowed: one of 0, 1"),
        ({"learner": "ddqn", "point": 0.0, "seed": 0}, "point: 0.0; allowed: one of 0, 1"),
        ({"learner": "ddqn", "point": False, "seed": 0}, "point: 'False'; allowed: one of 0, 1"),
        ({"learner": "ddqn", "point": 0, "seed": 1.0}, "seed: 1.0; allowed: one of 0, 1"),
        ({"learner": "ddqn", "point": 0, "seed": 7}, "seed: 7; allowed: one of 0, 1"),
    ],
)
def test_an_agent_that_is_not_there_is_refused_with_those_that_are(which, message, folder):
    with pytest.raises(ValueError, match=message):
        jrcjax.load_agent(agents_path(folder, range(2)), **which)


def test_results_without_agents_are_not_taken_for_results_with_them(small, folder, tmp_path):
    run_sweep(small, Size(seeds=1, episodes=2), tmp_path, QUIET, resume=False)
    with pytest.raises(ValueError, match=r"save-agents: .*results of seeds 0 without their agents"):
        run_sweep(small, SIZE, tmp_path, QUIET, resume=True, save_agents=True)
    assert run_sweep(small, SIZE, folder.parent, QUIET, resume=True, save_agents=True) == folder
