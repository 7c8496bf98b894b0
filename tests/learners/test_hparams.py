"""Hyperparameters and settings: Table I's numbers, and refusals that name the field."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jrcjax
from jrcjax.containers import Kind, schema_of
from jrcjax.learners import LEARNERS, Spec
from jrcjax.learners.hparams import OPTIMISERS, Config, HParams, check_config, check_hparams
from jrcjax.learners.optimiser import clipped, optimiser_of
from jrcjax.learners.q_function import q_function
from jrcjax.readings import Exploration

READINGS = {name: field.names for name, field in schema_of(HParams).items() if field.kind is Kind.READING}
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
    "target_period": st.one_of(st.integers(-(10**6), 0), st.floats(1.1, 1.9), st.just(2**31), NO_NUMBERS),
    "step_exponent": st.one_of(st.floats(-10, 0.5), ABOVE_1, NO_NUMBERS),
    "step_constant": NO_SHARE,
    "priority_exponent": NO_SHARE,
    "priority_constant": NO_PRIORITY,
    "demonstration_constant": NEGATIVE,
    "huber_delta": NOT_POSITIVE,
    "max_gradient_norm": NOT_POSITIVE,
    "target_rate": st.one_of(st.just(0.0), NO_SHARE),
    "importance_start": NO_SHARE,
    "importance_end": NO_SHARE,
    "n_step_weight": NEGATIVE,
    "margin_weight": NEGATIVE,
    "l2_weight": NEGATIVE,
    "margin": NEGATIVE,
    "demonstration_epsilon": NO_SHARE,
}
NO_CHOICE = st.one_of(st.integers(-(10**6), -1), st.integers(3, 10**6), st.sampled_from([0.0, True, "0", 2**40]))
OUTSIDE |= dict.fromkeys(READINGS, NO_CHOICE)
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
    "target_update": st.sampled_from(["Soft", "", "copy", None, True]),
    "gradient_clipping": st.sampled_from(["norm", "", None, 1, True]),
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


GOOD = {name: st.sampled_from(range(len(names))) for name, names in READINGS.items()} | {
    "discount": st.floats(0, 0.999),
    "epsilon_start": st.floats(1e-3, 1),
    "epsilon_end": st.floats(1e-3, 1),
    "epsilon_slots": st.floats(1e-3, 1e9),
    "learning_rate": st.floats(1e-9, 10),
    "huber_delta": st.floats(1e-3, 1e6),
    "max_gradient_norm": st.floats(1e-3, 1e6),
    "target_period": st.integers(1, 10**6),
    "target_rate": st.floats(1e-6, 1),
    "step_exponent": st.floats(0.501, 1),
    "priority_constant": st.floats(1e-9, 1e6),
    **dict.fromkeys(
        ["demonstration_constant", "n_step_weight", "margin_weight", "l2_weight", "margin"], st.floats(0, 1e6)
    ),
    **dict.fromkeys(
        ["step_constant", "priority_exponent", "importance_start", "importance_end", "demonstration_epsilon"],
        st.floats(0, 1),
    ),
}


@settings(max_examples=30, deadline=None, derandomize=True)
@given(numbers=st.fixed_dictionaries(GOOD))
def test_good_hyperparameters_are_accepted_and_become_arrays(numbers):
    hparams = HParams(**numbers)
    check_hparams(hparams)
    for name, number in numbers.items():
        field, wanted = getattr(hparams, name), jnp.int32 if isinstance(number, int) else jnp.float32
        assert (field.shape, field.dtype) == ((), wanted)
        assert field == np.asarray(number, wanted)


@pytest.mark.parametrize("value", [3e-4, np.float64(3e-4), np.array(3e-4), jnp.float32(3e-4)])
def test_numbers_of_any_origin_become_float32(value):
    for hparams in (HParams(learning_rate=value), HParams().replace(learning_rate=value)):
        assert isinstance(hparams.learning_rate, jax.Array)
        assert hparams.learning_rate.dtype == jnp.float32


def test_hyperparameters_go_through_transformations_as_any_pytree():
    several = jax.tree.map(lambda leaf: jnp.stack([leaf, leaf]), HParams())
    assert jax.vmap(lambda h: h.learning_rate + h.target_period)(several).shape == (2,)
    assert jax.tree.map(lambda leaf: None, HParams()).loss is None
    assert jax.eval_shape(lambda h: h, HParams()).loss.dtype == jnp.int32


def test_a_factor_needs_two_probabilities_above_0():
    with pytest.raises(ValueError, match=r"^hparams\.epsilon_end: 0.0; allowed: .*> 0"):
        train(HParams(exploration=Exploration.EXPONENTIAL, epsilon_end=0.0))


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
        "huber_delta": 1.0, "max_gradient_norm": 10.0, "target_rate": 1e-3, **dict.fromkeys(READINGS, 0),
    }  # fmt: skip
    first = {name: names[0] for name, names in READINGS.items()}
    assert first == {
        "exploration": "linear", "initialiser": "lecun_normal", "loss": "squared", "demonstration_rewards": "source",
        "importance_over": "all_updates", "initial_weights": "random",
    }  # fmt: skip
    for name, number in wanted.items():
        assert float(getattr(hparams, name)) == float(np.float32(number))
    assert all(leaf.shape == () for leaf in jax.tree.leaves(hparams))
    assert len(jax.tree.leaves(hparams)) == len(wanted)
    assert (config.episodes, config.batch_size, config.replay_capacity, config.hidden) == (1000, 64, 50_000, (24, 24))
    assert (config.demonstrations, config.pretraining, config.n_step) == (20_000, 10_000, 10)
    assert (config.optimiser, config.form) == ("adam", "auto")
    assert (config.target_update, config.gradient_clipping) == ("copied", "none")


def test_named_optimisers_take_their_rate_from_the_hyperparameters():
    gradient, weights = jnp.asarray([3.0, -0.5]), jnp.asarray([1.0, 2.0])
    for name, wanted in [("sgd", gradient), ("adam", jnp.sign(gradient))]:
        optimiser = optimiser_of(Config(optimiser=name))
        with jax.numpy_dtype_promotion("standard"):  # optax mixes floats with integer counts
            moved, _ = optimiser.step(gradient, optimiser.init(weights), weights, HParams(learning_rate=0.25))
        # 1 - 0.999 in float32 is off by 1.3e-5 of itself, of which Adam takes the root.
        np.testing.assert_allclose(moved, weights - 0.25 * wanted, rtol=1e-5)


def test_an_optimiser_of_ones_own_brings_its_rate():
    gradient, weights = jnp.asarray([3.0, -0.5]), jnp.asarray([1.0, 2.0])
    optimiser = optimiser_of(Config(optimiser=optax.sgd(0.125)))
    moved, _ = optimiser.step(gradient, optimiser.init(weights), weights, HParams(learning_rate=9.0))
    np.testing.assert_array_equal(moved, weights - 0.125 * gradient)


@pytest.mark.parametrize(("norm", "scale"), [(2.6, 0.2), (13.0, 1.0), (1e6, 1.0)])
def test_gradients_are_cut_to_a_norm_over_all_weights_together(norm, scale):
    gradient = {"a": jnp.asarray([3.0, -4.0]), "b": jnp.asarray([[12.0]])}  # of length 13
    wanted = jax.tree.map(lambda g: scale * np.asarray(g), gradient)
    got = clipped(gradient, jnp.float32(norm))
    jax.tree.map(lambda g, w: np.testing.assert_allclose(g, w, rtol=1e-6), got, wanted)
    if scale == 1.0:
        jax.tree.map(np.testing.assert_array_equal, got, gradient)
    optimiser, weights = (
        optimiser_of(Config(optimiser="sgd", gradient_clipping="global_norm")),
        jax.tree.map(jnp.zeros_like, gradient),
    )
    step, _ = optimiser.step(
        gradient, optimiser.init(weights), weights, HParams(learning_rate=1.0, max_gradient_norm=norm)
    )
    jax.tree.map(lambda s, w: np.testing.assert_allclose(s, -w, rtol=1e-6), step, wanted)


@pytest.mark.parametrize(("learner", "states", "most"), [
    # Words of a transition: one or two of ids and one of the reward; or two of ids, two numbers and a priority.
    ("ddqn", (2,) * 24, (2**31 - 1) // 3), ("dpr", (2,) * 24, (2**31 - 1) // 3), ("tlwd", (2,) * 5, 2**29 - 4),
])  # fmt: skip
def test_a_replay_memory_whose_words_have_no_places_is_refused(learner, states, most):
    """Places of words are int32."""
    make = functools.partial(LEARNERS[learner], Spec(states, 4, 300))
    make(Config(replay_capacity=most))
    with pytest.raises(ValueError, match=rf"^config\.replay_capacity: {most + 1}; allowed: .*fewer than 2\^31 words"):
        make(Config(replay_capacity=most + 1))


UNFIT = {
    "lbfgs": optax.lbfgs(),
    "reduce_on_plateau": optax.chain(optax.sgd(0.1), optax.contrib.reduce_on_plateau()),
    "growing": optax.GradientTransformation(lambda w: (), lambda g, state, w=None: (g, (*state, 0))),
    "halving": optax.GradientTransformation(lambda w: (), lambda g, s, w=None: (jax.tree.map(jnp.float16, g), s)),
}


@pytest.mark.parametrize("name", UNFIT)
@pytest.mark.parametrize("learner", ["ddqn", "dpr", "tlwd"])
def test_optimisers_that_need_more_than_a_gradient_are_refused(name, learner):
    with pytest.raises(ValueError, match=r"^config\.optimiser: .*; allowed: an optax transformation") as refusal:
        train(config=Config(optimiser=UNFIT[name]), learner=learner)
    assert len(str(refusal.value)) < 500


VARIANCES = {
    "lecun_normal": lambda i, o: 1 / i,
    "glorot_uniform": lambda i, o: 2 / (i + o),
    "he_normal": lambda i, o: 2 / i,
}


@pytest.mark.parametrize("number", range(3))
def test_kernels_have_the_variance_of_their_initialiser(number):
    """200 networks; the second layer's 24 x 24 kernels, so the share of chance in a variance is 0.4 % (one sigma)."""
    function = q_function(Spec((2,) * 5, 4, 300), Config(hidden=(40, 24)))
    keys, names = jax.random.split(jax.random.key(1), 200), READINGS["initialiser"]
    weights = jax.vmap(function.init, in_axes=(0, None))(keys, jnp.int32(number))
    kernels = np.asarray(weights["params"]["ColumnDense_1"]["kernel"])
    assert kernels.shape == (200, 24, 40)
    np.testing.assert_allclose(kernels.var(), VARIANCES[names[number]](40, 24), rtol=0.02)
    is_bounded = np.abs(kernels).max() <= np.sqrt(3 * VARIANCES[names[number]](40, 24)) * (1 + 1e-6)
    assert is_bounded == (names[number] == "glorot_uniform")
    assert not np.any(weights["params"]["ColumnDense_1"]["bias"])
