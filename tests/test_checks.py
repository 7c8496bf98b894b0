"""What is refused: with which words, and before anything compiles."""

import dataclasses

import jax
import numpy as np
import pytest
from compiling import nothing_compiles
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import jrcjax
from jrcjax import check_params, paper_params, radar
from jrcjax.radar.bank import PLACEMENTS
from jrcjax.readings import CountingRule, CountModel, Distance

FACTORS = ("road", "weather", "speed", "nearby")
SETTINGS = settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))


def put(params, field, value):
    """A copy with `value` at the dotted `field`, and nothing else changed."""
    first, _, rest = field.partition(".")
    return dataclasses.replace(params, **{first: put(getattr(params, first), rest, value) if rest else value})


def assert_refused(params, field, value):
    """A radar refuses at once, since it builds a bank; other containers leave it to `check_params`."""
    with nothing_compiles(), pytest.raises(ValueError, match=field.replace(".", r"\.")):
        check_params(put(params, field, value))


not_finite = st.sampled_from([np.nan, np.inf, -np.inf])
below_zero = st.floats(-1e6, -1e-3)
not_probability = below_zero | st.floats(1.001, 1e6) | not_finite
wrong_type = st.sampled_from([None, "0.5", "x", 1j, {}, object])
not_positive = st.sampled_from([0.0, -0.0]) | below_zero | not_finite


def with_one(shape, bad, good=0.5):
    """Arrays of `shape` with one bad entry."""

    def make(index_and_value):
        array = np.full(shape, good)
        array.flat[index_and_value[0]] = index_and_value[1]
        return array

    return st.tuples(st.integers(0, int(np.prod(shape)) - 1), bad).map(make)


PRIORS = tuple(f"{name}.prior" for name in ("channel", *FACTORS))
wrong_priors = (
    with_one((2,), not_probability)
    | st.floats(-0.5, 0.5).filter(lambda x: abs(x) > 1e-3).map(lambda x: np.array([0.5, 0.5 + x]))
    | st.just(np.array([1.5, -0.5]))
)
BAD = {
    **dict.fromkeys(PRIORS, wrong_priors),
    **{f"{name}.event_probability": with_one((2,), not_probability) for name in FACTORS},
    **{f"{name}.persistence": not_probability | st.just(1.0) for name in ("channel", *FACTORS)},
    "channel.received_power": not_positive,
    "channel.noise": not_positive,
    "channel.interference": with_one((2,), below_zero | not_finite),
    "channel.packets": with_one((2,), below_zero | not_finite),
    "channel.sinr_threshold": with_one((2,), not_positive) | st.sampled_from([np.array([2.0, 1.0]), np.ones(2)]),
    "radar.bandwidth": with_one((2,), not_positive, good=3e8),
    "radar.slope": with_one((2,), not_positive, good=1e13),
    "radar.max_intermediate_frequency": with_one((2,), not_positive, good=1e7),
    "radar.density": not_positive | st.floats(1e-6, 0.4),
    "radar.class_share": wrong_priors,
    "radar.size_mean": with_one((2, 2), not_positive),
    "radar.size_std": with_one((2, 2), below_zero | not_finite),
    "radar.distance": st.integers(-5, 9).filter(lambda i: i not in range(len(Distance))),
    "radar.counting_rule": st.integers(-5, 9).filter(lambda i: i not in range(len(CountingRule))),
    "radar.count_model": st.integers(-5, 9).filter(lambda i: i not in range(len(CountModel))),
    "radar.placements": st.text().filter(lambda name: name not in PLACEMENTS),
    "radar.max_objects": st.sampled_from([(0, 99), (10_000,), (True, 60), (700, 26.0), (1, 2, 3)]),
    "radar.bank_size": st.integers(-5, 0) | st.floats() | st.booleans(),
    "radar.bank_seed": st.integers(-5, -1) | st.floats(0.1, 0.9),
    "reward_weights": with_one((4,), below_zero | not_finite),
    "event_model": st.integers(-5, 9).filter(lambda i: i not in range(3)) | st.floats(0.1, 0.9),
    "miss_convention": st.integers(-5, 9).filter(lambda i: i not in range(3)) | st.floats(0.1, 0.9),
    "count_event_packets": st.integers(-5, 9).filter(lambda i: i not in (0, 1)) | not_finite,
    "terminal_time_limit": st.integers(-5, 9).filter(lambda i: i not in (0, 1)) | not_finite,
    "max_steps_in_episode": st.integers(-5, 0) | st.floats() | st.booleans() | st.text(),
}
SHAPES = {
    **{f"{name}.prior": [(), (0,), (1, 2)] for name in ("channel", *FACTORS)},
    **{f"{name}.event_probability": [(), (0,), (3,), (2, 1)] for name in FACTORS},
    **{f"{name}.persistence": [(1,), (2,)] for name in ("channel", *FACTORS)},
    "channel.interference": [(), (3,), (2, 1)],
    "channel.packets": [(), (0,), (2, 1)],
    "channel.sinr_threshold": [(), (1,), (3,)],
    "channel.received_power": [(1,), (2,)],
    "channel.noise": [(1,), (2,)],
    "radar.bandwidth": [(), (0,), (2, 1)],
    "radar.slope": [(), (1,), (3,)],
    "radar.max_intermediate_frequency": [(), (1,), (3,)],
    "radar.density": [(1,), (2,)],
    "radar.class_share": [(), (0,), (1, 2)],
    "radar.size_mean": [(), (2,), (3, 2), (2, 3)],
    "radar.size_std": [(), (2,), (3, 2), (2, 3)],
    "radar.distance": [(1,), (2,)],
    "reward_weights": [(), (3,), (5,), (1, 4)],
    "event_model": [(1,), (3,)],
    "miss_convention": [(1,), (3,)],
    "count_event_packets": [(1,)],
    "terminal_time_limit": [(1,)],
}


RADAR = {
    "bandwidth": (3e8,), "slope": (1e13,), "max_intermediate_frequency": (2e6,), "density": 4.0, "class_share": (1.0,),
    "size_mean": ((4.0, 2.0),), "size_std": ((0.1, 0.1),), "bank_size": 8,
}  # fmt: skip


@pytest.mark.parametrize("field", BAD)
def test_bad_numbers_are_refused(target, field):
    @SETTINGS
    @given(BAD[field])
    def refused(value):
        assert_refused(target, field, value)

    refused()


@pytest.mark.parametrize(("field", "shape"), [(field, shape) for field, shapes in SHAPES.items() for shape in shapes])
def test_wrong_shapes_are_refused(target, field, shape):
    # Numbers that would do, so that the shape alone is wrong.
    fill = 1.0 / max(shape[-1], 1) if shape and field.endswith(("prior", "share")) else 0.0
    assert_refused(target, field, np.full(shape, fill))


@pytest.mark.parametrize("field", sorted({*BAD, *SHAPES} - {"radar.max_objects"}))
def test_wrong_types_are_refused(target, field):
    @SETTINGS
    @given(wrong_type)
    def refused(value):
        assert_refused(target, field, value)

    refused()


@pytest.mark.parametrize("value", [("a", "b"), 5, (700.5, 60), [700, 60]])
def test_wrong_capacities_are_refused(target, value):
    assert_refused(target, "radar.max_objects", value)


@pytest.mark.parametrize("value", [None, "x"])
@pytest.mark.parametrize("field", ["channel", "road", "radar"])
def test_something_else_in_place_of_a_part_is_refused(target, field, value):
    assert_refused(target, field, value)


@pytest.mark.parametrize("value", [None, 3, "target", {}, []])
def test_something_else_than_parameters_is_refused(value):
    with nothing_compiles(), pytest.raises(ValueError, match="params"):
        check_params(value)


@pytest.mark.parametrize("value", [1.0, True])
def test_index_must_be_an_integer(target, value):
    # What passes must also run, and only integers can pick a reading.
    assert_refused(target, "event_model", value)


@pytest.mark.parametrize("value", [[[0.1], [0.1, 0.2]], [0.1, "x"], [0.1, None]])
def test_ragged_and_mixed_lists_are_refused(target, value):
    assert_refused(target, "road.event_probability", value)


@pytest.mark.parametrize("ratio", [np.nan, np.inf, -0.1, 1.1])
def test_bank_without_ratios_is_refused(target, ratio):
    # No constructor takes a bank, but an operation on the whole tree may spoil one.
    spoilt = jax.tree.map(lambda leaf: leaf if leaf.ndim < 2 or leaf.shape[1] < 9 else leaf.at[1, 3].set(ratio), target)
    with nothing_compiles(), pytest.raises(ValueError, match=r"radar\.miss_bank"):
        check_params(spoilt)


def test_valid_parameters_pass(any_params):
    with nothing_compiles():
        check_params(any_params)


@SETTINGS
@given(
    st.lists(st.floats(0.01, 1.0), min_size=1, max_size=6),
    st.lists(st.floats(0.0, 1.0), min_size=6, max_size=6),
    st.floats(0.0, 0.999),
    st.floats(0.5, 54.0),
    st.lists(st.floats(0.0, 1e4), min_size=4, max_size=4),
    st.integers(1, 10_000),
)
def test_valid_random_parameters_pass(masses, events, persistence, density, weights, limit):
    params = paper_params("target").replace(radar=radar.make_radar(**RADAR, max_density=54.0))
    prior = np.asarray(masses, np.float32) / np.sum(masses, dtype=np.float32)
    params = put(params, "speed.prior", prior)
    params = put(params, "speed.event_probability", np.asarray(events[: len(prior)], np.float32))
    params = put(params, "speed.persistence", np.float32(persistence))
    params = put(params, "radar.density", max(density, 3.0))
    params = put(params, "reward_weights", np.asarray(weights, np.float32))
    params = put(params, "max_steps_in_episode", limit)
    with nothing_compiles():
        check_params(params)


def test_message_names_the_value_and_what_is_allowed(target):
    bad = put(target, "speed.event_probability", np.array([0.25, 1.5]))
    with pytest.raises(ValueError, match=r"speed\.event_probability: \[0\.25, 1\.5\]; allowed: .*\[0, 1\]"):
        check_params(bad)


@pytest.mark.parametrize("arguments", [("x",), ("target", "y"), (None,), ("Source",), (3,), ("target", None)])
def test_unknown_presets_are_refused(arguments):
    field = "preset" if len(arguments) == 2 else "environment"
    with nothing_compiles(), pytest.raises(ValueError, match=f"^{field}: .*allowed"):
        paper_params(*arguments)


@pytest.mark.parametrize("field", ["distance", "rule", "count"])
@pytest.mark.parametrize("value", ["x", "", None, 0])
def test_unknown_readings_are_refused(field, value):
    key = jax.random.key(0)  # made first, because making it compiles
    with nothing_compiles(), pytest.raises(ValueError, match=f"^{field}: .*allowed"):
        radar.miss_ratio(key, 27.0, 0, **{field: value})


@pytest.mark.parametrize(("field", "density", "mode"), [
    ("density", 0.0, 0), ("density", -1.0, 0), ("density", np.nan, 0), ("density", np.inf, 0), ("density", "x", 0),
    ("mode", 27.0, 2), ("mode", 27.0, -1), ("mode", 27.0, "long"), ("mode", 27.0, 0.5),
])  # fmt: skip
def test_bad_arguments_of_the_miss_ratio_are_refused(field, density, mode):
    with pytest.raises(ValueError, match=f"^{field}: .*allowed"):
        radar.miss_ratio(jax.random.key(0), density, mode)


@pytest.mark.parametrize(("field", "value"), [
    ("bandwidth", (0.0,)), ("bandwidth", "x"), ("bandwidth", None), ("slope", (np.nan,)), ("slope", (1e13, 1e13)),
    ("density", 0.0), ("density", -1.0), ("density", np.nan), ("density", 0.01), ("density", "x"),
    ("class_share", (0.5,)), ("size_mean", ((-4.0, 2.0),)), ("size_std", ((-0.1, 0.1),)), ("size_std", None),
    ("distance", "x"), ("counting_rule", "x"), ("count_model", "x"), ("placements", "x"), ("bank_size", 0),
    ("bank_size", 2.5), ("bank_seed", -1), ("bank_seed", 0.5), ("max_density", np.nan), ("max_density", -1.0),
])  # fmt: skip
def test_bad_radars_are_refused(field, value):
    with pytest.raises(ValueError, match=rf"^radar\.{field}: .*allowed"):
        radar.make_radar(**(RADAR | {field: value}))


@pytest.mark.parametrize(("field", "value"), [
    ("density", 0.0), ("density", -1.0), ("density", np.nan), ("density", np.inf), ("density", "x"), ("density", 0.01),
    ("bandwidth", np.array([3e8, 3e8])), ("bandwidth", np.array([0.0])), ("distance", 7),
    ("class_share", np.array([0.5])),
])  # fmt: skip
def test_bad_replacements_in_the_radar_are_refused(target, field, value):
    # `replace` builds a bank, and must not leave the user with an error from there.
    start = radar.make_radar(**RADAR)
    with pytest.raises(ValueError, match=rf"radar\.{field}"):
        check_params(target.replace(radar=start.replace(**{field: value})))


def test_shapes_are_checked_inside_a_trace(target):
    bad = put(target, "road.event_probability", np.full(3, 0.1, np.float32))
    with pytest.raises(ValueError, match=r"road\.event_probability"):
        jax.jit(lambda params: check_params(params))(bad)
    jax.jit(lambda params: check_params(params))(target)


def test_types_are_checked_inside_a_trace(target):
    env, key = jrcjax.JRCEnv(target), jax.random.key(0)
    state = jrcjax.EnvState(np.int32(0), np.int32(0), np.int32(0))
    with pytest.raises(ValueError, match=r"^action: 'an array of float32'; allowed: an integer from 0 to 3"):
        jax.eval_shape(lambda action: env.step_env(key, state, action, target), 1.7)
    with pytest.raises(ValueError, match=r"^action: 'an array of bool'"):
        jax.eval_shape(lambda action: env.step(key, state, action), True)
    with pytest.raises(ValueError, match=r"^action: 'an array of key<fry>'"):
        jax.eval_shape(lambda action: env.step(key, state, action), key)
    jax.eval_shape(lambda action: env.step(key, state, action), 1)
    with pytest.raises(ValueError, match=r"^event_model: 'an array of float32'; allowed: 0 \("):
        jax.eval_shape(jax.vmap(lambda model: check_params(target.replace(event_model=model))), np.float32([0, 1]))


def test_public_name():
    assert jrcjax.check_params is check_params
