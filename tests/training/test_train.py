"""The training loop: a naive twin of it, purity, vmap over everything, chunks, and one trace per shape."""

import functools
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from sources import random_source

import jrcjax
from jrcjax.learners import LEARNERS
from jrcjax.learners.base import Learner
from jrcjax.learners.fixed import FIXED, FixedState
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model import metrics, slot
from jrcjax.replay.uniform import Transition
from jrcjax.training import rollout

SLOTS = 20
# More than 8 units, whose sums are no longer written out: that takes a tenth longer to compile.
SMALL = Config(
    episodes=3, batch_size=8, replay_capacity=64, demonstrations=24, pretraining=5, n_step=4, hidden=(9,)
)  # fmt: skip
FIELDS = jrcjax.Log._fields


@pytest.fixture(scope="module")
def params(environments):
    """The target with short episodes."""
    return environments["short-target"]


@pytest.fixture(scope="module")
def source(params):
    """What learners that transfer take over."""
    return random_source(rollout.spec_of(params), SMALL)


def hparams_of(**numbers: float) -> HParams:
    """Few slots of exploration unless told otherwise, so that what was learned shows."""
    return HParams(**{name: jnp.float32(number) for name, number in ({"epsilon_slots": 30.0} | numbers).items()})


@functools.cache
def compiled(learner, config):
    return jax.jit(
        lambda key, env, hparams, source: jrcjax.train(key, env, hparams, learner=learner, config=config, source=source)
    )


def trained(learner, config=SMALL, source=None):
    return lambda key, env, hparams: compiled(learner, config)(key, env, hparams, source)


def assert_same(got, wanted):
    """Bit for bit, also for keys."""
    bits = lambda tree: [  # noqa: E731
        jax.random.key_data(x) if jnp.issubdtype(x.dtype, jax.dtypes.prng_key) else x for x in jax.tree.leaves(tree)
    ]
    for g, w in zip(bits(got), bits(wanted), strict=True):
        np.testing.assert_array_equal(g, w)


def assert_close(got, wanted):
    """To float32 rounding of sums over an episode."""
    for g, w in zip(jax.tree.leaves(got), jax.tree.leaves(wanted), strict=True):
        np.testing.assert_allclose(g, w, rtol=1e-5, atol=1e-6)


# --- What comes out ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("learner", LEARNERS)
def test_log_has_one_finite_number_per_episode(learner, params, source):
    state, log = trained(learner, source=source)(jax.random.key(0), params, hparams_of())
    assert FIELDS[:3] == ("reward", "throughput", "miss_detection")
    assert not log.diverged.any()
    for field in log:
        assert field.shape == (SMALL.episodes,)
        assert field.dtype == (jnp.bool_ if field is log.diverged else jnp.float32)
        assert np.isfinite(field).all()
    assert jax.random.key_data(state.key).tolist() == jax.random.key_data(jax.random.key(0)).tolist()


@pytest.mark.parametrize("learner", LEARNERS)
def test_same_key_same_numbers_and_other_key_other_numbers(learner, params, source):
    train = trained(learner, source=source)
    first, second, other = (train(jax.random.key(seed), params, hparams_of()) for seed in (1, 1, 2))
    assert_same(first, second)
    assert not np.array_equal(first[1].reward, other[1].reward)


def test_defaults_stand_for_missing_arguments(params):
    short = Config(episodes=1)
    jitted = jax.jit(lambda key, **more: jrcjax.train(key, params, learner="q_learning", config=short, **more))
    assert_same(jitted(jax.random.key(0)), jitted(jax.random.key(0), hparams=HParams()))


@pytest.mark.parametrize("learner", LEARNERS)
def test_nothing_is_weakly_typed_or_wider_than_32_bits(learner, params, source):
    shapes = jax.eval_shape(trained(learner, source=source), jax.random.key(0), params, hparams_of())
    for leaf in jax.tree.leaves(shapes):
        assert not leaf.weak_type
        assert leaf.dtype in (jnp.float32, jnp.int32, jnp.uint32, jnp.bool_) or jnp.issubdtype(
            leaf.dtype, jax.dtypes.prng_key
        )


@pytest.mark.parametrize("learner", LEARNERS)
def test_no_implicit_changes_of_rank_or_type(learner, params, source):
    config = replace(SMALL, optimiser="sgd")  # optax's Adam does make some
    with jax.numpy_rank_promotion("raise"), jax.numpy_dtype_promotion("strict"):
        jax.eval_shape(trained(learner, config, source), jax.random.key(0), params, hparams_of())


# --- A naive twin of the whole loop -----------------------------------------------------------------------------------


def words_of_episode(key, episode: int, num_words: int) -> np.ndarray:
    """The documented stream: the agent's key folded with purpose 1, then with the episode."""
    key = jax.random.fold_in(jax.random.fold_in(key, 1), episode)
    return np.asarray(jax.random.bits(key, (SLOTS + 1, num_words), jnp.uint32))


def naive_q_learning(key, params, num_episodes: int, epsilon_slots: float) -> dict[str, list[float]]:
    """Q-learning in plain Python; only what happens in one slot is the package's."""
    run_slot = jax.jit(slot.run_slot)
    q, visits = np.zeros((params.num_states, 4)), np.zeros((params.num_states, 4), int)
    log = {"reward": [], "throughput": [], "miss_detection": []}
    for episode in range(num_episodes):
        words = words_of_episode(key, episode, slot.NUM_WORDS + 2)
        state = int(slot.initial_state(jnp.asarray(words[SLOTS, : slot.NUM_WORDS]), params))
        first, outcomes = state, []
        for i in range(SLOTS):
            epsilon = 1 - 0.99 * min((episode * SLOTS + i) / epsilon_slots, 1)
            explores = (int(words[i, -2]) >> 8) / 2**24 < epsilon
            action = (int(words[i, -1]) * 4) >> 32 if explores else int(q[state].argmax())
            of_slot = words[i, : slot.NUM_WORDS]
            outcome = run_slot(of_slot, jnp.int32(state), jnp.int32(action), params, jnp.int32(first))
            outcomes.append(outcome)
            reward, following = float(outcome.reward), int(outcome.next_state)
            visits[state, action] += 1
            step = visits[state, action] ** -0.7
            q[state, action] += step * (reward + 0.99 * q[following].max() - q[state, action])
            state = following
        log["reward"].append(np.mean([o.reward for o in outcomes]))
        log["throughput"].append(np.sum([o.packets for o in outcomes]))
        log["miss_detection"].append(np.mean([o.miss_ratio for o in outcomes]))
    return log | {"q": q, "visits": visits}


@pytest.mark.parametrize("reading", ["current", "episode_start"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_q_learning_against_a_plain_loop(params, seed, reading):
    params = params.replace(reward_state=reading)
    key = jax.random.key(seed)
    state, log = trained("q_learning", Config(episodes=6))(key, params, hparams_of(epsilon_slots=60.0))
    twin = naive_q_learning(key, params, 6, 60.0)
    np.testing.assert_array_equal(state.learner.visits, twin["visits"])
    # 120 updates of numbers up to 100, in float32 and in double precision.
    np.testing.assert_allclose(state.learner.q, twin["q"], rtol=0, atol=120 * 3 * 6e-8 * 100)
    for name in ("reward", "throughput", "miss_detection"):
        np.testing.assert_allclose(getattr(log, name), twin[name], rtol=1e-5, atol=1e-5)


def test_policies_earn_what_they_are_worth_whatever_state_decides(params):
    """A policy is simulated in the environment in which it is judged."""
    policy = jrcjax.exact.optimal_policy(params)
    agent = rollout.AgentState(jax.random.key(8), FixedState(policy, jnp.float32(0)))
    run = jax.jit(lambda env: rollout.run_episodes(agent, 0, 4000, env, HParams(), FIXED)[1])
    worth = []
    for reading in ("current", "episode_start"):
        log = run(params.replace(reward_state=reading))
        sample, exact = np.asarray(log.reward), float(log.policy_reward[0])
        error = sample.std() / np.sqrt(len(sample))
        assert abs(sample.mean() - exact) < 4 * error
        worth.append(exact)
    assert worth[0] - worth[1] > 20 * error  # so a simulation of the other reading would show


@pytest.mark.parametrize("learner", LEARNERS)
def test_final_policy_is_the_one_that_the_log_evaluates(learner, params, source):
    state, log = trained(learner, source=source)(jax.random.key(0), params, hparams_of())
    policy = rollout.learner_for(learner, params, SMALL).policy(state.learner)
    assert policy.shape == (params.num_states, params.num_actions)
    np.testing.assert_allclose(policy.sum(axis=1), 1, rtol=1e-6)
    assert_close(tuple(field[-1] for field in log[3:6]), tuple(jrcjax.exact.evaluate_policy(params, policy)))


# --- vmap -------------------------------------------------------------------------------------------------------------


def with_events(params, event_probability):
    """The environment with other events at high speed."""
    speed = params.speed.replace(event_probability=jnp.stack([params.speed.event_probability[0], event_probability]))
    return params.replace(speed=speed)


KEYS = jax.random.split(jax.random.key(11), 3)
DENSITIES, EVENTS = jnp.asarray([5.0, 10.0, 20.0]), jnp.asarray([0.1, 0.5, 0.9])
RATES, EPSILON_SLOTS = jnp.asarray([1e-4, 1e-3, 1e-2]), jnp.asarray([10.0, 30.0, 100.0])


@pytest.mark.parametrize(
    ("learner", "over"),
    [
        ("round_robin", (0, 1)),
        ("q_learning", (0, 1, 2, 3)),
        ("ddqn", (0,)),
        ("ddqn", (1,)),
        ("ddqn", (2, 3)),
        ("ddqn", (0, 1, 2, 3)),
    ],
)
@pytest.mark.slow
def test_vmap_is_one_call_after_the_other(learner, over, params):
    """Over key, environment and hyperparameters, alone and together."""

    def run(key, event_probability, rate, epsilon_slots):
        hparams = HParams(learning_rate=rate, epsilon_slots=epsilon_slots, step_constant=rate)
        return jrcjax.train(key, with_events(params, event_probability), hparams, learner=learner, config=SMALL)[1]

    values = (KEYS, EVENTS, RATES, EPSILON_SLOTS)
    arguments = [value if i in over else value[1] for i, value in enumerate(values)]
    axes = [0 if i in over else None for i in range(4)]
    together = jax.jit(jax.vmap(run, in_axes=axes))(*arguments)
    one = jax.jit(run)
    for i in range(3):
        single = one(*(value[i] if axis == 0 else value for value, axis in zip(arguments, axes, strict=True)))
        assert_close(jax.tree.map(lambda a, i=i: a[i], together), single)
    assert len(np.unique(np.asarray(together.reward), axis=0)) == 3


@pytest.mark.slow
def test_vmap_over_the_density_of_objects(params):
    """Banks of placements built inside the program are those built outside it, and so are the logs."""

    def run(key, density):
        env = params.replace(radar=params.radar.replace(density=density))
        return env.radar.miss_bank, jrcjax.train(key, env, hparams_of(), learner="q_learning", config=SMALL)[1]

    banks, logs = jax.jit(jax.vmap(run))(KEYS, DENSITIES)
    for i in range(3):
        env = params.replace(radar=params.radar.replace(density=DENSITIES[i]))
        np.testing.assert_allclose(banks[i], env.radar.miss_bank, atol=1e-6)
        alone = trained("q_learning")(KEYS[i], env, hparams_of())[1]
        assert_close(jax.tree.map(lambda a, i=i: a[i], logs), alone)
    misses = np.asarray(banks).mean(axis=2)
    assert (np.diff(misses, axis=0) > 0).all()  # more objects hide more of each other


# --- Chunks, key streams and traces -----------------------------------------------------------------------------------


@pytest.mark.parametrize("learner", sorted(LEARNERS.keys() - {"dpr"}))  # which only starts unlike ddqn
def test_chunks_of_episodes_are_one_run(learner, params, source):
    config, hparams = replace(SMALL, episodes=7), hparams_of()
    hparams = hparams.replace(target_period=jnp.int32(33))  # copies fall inside chunks and across their borders
    rule = rollout.learner_for(learner, params, config)
    whole_state, whole = trained(learner, config, source)(jax.random.key(4), params, hparams)
    run = jax.jit(
        lambda agent, first, number, env, hparams: rollout.run_episodes(agent, first, number, env, hparams, rule),
        static_argnums=2,
    )
    agent = jax.jit(lambda key, hparams: rollout.init_agent(key, hparams, rule, source))(jax.random.key(4), hparams)
    first, logs = 0, []
    for number in (3, 1, 3):
        agent, log = run(agent, first, number, params, hparams)
        first += number
        logs.append(log)
    parts = jrcjax.Log(*(jnp.concatenate(field) for field in zip(*logs, strict=True)))
    assert_same(agent, whole_state)
    assert_same(parts[:3], whole[:3])
    # A scan over one episode is compiled without a loop, and the policy's exact sums may be rounded otherwise.
    assert_close(parts[3:], whole[3:])


def test_more_episodes_do_not_change_the_first_ones(params):
    logs = [
        trained("ddqn", replace(SMALL, episodes=number))(jax.random.key(0), params, hparams_of())[1]
        for number in (2, 5)
    ]
    assert_same(logs[0], jax.tree.map(lambda a: a[:2], logs[1]))


@pytest.mark.parametrize("learner", ["ddqn", "tlwd"])
def test_traced_once_for_all_numbers_of_one_shape(learner, params, source):
    traces = []

    def counting(spec, config):
        traces.append(spec)
        return LEARNERS[learner](spec, config)

    trace = compiled(counting, SMALL).trace
    trace(jax.random.key(0), params, hparams_of(), source)
    other = hparams_of(learning_rate=0.1, epsilon_slots=7.0, discount=0.5, priority_exponent=0.0, margin=2.0)
    trace(jax.random.key(1), params, other, source)
    harder = with_events(params, jnp.float32(0.9))
    harder = harder.replace(event_model=jnp.int32(1), terminal_time_limit=jnp.int32(1))
    trace(jax.random.key(2), harder, hparams_of(), source)
    assert len(traces) == 1
    trace(jax.random.key(0), params.replace(max_steps_in_episode=5), hparams_of(), source)  # another shape
    assert len(traces) == 2


# --- The time limit ---------------------------------------------------------------------------------------------------


def recorder(slots: int):
    """A learner that takes random actions and keeps every transition."""

    def factory(spec, config) -> Learner:
        base = LEARNERS["q_learning"](spec, config)
        integers = jnp.zeros(slots, jnp.int32)
        empty = Transition(integers, integers, jnp.zeros(slots), integers, jnp.zeros(slots))
        return Learner(
            num_words=2,
            init=lambda key, hparams, source: empty,
            act=lambda state, state_id, number, words, hparams: (words[1] % 4).astype(jnp.int32),
            update=lambda state, transition, number, words, hparams: jax.tree.map(
                lambda kept, new: kept.at[number].set(new), state, transition
            ),
            policy=lambda state: base.policy(base.init(jax.random.key(0), None)),
        )

    return factory


def test_time_limit_ends_the_problem_only_if_asked_and_only_in_the_last_slot(params):
    train = trained(recorder(3 * SLOTS))
    runs = [
        train(jax.random.key(0), params.replace(terminal_time_limit=jnp.int32(limit)), hparams_of()) for limit in (0, 1)
    ]
    truncated, ended = (state.learner for state, _ in runs)
    gamma = np.float32(0.99)
    np.testing.assert_array_equal(truncated.discount, [gamma] * 3 * SLOTS)
    np.testing.assert_array_equal(ended.discount, ([gamma] * (SLOTS - 1) + [0.0]) * 3)
    assert_same(truncated._replace(discount=ended.discount), ended)
    assert_same(runs[0][1], runs[1][1])


def test_transitions_follow_each_other_within_an_episode_and_start_anew_after_it(params):
    state, log = trained(recorder(3 * SLOTS))(jax.random.key(0), params, hparams_of())
    kept = state.learner
    starts = np.arange(0, 3 * SLOTS, SLOTS)
    inside = np.setdiff1d(np.arange(1, 3 * SLOTS), starts)
    np.testing.assert_array_equal(kept.state[inside], kept.next_state[inside - 1])
    for episode, start in enumerate(starts):
        first = words_of_episode(jax.random.key(0), episode, slot.NUM_WORDS + 2)[SLOTS, : slot.NUM_WORDS]
        assert kept.state[start] == slot.initial_state(jnp.asarray(first), params)
    np.testing.assert_allclose(np.asarray(kept.reward).reshape(3, SLOTS).mean(axis=1), log.reward, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize(("limit", "bootstraps"), [(0, True), (1, False)])
def test_learners_bootstrap_through_the_limit_unless_it_is_terminal(params, limit, bootstraps):
    """One slot an episode: with a terminal limit a value is a mean of rewards, which lie within [-100, 50]."""
    single = params.replace(max_steps_in_episode=1, terminal_time_limit=jnp.int32(limit))
    hparams = hparams_of(epsilon_end=1.0, epsilon_slots=1.0, step_constant=0.5)
    state, _ = trained("q_learning", Config(episodes=20_000))(jax.random.key(0), single, hparams)
    # A hundred times the optimum of about 5 a slot is far above any single reward.
    assert (float(state.learner.q.max()) > 50.0) == bootstraps


# --- Metrics ----------------------------------------------------------------------------------------------------------


def test_an_episode_in_which_no_slot_counts_has_no_miss_detection(params):
    """Without events and with misses counted in event slots only."""
    calm = {
        name: getattr(params, name).replace(event_probability=jnp.zeros(2))
        for name in ("road", "weather", "speed", "nearby")
    }
    params = params.replace(**calm, miss_convention=jnp.int32(1))
    _, log = trained("round_robin")(jax.random.key(0), params, hparams_of())
    assert np.isnan(log.miss_detection).all()
    assert np.isfinite(log.reward).all()
    assert np.isnan(metrics.miss_detection(metrics.zero()))
