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
from jrcjax.learners import LEARNERS, Spec
from jrcjax.learners.hparams import OPTIMISERS, Config, HParams, check_config, check_hparams, optimiser_of
from jrcjax.types import INITIAL_WEIGHTS

BELOW_0 = st.floats(-1e6, -1e-6)
ABOVE_1 = st.floats(1.001, 1e6)
NO_NUMBERS = st.sampled_from([float("nan"), float("inf"), -float("inf"), "0.5", None, [0.1, 0.2], np.ones(1)])
NO_SHARE = st.one_of(BELOW_0, ABOVE_1, NO_NUMBERS)
NOT_POSITIVE = st.one_of(BELOW_0, st.just(0.0), NO_NUMBERS)
NO_PRIORITY = st.one_of(NOT_POSITIVE, st.floats(1e-40, 0.9e-30))  # beside which powers and their sums vanish
NEGATIVE = st.one_of(BELOW_0, NO_NUMBERS)
OUTSIDE = {
    "discount": st.one_of(BELOW_0, st.floats(1.0, 1e6), NO_NUMBERS),
    "epsilon_start": NO_SHARE,
    "epsilon_end": NO_SHARE,
    "epsilon_slots": NOT_POSITIVE,
    "learning_rate": NOT_POSITIVE,
    "target_period": st.one_of(st.integers(-(10**6), 0), st.floats(1.1, 1.9), NO_NUMBERS),
    "step_exponent": st.one_of(st.floats(-10, 0.5), ABOVE_1, NO_NUMBERS),
    "step_constant": NO_SHARE,
    "priority_exponent": NO_SHARE,
    "priority_constant": NO_PRIORITY,
    "demonstration_constant": NO_PRIORITY,
    "importance_start": NO_SHARE,
    "importance_end": NO_SHARE,
    "n_step_weight": NEGATIVE,
    "margin_weight": NEGATIVE,
    "l2_weight": NEGATIVE,
    "margin": NEGATIVE,
    "demonstration_epsilon": NO_SHARE,
    "initial_weights": st.one_of(st.integers(-(10**6), -1), st.integers(2, 10**6), st.sampled_from([0.0, True, "0"])),
}
TOO_FEW, TOO_MANY = st.integers(-100, 0), st.integers(2**31, 2**40)
NO_COUNTS = st.one_of(TOO_FEW, TOO_MANY, st.floats(1, 10), st.sampled_from([True, "3", None]))
BAD_SETTINGS = {
    "episodes": NO_COUNTS,
    "batch_size": NO_COUNTS,
    "replay_capacity": NO_COUNTS,
    "demonstrations": NO_COUNTS,
    "pretraining": st.one_of(st.integers(-100, -1), TOO_MANY, st.floats(1, 10), st.sampled_from([True, "3", None])),
    "n_step": NO_COUNTS,
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
    alpha=st.floats(0, 1),
    constants=st.tuples(st.floats(1e-9, 1e6), st.floats(1e-9, 1e6)),
    betas=st.tuples(st.floats(0, 1), st.floats(0, 1)),
    weights=st.tuples(*[st.floats(0, 1e6)] * 4),
    share=st.floats(0, 1),
    start=st.sampled_from(range(len(INITIAL_WEIGHTS))),
)
def test_good_hyperparameters_are_accepted(
    discount, epsilons, slots, rate, period, exponent, constant, alpha, constants, betas, weights, share, start
):
    first, later = (discount, *epsilons, slots, rate), (exponent, constant, alpha, *constants, *betas, *weights, share)
    check_hparams(HParams(*first, period, *later, start))
    first, later = ([jnp.float32(x) for x in numbers] for numbers in (first, later))
    check_hparams(HParams(*first, jnp.int32(period), *later, jnp.int32(start)))


CLIPPED = optax.chain(optax.clip(1.0), optax.scale_by_adam())


@pytest.mark.parametrize("optimiser", [*OPTIMISERS, optax.identity(), CLIPPED])
def test_good_settings_are_accepted(optimiser):
    ones = {"episodes": 1, "batch_size": 1, "replay_capacity": 1, "demonstrations": 1, "pretraining": 0, "n_step": 1}
    check_config(Config(**ones, hidden=(), optimiser=optimiser, form="rows"))


@pytest.mark.parametrize("run", [jrcjax.train, jrcjax.train_agents])
@pytest.mark.parametrize("demonstrations", [50, 51])
def test_a_memory_has_room_for_more_than_demonstrations(run, demonstrations):
    """For the learner that puts them there, and for no other."""
    config = Config(episodes=1, batch_size=1, replay_capacity=50, demonstrations=demonstrations)
    keys = jax.random.split(jax.random.key(0), 2)
    with pytest.raises(ValueError, match=rf"^config\.demonstrations: {demonstrations}; allowed: .*replay_capacity"):
        run(
            keys if run is jrcjax.train_agents else keys[0],
            jrcjax.paper_params("target"),
            learner="tlwd",
            config=config,
        )
    check_config(config)
    LEARNERS["ddqn"](Spec((2, 2), 4, 300), config)
    LEARNERS["tlwd"](Spec((2, 2), 4, 300), Config(replay_capacity=50, demonstrations=49))


def test_other_types_are_refused():
    with pytest.raises(ValueError, match=r"^hparams: dict; allowed: HParams"):
        train({"discount": 0.9})
    with pytest.raises(ValueError, match=r"^config: dict; allowed: Config"):
        train(config={"episodes": 3})


@pytest.mark.parametrize("name", ["dqn", "DDQN", ""])
def test_unknown_learners_are_refused_with_the_known_ones(name):
    with pytest.raises(ValueError, match="learner") as refusal:
        train(learner=name)
    assert all(
        repr(known) in str(refusal.value) for known in ("round_robin", "q_learning", "ddqn", "dpr", "tlwd", name)
    )


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
        "learning_rate": 1e-3, "step_exponent": 0.7, "step_constant": 0.0, "priority_exponent": 0.4,
        "priority_constant": 0.001, "demonstration_constant": 1.0, "importance_start": 0.6, "importance_end": 1.0,
        "n_step_weight": 1.0, "margin_weight": 1.0, "l2_weight": 1e-5, "margin": 1.0, "demonstration_epsilon": 0.01,
        "initial_weights": 0,
    }  # fmt: skip
    assert INITIAL_WEIGHTS[0] == "random"
    for name, number in wanted.items():
        assert float(getattr(hparams, name)) == float(np.float32(number))
    assert all(leaf.shape == () for leaf in jax.tree.leaves(hparams))
    assert len(jax.tree.leaves(hparams)) == len(wanted)
    assert (config.episodes, config.batch_size, config.replay_capacity, config.hidden) == (1000, 64, 50_000, (24, 24))
    assert (config.demonstrations, config.pretraining, config.n_step) == (20_000, 10_000, 10)
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
