"""Tables against the model's slot: the same outcome for the same words, and the same law over its random words."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from significance import ALPHA, chi_square, same_law
from tiny import tiny_params

import jrcjax
from jrcjax.adapters.slots import JaxSlots, TableSlots, slots_of
from jrcjax.adapters.tables import MOST_STATES, fit, tables_of
from jrcjax.model import slot
from jrcjax.model.params import Factor

_run_slots = jax.jit(jax.vmap(slot.run_slot, in_axes=(1, 0, 0, None, 0)))
first_states = jax.jit(jax.vmap(slot.initial_state, in_axes=(1, None)))


def random_slots(params, number, seed=0):
    """Words [NUM_WORDS, N], states [N] and actions [N]; some words are at the edge of what changes an outcome."""
    generator = np.random.default_rng(seed)
    words = generator.integers(2**32, size=(slot.NUM_WORDS, number), dtype=np.uint32)
    words[:, ::5] = edges(params)[generator.integers(len(edges(params)), size=words[:, ::5].shape)]
    return (
        words,
        generator.integers(params.num_states, size=number),
        generator.integers(params.num_actions, size=number),
    )


def edges(params):
    """Words just below, at and above every probability of the model, and the smallest and largest."""
    with jax.ensure_compile_time_eval():
        of_events = np.asarray(jrcjax.events.event_probability(params), np.float64)
    chances = [of_events]
    for factor in params.factors:
        kappa, upto = float(factor.persistence), np.cumsum(np.asarray(factor.prior, np.float64))
        chances += [[kappa], upto, kappa + (1 - kappa) * upto]
    numbers = np.concatenate(chances) * 2**24
    near = np.floor(numbers[:, None] + np.arange(-2, 4)).clip(0, 2**24 - 1).ravel()
    return np.unique(np.append(near, [0, 2**24 - 1]).astype(np.uint32) << 8)


def assert_equal(got, wanted):
    for name in got._fields:
        np.testing.assert_array_equal(getattr(got, name), getattr(wanted, name), err_msg=name)


def run_slots(words, state, action, first, params):
    state, action, first = (ids.astype(np.int32) for ids in (state, action, first))
    return _run_slots(words, state, action, params, first)


def assert_tables_are_the_model(params):
    slots = slots_of(params)
    assert isinstance(slots, TableSlots)
    words, state, action = random_slots(params, 20_000)
    first = slots.first_states(words)
    got = slots.run(words, state, action, first)
    wanted = run_slots(words, state, action, first, params)
    assert_equal(got, wanted)
    np.testing.assert_array_equal(first, first_states(words, params))
    rows = words.T.tolist()
    for i in range(1000):
        one = slots.run_one(rows[i], int(state[i]), int(action[i]), int(first[i]))
        assert one == tuple(column[i].item() for column in got)
        assert [type(number) for number in one] == [int, float, bool, float, float]
        assert slots.first_state(rows[i]) == first[i]
    features = jax.vmap(lambda s: jrcjax.JRCEnv().get_obs(jrcjax.EnvState(s, jnp.int32(0), s), params))(
        jnp.asarray(first)
    )
    np.testing.assert_array_equal(slots.features(first), features)


def test_tables_are_the_model(any_params):
    """Bit for bit: every environment and preset of the paper, and random ones, some of which persist."""
    assert_tables_are_the_model(any_params)


@pytest.mark.parametrize(
    "reading", [{"event_model": i} for i in range(3)] + [{"reward_state": "episode_start"}], ids=str
)
def test_tables_are_the_model_in_every_reading_of_events(reading):
    params = tiny_params()
    # A level that is never drawn, and one with an event for sure.
    speed = Factor(prior=[0.0, 0.25, 0.75], event_probability=[0.2, 0.0, 1.0], persistence=0.9)
    assert_tables_are_the_model(params.replace(speed=speed, **reading))


def test_the_law_of_transitions_and_events():
    """Counts of an independent stream of words against the exact transitions and event probabilities."""
    params = tiny_params()
    states, number = params.num_states, 400_000
    generator = np.random.default_rng(1)
    words = generator.integers(2**32, size=(slot.NUM_WORDS, number), dtype=np.uint32)
    state, action = generator.integers(states, size=number), generator.integers(params.num_actions, size=number)
    outcome = slots_of(params).run(words, state, action, state)
    counts = np.zeros((states, states))
    np.add.at(counts, (state, outcome.next_state), 1)
    assert chi_square(counts, np.asarray(jrcjax.exact.state_transition(params))) > ALPHA
    chance = np.asarray(jrcjax.events.event_probability(params))
    events = np.stack([np.bincount(state[outcome.event == given], minlength=states) for given in (True, False)], axis=1)
    assert chi_square(events, np.stack([chance, 1 - chance], axis=1)) > ALPHA
    first = np.bincount(slots_of(params).first_states(words), minlength=states)
    assert chi_square(first, np.asarray(jrcjax.exact.stationary_distribution(params))) > ALPHA


def test_the_law_of_rewards_is_the_models():
    """Other words than the model's, and rewards of the same law: packets, events and miss ratios of the bank."""
    params, number = tiny_params(), 200_000
    ours, models = (random_words(seed, number) for seed in (2, 3))
    state, action = np.arange(number) % params.num_states, np.arange(number) // params.num_states % params.num_actions
    got = slots_of(params).run(ours, state, action, state).reward
    wanted = np.asarray(run_slots(models, state, action, state, params).reward)
    values = np.unique(np.concatenate([got, wanted]))
    counts = [np.bincount(np.searchsorted(values, rewards), minlength=len(values)) for rewards in (got, wanted)]
    assert len(values) > 5
    assert same_law(*counts) > ALPHA


def random_words(seed, number):
    return np.random.default_rng(seed).integers(2**32, size=(slot.NUM_WORDS, number), dtype=np.uint32)


def test_fresh_placements_come_from_the_model():
    params = tiny_params()
    fresh = params.replace(radar=params.radar.replace(placements="fresh", count_model=jnp.int32(1)))
    slots = slots_of(fresh)
    assert isinstance(slots, JaxSlots)
    words, state, action = random_slots(params, 64)
    got = slots.run(words, state, action, state)
    wanted = run_slots(words, state, action, state, fresh)
    assert_equal(got, wanted)
    tables = slots_of(params)
    assert isinstance(tables, TableSlots)
    assert set(got.miss_ratio) - set(tables.tables.miss_ratio)  # Poisson counts, so none of the bank's
    one = slots.run_one(words[:, 3].tolist(), int(state[3]), int(action[3]), int(state[3]))
    assert one == tuple(column[3].item() for column in got)
    assert slots.first_state(words[:, 3].tolist()) == slots.first_states(words)[3]
    np.testing.assert_array_equal(slots.features(state), slots_of(params).features(state))


def test_states_that_no_table_holds():
    levels = Factor(prior=np.full(100, 0.01), event_probability=np.linspace(0.0, 0.1, 100))
    params = tiny_params().replace(road=levels, weather=levels, speed=levels)
    assert params.num_states > MOST_STATES
    assert not fit(params)
    slots = slots_of(params)
    state = slots.first_state([2**31] * slot.NUM_WORDS)
    assert 0 <= slots.run_one([2**31] * slot.NUM_WORDS, state, 0, state).next_state < params.num_states
    assert slots.features(state).shape == (5,)


def test_equal_parameters_share_their_tables():
    params = tiny_params()
    again = jax.tree.map(np.asarray, params)
    assert slots_of(params) is slots_of(again)
    other = params.replace(reward_weights=2 * params.reward_weights)
    assert slots_of(other) is not slots_of(params)
    np.testing.assert_array_equal(tables_of(other).reward, 2 * tables_of(params).reward)
    with pytest.raises(ValueError, match="event_model: 7; allowed"):
        slots_of(params.replace(event_model=jnp.int32(7)))
    with pytest.raises(ValueError, match="params: dict; allowed: EnvParams"):
        slots_of({})
