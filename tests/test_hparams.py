"""Hyperparameters and settings: Table I's numbers, and refusals that name the field."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jrcjax
from jrcjax.hparams import OPTIMISERS, Config, HParams, check_config, check_hparams, optimiser_of

BELOW_0 = st.floats(-1e6, -1e-6)
ABOVE_1 = st.floats(1.001, 1e6)
NO_NUMBERS = st.sampled_from([float("nan"), float("inf"), -float("inf"), "0.5", None, [0.1, 0.2], np.ones(1)])
OUTSIDE = {
    "discount": st.one_of(BELOW_0, st.floats(1.0, 1e6), NO_NUMBERS),
    "epsilon_start": st.one_of(BELOW_0, ABOVE_1, NO_NUMBERS),
    "epsilon_end": st.one_of(BELOW_0, ABOVE_1, NO_NUMBERS),
    "epsilon_slots": st.one_of(BELOW_0, st.just(0.0), NO_NUMBERS),
    "learning_rate": st.one_of(BELOW_0, st.just(0.0), NO_NUMBERS),
    "target_period": st.one_of(st.integers(-(10**6), 0), st.floats(1.1, 1.9), NO_NUMBERS),
    "step_exponent": st.one_of(st.floats(-10, 0.5), ABOVE_1, NO_NUMBERS),
    "step_constant": st.one_of(BELOW_0, ABOVE_1, NO_NUMBERS),
}
TOO_FEW, TOO_MANY = st.integers(-100, 0), st.integers(2**31, 2**40)
NO_COUNTS = st.one_of(TOO_FEW, TOO_MANY, st.floats(1, 10), st.sampled_from([True, "3", None]))
BAD_SETTINGS = {
    "episodes": NO_COUNTS,
    "batch_size": NO_COUNTS,
    "replay_capacity": NO_COUNTS,
    "hidden": st.sampled_from([24, [24, 24], (24, 0), (24, -1), (24.0,), ("24",), None]),
    "optimiser": st.sampled_from(["Adam", "", "adamw", None, 3, lambda: None]),
    "form": st.sampled_from(["Table", "", "row", None, 1]),
}


def refuses_to_compile(spec, config):
    raise AssertionError("checks come before the learner is made")


def train(hparams=None, config=None, learner=refuses_to_compile):
    return jrcjax.train(jax.random.key(0), jrcjax.paper_params("target"), hparams, learner=learner, config=config)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(data=st.data())
@pytest.mark.parametrize("field", OUTSIDE)
def test_bad_hyperparameters_are_refused_by_name(field, data):
    hparams = HParams(**{field: data.draw(OUTSIDE[field])})
    with pytest.raises(ValueError, match=rf"^hparams\.{field}: .*allowed: "):
        train(hparams)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(data=st.data())
@pytest.mark.parametrize("field", BAD_SETTINGS)
def test_bad_settings_are_refused_by_name(field, data):
    config = Config(**{field: data.draw(BAD_SETTINGS[field])})
    with pytest.raises(ValueError, match=rf"^config\.{field}: .*allowed: "):
        train(config=config)


def test_the_refusals_cover_all_fields():
    assert OUTSIDE.keys() == {field.name for field in dataclasses.fields(HParams)}
    assert BAD_SETTINGS.keys() == {field.name for field in dataclasses.fields(Config)}


@settings(max_examples=50, deadline=None, derandomize=True)
@given(
    discount=st.floats(0, 0.999),
    epsilons=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    slots=st.floats(1e-3, 1e9),
    rate=st.floats(1e-9, 10),
    period=st.integers(1, 10**6),
    exponent=st.floats(0.501, 1),
    constant=st.floats(0, 1),
)
def test_good_hyperparameters_are_accepted(discount, epsilons, slots, rate, period, exponent, constant):
    check_hparams(HParams(discount, *epsilons, slots, rate, period, exponent, constant))
    as_float = [jnp.float32(x) for x in (discount, *epsilons, slots, rate)]
    check_hparams(HParams(*as_float, jnp.int32(period), jnp.float32(exponent), jnp.float32(constant)))


CLIPPED = optax.chain(optax.clip(1.0), optax.scale_by_adam())


@pytest.mark.parametrize("optimiser", [*OPTIMISERS, optax.identity(), CLIPPED])
def test_good_settings_are_accepted(optimiser):
    check_config(Config(episodes=1, batch_size=1, replay_capacity=1, hidden=(), optimiser=optimiser, form="rows"))


def test_other_types_are_refused():
    with pytest.raises(ValueError, match=r"^hparams: dict; allowed: HParams"):
        train({"discount": 0.9})
    with pytest.raises(ValueError, match=r"^config: dict; allowed: Config"):
        train(config={"episodes": 3})


@pytest.mark.parametrize("name", ["dqn", "DDQN", ""])
def test_unknown_learners_are_refused_with_the_known_ones(name):
    with pytest.raises(ValueError, match="learner") as refusal:
        train(learner=name)
    assert all(repr(known) in str(refusal.value) for known in ("round_robin", "q_learning", "ddqn", name))


def test_bad_environments_are_refused_before_anything_is_made():
    with pytest.raises(ValueError, match=r"^params: .*dict.*EnvParams"):
        jrcjax.train(jax.random.key(0), {}, learner=refuses_to_compile)
    params = jrcjax.paper_params("target").replace(reward_weights=jnp.asarray([1.0, -1.0, 1.0, 1.0]))
    with pytest.raises(ValueError, match="reward_weights"):
        jrcjax.train(jax.random.key(0), params, learner=refuses_to_compile)


def test_traced_numbers_are_not_refused_and_their_shapes_are():
    jax.jit(check_hparams)(HParams(discount=jnp.float32(2.0)))
    with pytest.raises(ValueError, match=r"^hparams\.discount: 'shape \(2,\)'"):
        jax.jit(check_hparams)(HParams(discount=jnp.ones(2)))


def test_defaults_are_table_1():
    hparams, config = HParams(), Config()
    wanted = {
        "discount": 0.99, "epsilon_start": 1.0, "epsilon_end": 0.01, "epsilon_slots": 30_000, "target_period": 300,
        "learning_rate": 1e-3, "step_exponent": 0.7, "step_constant": 0.0,
    }  # fmt: skip
    for name, number in wanted.items():
        assert float(getattr(hparams, name)) == float(np.float32(number))
    assert all(leaf.shape == () for leaf in jax.tree.leaves(hparams))
    assert len(jax.tree.leaves(hparams)) == len(wanted)
    assert (config.episodes, config.batch_size, config.replay_capacity, config.hidden) == (1000, 64, 50_000, (24, 24))
    assert (config.optimiser, config.form) == ("adam", "auto")


def test_named_optimisers_take_their_rate_from_the_hyperparameters():
    gradient = jnp.asarray([3.0, -0.5])
    for name, wanted in [("sgd", gradient), ("adam", jnp.sign(gradient))]:
        optimiser = optimiser_of(Config(optimiser=name))
        hparams = HParams(learning_rate=jnp.float32(0.25))
        with jax.numpy_dtype_promotion("standard"):  # optax mixes floats with integer counts
            step, _ = optimiser.step(gradient, optimiser.init(gradient), gradient, hparams)
        # 1 - 0.999 in float32 is off by 1.3e-5 of itself, of which Adam takes the root.
        np.testing.assert_allclose(step, -0.25 * wanted, rtol=1e-5)


def test_an_optimiser_of_ones_own_brings_its_rate():
    gradient = jnp.asarray([3.0, -0.5])
    optimiser = optimiser_of(Config(optimiser=optax.sgd(0.125)))
    step, _ = optimiser.step(gradient, optimiser.init(gradient), gradient, HParams(learning_rate=jnp.float32(9.0)))
    np.testing.assert_array_equal(step, -0.125 * gradient)
