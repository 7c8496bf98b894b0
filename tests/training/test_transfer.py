"""From source to target: who starts from what, with which random numbers, and what is refused."""

import dataclasses
import functools
import sys

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from backpropagation import all_features, forward, layers_of
from sources import random_source

import jrcjax
from jrcjax.checks import require_keys
from jrcjax.learners import LEARNERS, Learner, Source, Spec
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model.params import Factor
from jrcjax.replay import packing, prioritised, uniform
from jrcjax.training import rollout
from jrcjax.training.source import demonstrate
from jrcjax.training.transfer import TARGET_LEARNERS, Transfer, target_key

CONFIG = Config(
    episodes=2, batch_size=8, replay_capacity=600, demonstrations=107, pretraining=20, n_step=4, hidden=(9,)
)  # fmt: skip
HPARAMS = HParams(epsilon_slots=jnp.float32(30.0), target_period=jnp.int32(7))
KEYS = jax.random.split(jax.random.key(5), 2)


@pytest.fixture(scope="module")
def params(environments):
    """Source and target with short episodes, which need not be equally long."""
    return environments["short-source"], environments["short-target"].replace(max_steps_in_episode=15)


def run(key, source, target, hparams=HPARAMS, learners=TARGET_LEARNERS) -> Transfer:
    return jrcjax.transfer(key, source, target, hparams, config=CONFIG, learners=learners)


@pytest.fixture(scope="module")
def compiled():
    return jax.jit(run)


@pytest.fixture(scope="module")
def study(compiled, params) -> Transfer:
    return compiled(KEYS[0], *params, HPARAMS)


@functools.cache
def trained(learner):
    return jax.jit(
        lambda key, env, hparams, source: jrcjax.train(key, env, hparams, learner=learner, config=CONFIG, source=source)
    )


def assert_close(got, wanted):
    """To float32 rounding of what different programs add in different orders."""
    for g, w in zip(jax.tree.leaves(got), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_allclose(g, w, rtol=1e-4, atol=1e-4)


# --- What a study is made of ------------------------------------------------------------------------------------------


def test_a_study_has_finite_logs_of_all_learners(study):
    assert set(study.logs) == set(study.agents) == set(TARGET_LEARNERS) == LEARNERS.keys()
    for log in (study.source_log, *study.logs.values()):
        for field in log:
            assert field.shape == (CONFIG.episodes,)
            assert np.isfinite(field).all()
    for agent in study.agents.values():
        assert agent.key == target_key(KEYS[0])
    assert target_key(KEYS[0]) != KEYS[0]


@pytest.mark.parametrize("learner", TARGET_LEARNERS)
def test_logs_are_those_of_train_with_the_source(learner, study, params):
    agent, log = trained(learner)(target_key(KEYS[0]), params[1], HPARAMS, study.source)
    assert_close(study.logs[learner], log)
    assert_close(study.agents[learner].learner, agent.learner)


def test_learners_that_draw_as_many_words_in_a_slot_meet_the_same_states(study, params):
    """DPR and DDQN do; TLwD draws two words for each of a mini-batch and has states of its own."""
    slots = CONFIG.episodes * params[1].max_steps_in_episode
    layout = uniform.layout_of(params[1].num_states, params[1].num_actions)
    ddqn, dpr = (packing.unpack(study.agents[name].learner.ring[:slots], layout).state for name in ("ddqn", "dpr"))
    np.testing.assert_array_equal(ddqn, dpr)
    lines = prioritised.layout_of(
        params[1].num_states, params[1].num_actions, CONFIG.replay_capacity, CONFIG.demonstrations, CONFIG.n_step
    )
    held = prioritised.contents(study.agents["tlwd"].learner.replay, lines, HPARAMS.discount)[1].state
    assert (held[CONFIG.demonstrations :][: slots - CONFIG.n_step] != ddqn[: slots - CONFIG.n_step]).any()


def test_the_source_is_a_ddqn_agent_and_what_it_does_then(study, params):
    train = jax.jit(lambda key, env: jrcjax.train(key, env, HPARAMS, learner="ddqn", config=CONFIG))
    agent, log = train(KEYS[0], params[0])
    assert_close(study.source.weights, agent.learner.weights)
    assert_close(study.source_log, log)
    policy = rollout.learner_for("ddqn", params[0], CONFIG).policy(agent.learner)
    shown = demonstrate(jax.random.fold_in(KEYS[0], 3), policy, params[0], HPARAMS, CONFIG)
    assert_close(study.source.demonstrations, shown)
    source, source_log = jax.jit(lambda key, env: jrcjax.train_source(key, env, HPARAMS, CONFIG))(KEYS[0], params[0])
    assert_close(source, study.source)
    assert_close(source_log, study.source_log)


def test_same_arguments_same_numbers_and_others_with_another_key(compiled, study, params):
    again, other = (compiled(key, *params, HPARAMS) for key in KEYS)
    jax.tree.map(np.testing.assert_array_equal, (study.source, study.logs), (again.source, again.logs))
    assert all((study.logs[name].reward != other.logs[name].reward).any() for name in TARGET_LEARNERS)


def test_types_are_the_same_where_64_bits_are_allowed(params):
    """JAX_ENABLE_X64 makes float64 of whatever has no type of its own."""
    with jax.enable_x64(True):
        study = jax.eval_shape(lambda key: run(key, *params), KEYS[0])
        solved = jax.eval_shape(lambda p: jrcjax.exact.evaluate_policy(p, jrcjax.exact.optimal_policy(p)), params[1])
        corners = jax.eval_shape(jrcjax.front.reachable, params[1])
    numbers = [leaf for leaf in jax.tree.leaves((study, solved, corners)) if jnp.issubdtype(leaf.dtype, jnp.number)]
    assert {leaf.dtype.itemsize for leaf in numbers} == {4}


# --- vmap -------------------------------------------------------------------------------------------------------------


def with_events(params, event_probability):
    """The environment with other events at high speed."""
    speed = params.speed.replace(event_probability=jnp.stack([params.speed.event_probability[0], event_probability]))
    return params.replace(speed=speed)


@pytest.mark.slow
def test_vmap_over_keys_environments_and_hyperparameters(compiled, params):
    stack = lambda *trees: jax.tree.map(lambda *leaves: jnp.stack(leaves), *trees)  # noqa: E731
    sources, targets = ([with_events(env, jnp.float32(p)) for p in (0.1, 0.9)] for env in params)
    numbers = [HPARAMS, HPARAMS.replace(learning_rate=jnp.float32(1e-2), priority_exponent=jnp.float32(0.9))]
    some = ("tlwd", "q_learning")
    many = jax.jit(jax.vmap(lambda *arguments: run(*arguments, learners=some)))
    together = many(KEYS, stack(*sources), stack(*targets), stack(*numbers))
    assert set(together.logs) == set(some)
    for i in range(2):
        alone = compiled(KEYS[i], sources[i], targets[i], numbers[i])
        assert_close(jax.tree.map(lambda leaf, i=i: leaf[i], together.logs), {name: alone.logs[name] for name in some})
        assert_close(jax.tree.map(lambda leaf, i=i: leaf[i], together.source), alone.source)


def test_over_targets_alone_the_source_is_trained_once(params):
    """vmap refuses `out_axes=None` for whatever depends on the target."""
    source, target = params
    events = jnp.asarray([0.1, 0.5, 0.9])
    study = jax.eval_shape(
        jax.vmap(lambda p: run(KEYS[0], source, with_events(target, p)), out_axes=Transfer(None, None, 0, 0)),  # pyright: ignore
        events,
    )
    assert study.source_log.reward.shape == (CONFIG.episodes,)
    assert {log.reward.shape for log in study.logs.values()} == {(3, CONFIG.episodes)}
    with pytest.raises(ValueError, match="out_axes"):
        jax.eval_shape(
            jax.vmap(lambda p: run(KEYS[0], with_events(source, p), target), out_axes=Transfer(None, None, 0, 0)),  # pyright: ignore
            events,
        )


# --- Direct policy reuse ----------------------------------------------------------------------------------------------


SPEC = Spec(shape=(3, 2, 2), num_actions=4, episode_slots=15)


@pytest.mark.parametrize("form", ["table", "rows"])
def test_dpr_starts_from_the_sources_weights_and_nothing_else(form):
    config = dataclasses.replace(CONFIG, form=form)
    source = random_source(SPEC, config)
    learner, ddqn = LEARNERS["dpr"](SPEC, config), LEARNERS["ddqn"](SPEC, config)
    state, fresh = learner.init(KEYS[0], HPARAMS, source), ddqn.init(KEYS[0], HPARAMS, None)
    jax.tree.map(np.testing.assert_array_equal, state.weights, source.weights)
    table = forward(layers_of(source.weights), all_features(SPEC.shape))[-1].T
    if form == "table":
        np.testing.assert_allclose(state.target.T, table, rtol=1e-5, atol=1e-5)
    else:
        jax.tree.map(np.testing.assert_array_equal, state.target, source.weights)
    jax.tree.map(np.testing.assert_array_equal, state.optimiser, fresh.optimiser)
    assert not np.any(state.ring)
    assert state.ring.shape == fresh.ring.shape
    np.testing.assert_array_equal(learner.policy(state), np.eye(4)[table.argmax(axis=1)])


def test_dpr_explores_as_ddqn_does():
    source = random_source(SPEC, CONFIG)
    learner, ddqn = LEARNERS["dpr"](SPEC, CONFIG), LEARNERS["ddqn"](SPEC, CONFIG)
    state = learner.init(KEYS[0], HPARAMS, source)
    words, slots = jax.random.bits(KEYS[1], (400, 2), jnp.uint32), jnp.arange(400) % 60
    act = lambda rule: jax.vmap(rule.act, in_axes=(None, 0, 0, 0, None))  # noqa: E731
    arguments = (state, slots % 12, slots, words, HPARAMS)
    np.testing.assert_array_equal(act(learner)(*arguments), act(ddqn)(*arguments))


@pytest.mark.parametrize("learner", ["dpr"])
def test_optimisers_that_remember_weights_start_from_the_sources(learner):
    remembering = optax.GradientTransformation(lambda weights: weights, lambda g, state, weights=None: (g, state))
    config = dataclasses.replace(CONFIG, optimiser=remembering)
    source = random_source(SPEC, config)
    state = LEARNERS[learner](SPEC, config).init(KEYS[0], HPARAMS, source)
    jax.tree.map(np.testing.assert_array_equal, state.optimiser, source.weights)


# --- Training with a source, and without ------------------------------------------------------------------------------


def keeper(spec, config) -> Learner:
    """A learner whose state is the source that it was given."""
    states = int(np.prod(spec.shape))
    return Learner(
        num_words=0,
        init=lambda key, hparams, source: source,
        act=lambda state, state_id, slot, words, hparams: jnp.int32(0),
        update=lambda state, transition, slot, words, hparams: state,
        policy=lambda state: jnp.full((states, spec.num_actions), 1 / spec.num_actions),
        needs_source=True,
    )


def test_without_a_source_one_is_trained_in_the_papers(params):
    config, source = dataclasses.replace(CONFIG, episodes=1), jrcjax.paper_params("source")
    train_source = jax.jit(lambda key: jrcjax.train_source(key, source, HPARAMS, config)[0])
    settings = {"learner": keeper, "config": config}
    agent, _ = jax.jit(lambda key: jrcjax.train(key, params[1], HPARAMS, **settings))(KEYS[1])
    agents, _ = jrcjax.train_agents(KEYS, params[1], HPARAMS, **settings)
    wanted = train_source(jax.random.fold_in(KEYS[1], 2))
    assert_close(agent.learner, wanted)
    assert_close(jax.tree.map(lambda leaf: leaf[1], agents.learner), wanted)
    with pytest.raises(AssertionError):
        assert_close(jax.tree.map(lambda leaf: leaf[0], agents.learner), wanted)


@pytest.mark.parametrize("learner", LEARNERS)
def test_all_learners_train_without_a_source(learner, params):
    train = lambda key: jrcjax.train(key, params[1], HPARAMS, learner=learner, config=CONFIG)[1]  # noqa: E731
    assert {field.shape for field in jax.eval_shape(train, KEYS[0])} == {(CONFIG.episodes,)}


def test_many_agents_train_with_a_source_each(params):
    target, keys = params[1], jax.random.split(jax.random.key(6), 3)
    sources = [random_source(rollout.spec_of(target), CONFIG, seed) for seed in range(3)]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *sources)
    agents, logs = jrcjax.train_agents(keys, target, HPARAMS, learner="tlwd", config=CONFIG, source=stacked)
    for i in range(3):
        agent, log = trained("tlwd")(keys[i], target, HPARAMS, sources[i])
        assert_close(jax.tree.map(lambda leaf, i=i: leaf[i], logs), log)
        assert_close(jax.tree.map(lambda leaf, i=i: leaf[i], agents.learner), agent.learner)


# --- Refusals ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def nothing_runs(monkeypatch):
    def refuse(*_):
        raise AssertionError("checks come before any work")

    for name in ("training.train", "training.transfer"):
        for function in ("train_source", "init_agent", "run_episodes"):
            monkeypatch.setattr(sys.modules[f"jrcjax.{name}"], function, refuse)


def good_source(target, agents=None, **settings):
    source = random_source(rollout.spec_of(target), dataclasses.replace(CONFIG, **settings))
    return source if agents is None else jax.tree.map(lambda leaf: jnp.stack([leaf] * agents), source)


BAD_SOURCES = {
    "dictionary": (lambda s: s._asdict(), r"^source: dict; allowed: Source"),
    "plain tuple": (lambda s: tuple(s), r"^source: tuple; allowed: Source"),
    "demonstrations": (lambda s: s._replace(demonstrations=tuple(s.demonstrations)), r"^source\.demonstrations: tuple"),
    "too few": (
        lambda s: s._replace(demonstrations=jax.tree.map(lambda leaf: leaf[..., :-1], s.demonstrations)),
        r"^source\.demonstrations\.state: 'shape \(106,\)'; allowed: shape \(107,\), .*config\.demonstrations",
    ),
    "one field": (
        lambda s: s._replace(demonstrations=s.demonstrations._replace(n_return=s.demonstrations.n_return[..., :5])),
        r"^source\.demonstrations\.n_return: 'shape \(5,\)'",
    ),
    "weights' names": (lambda s: s._replace(weights={"w": s.weights["params"]}), r"^source\.weights: "),
}


@pytest.mark.parametrize("case", BAD_SOURCES)
@pytest.mark.parametrize("learner", ["tlwd", "dpr", "ddqn"])
@pytest.mark.usefixtures("nothing_runs")
def test_sources_that_do_not_fit_are_refused_by_name(case, learner, params):
    spoil, message = BAD_SOURCES[case]
    settings = {"learner": learner, "config": CONFIG}
    with pytest.raises(ValueError, match=message):
        jrcjax.train(KEYS[0], params[1], source=spoil(good_source(params[1])), **settings)
    with pytest.raises(ValueError, match=message):
        jrcjax.train_agents(KEYS, params[1], source=spoil(good_source(params[1], agents=2)), **settings)


@pytest.mark.usefixtures("nothing_runs")
def test_weights_of_other_layers_are_refused_by_name(params):
    for hidden in [(8,), (9, 9), ()]:
        source = good_source(params[1], hidden=hidden)
        with pytest.raises(ValueError, match=r"^source\.weights: .*allowed: .*config\.hidden"):
            jrcjax.train(KEYS[0], params[1], learner="tlwd", config=CONFIG, source=source)


@pytest.mark.parametrize("agents", [None, 1, 3])
@pytest.mark.usefixtures("nothing_runs")
def test_one_source_for_each_key(agents, params):
    with pytest.raises(ValueError, match=r"^source: .*allowed: .*2 keys"):
        jrcjax.train_agents(
            KEYS, params[1], learner="tlwd", config=CONFIG, source=good_source(params[1], agents=agents)
        )


def with_three_roads(params):
    return params.replace(road=Factor(prior=(0.2, 0.3, 0.5), event_probability=(0.1, 0.2, 0.3)))


@pytest.mark.usefixtures("nothing_runs")
def test_environments_unlike_the_papers_need_a_source(params):
    for run, keys in ((jrcjax.train, KEYS[0]), (jrcjax.train_agents, KEYS)):
        with pytest.raises(ValueError, match=r"^source: 'None'; allowed: .*train_source"):
            run(keys, with_three_roads(params[1]), learner="tlwd", config=CONFIG)


@pytest.mark.usefixtures("nothing_runs")
def test_targets_with_other_factors_are_refused(params):
    source, target = params
    levels = r"levels \(2, {}, 2, 2, 2\) and 4 actions"
    for one, other, wrong, right in [
        (source, with_three_roads(target), 3, 2),
        (with_three_roads(source), target, 2, 3),
    ]:
        message = rf"^target_params: '{levels.format(wrong)}'; allowed: {levels.format(right)}"
        with pytest.raises(ValueError, match=message):
            run(KEYS[0], one, other)


@pytest.mark.parametrize("keys", [KEYS, KEYS[:0], 0, None], ids=str)
@pytest.mark.usefixtures("nothing_runs")
def test_what_is_not_one_key_is_refused(keys, params):
    with pytest.raises(ValueError, match=r"^key: .*allowed: one key"):
        run(keys, *params)


def test_old_style_keys_are_keys():
    require_keys(jax.random.PRNGKey(0), 0, "")
    require_keys(jnp.stack([jax.random.PRNGKey(0)] * 2), 1, "")
    with pytest.raises(ValueError, match=r"^key: "):
        require_keys(jax.random.PRNGKey(0), 1, "several")


@pytest.mark.usefixtures("nothing_runs")
def test_other_refusals_name_their_field(params):
    source, target = params
    bad = source.replace(reward_weights=jnp.asarray([1.0, -1.0, 1.0, 1.0]))
    full = dataclasses.replace(CONFIG, demonstrations=600)
    for arguments, settings, message in [
        ((bad, target), {}, "reward_weights"),
        ((source, bad), {}, "reward_weights"),
        ((source, {}), {}, r"^params: .*dict.*EnvParams"),
        ((source, target, HParams(margin=jnp.float32(-1.0))), {}, r"^hparams\.margin: "),
        ((source, target), {"config": dataclasses.replace(CONFIG, n_step=0)}, r"^config\.n_step: "),
        ((source, target), {"config": full}, r"^config\.demonstrations: 600; allowed: .*600"),
        ((source, target), {"learners": ("ddqn", "dqn")}, r"^learner: 'dqn' is unknown; allowed: .*'tlwd'"),
    ]:
        with pytest.raises(ValueError, match=message):
            jrcjax.transfer(KEYS[0], *arguments, **({"config": CONFIG} | settings))


def test_a_source_has_the_documented_fields(study):
    assert isinstance(study.source, Source)
    assert {leaf.shape for leaf in study.source.demonstrations} == {(CONFIG.demonstrations,)}
