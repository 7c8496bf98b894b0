"""Channel (1), chirp (2), events (3)(4), metrics (6)(7), states (8) and rewards (11), each against the equation."""

from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy_model import Model

from jrcjax import rng
from jrcjax.model import channel, events, metrics, rewards, slot, states, transitions
from jrcjax.radar import chirp
from jrcjax.readings import EventModel, MissConvention

# Sums and products of about ten float32 numbers.
RTOL = 10 * float(np.finfo(np.float32).eps)
SHAPES = [(2, 2, 2, 2, 2), (3, 2, 2, 3, 2), (1, 1, 1, 1, 1), (2, 1, 4, 3, 5)]
WEIGHTS = jnp.asarray([1.0, 100.0, 1.0, 50.0])


@pytest.mark.parametrize(("bandwidth", "slope", "max_if", "reach", "resolution"), [
    (300e6, 10e12, 15e6, 225.0, 0.5),
    (750e6, 15e12, 4.5e6, 45.0, 0.2),
])  # fmt: skip
def test_chirps_have_the_stated_ranges(bandwidth, slope, max_if, reach, resolution):
    # The text takes c0 as 3e8 m/s, 0.07 % more than it is.
    assert float(chirp.range_resolution(jnp.float32(bandwidth))) == pytest.approx(resolution, rel=7.1e-4)
    assert float(chirp.maximum_range(jnp.float32(slope), jnp.float32(max_if))) == pytest.approx(reach, rel=7.1e-4)


def test_one_maximum_frequency_cannot_give_both_ranges():
    long, short = chirp.maximum_range(jnp.asarray([10e12, 15e12]), jnp.asarray([15e6, 15e6]))
    assert float(long) == pytest.approx(225.0, rel=1e-3)
    assert float(short) == pytest.approx(150.0, rel=1e-3)


@pytest.mark.parametrize("preset", ["paper-source", "paper-target", "paper_table-target"])
def test_preset_radar_reaches_as_far_as_the_text_says(environments, preset):
    radar = environments[preset].radar
    reach = chirp.maximum_range(radar.slope, radar.max_intermediate_frequency)
    np.testing.assert_allclose(reach, [225.0, 45.0], rtol=RTOL)
    np.testing.assert_allclose(chirp.range_resolution(radar.bandwidth), [0.5, 0.2], rtol=7.1e-4)


def test_table_one(environments):
    source, target, table = (environments[name] for name in ("paper-source", "paper-target", "paper_table-target"))
    for params, tau, rest, fast in ((source, 0.3, (0.007, 0.07), 0.1), (target, 0.7, (0.004, 0.04), 0.4)):
        for factor in params.factors:
            np.testing.assert_allclose(factor.prior, [tau, 1.0 - tau], rtol=RTOL)
            assert float(factor.persistence) == 0.0
        np.testing.assert_allclose(params.road.event_probability, rest, rtol=RTOL)
        np.testing.assert_allclose(params.nearby.event_probability, rest, rtol=RTOL)
        np.testing.assert_allclose(params.weather.event_probability, [0.005, 0.046], rtol=RTOL)
        np.testing.assert_allclose(params.speed.event_probability, [0.005, fast], rtol=RTOL)
        np.testing.assert_array_equal(params.reward_weights, [1.0, 100.0, 1.0, 50.0])
        assert params.max_steps_in_episode == 300
    np.testing.assert_allclose(table.speed.event_probability, [0.05, 0.4], rtol=RTOL)
    np.testing.assert_allclose(source.radar.density, 54.0)
    np.testing.assert_allclose(target.radar.density, 27.0)
    np.testing.assert_allclose(target.radar.bandwidth, [300e6, 750e6])
    np.testing.assert_allclose(target.radar.slope, [10e12, 15e12])
    np.testing.assert_allclose(target.radar.size_mean, [[4.62, 1.92], [0.73, 0.68]], rtol=RTOL)
    np.testing.assert_allclose(target.radar.size_std, [[0.18, 0.08], [0.085, 0.055]], rtol=RTOL)
    np.testing.assert_allclose(target.radar.class_share, [20 / 27, 7 / 27], rtol=RTOL)


def _sent(link, levels):
    """Packets at each level with each of two rates."""
    levels, rates = (map(jnp.int32, range(n)) for n in (levels, 2))
    rates = list(rates)
    return [[float(channel.delivered_packets(level, rate, link)) for rate in rates] for level in levels]


def test_delivered_packets(target, strict):
    assert _sent(target.channel, 2) == [[2.0, 4.0], [2.0, 0.0]]


def test_rate_decodes_from_its_threshold_on(strict):
    powers = jnp.asarray([0.25, 0.75, 1.75])  # with noise 0.25: SINR 2, 1, 0.5
    link = channel.Channel(
        prior=jnp.full(3, 1 / 3),
        persistence=jnp.float32(0.0),
        received_power=jnp.float32(1.0),
        interference=powers,
        noise=jnp.float32(0.25),
        sinr_threshold=jnp.asarray([0.5, 1.0]),
        packets=jnp.asarray([3.0, 7.0]),
    )
    np.testing.assert_array_equal(channel.sinr(link), [2.0, 1.0, 0.5])
    assert _sent(link, 3) == [[3.0, 7.0], [3.0, 7.0], [3.0, 0.0]]


@pytest.mark.parametrize("reading", EventModel)
def test_event_probability(any_params, reading, strict):
    params = any_params.replace(event_model=reading)
    probability = events.event_probability(params)
    # The third reading subtracts from 1, so its error is relative to 1.
    np.testing.assert_allclose(probability, Model(params).event, rtol=RTOL, atol=5 * np.finfo(np.float32).eps)
    assert (probability >= 0).all()
    assert (probability <= 1).all()


def test_event_probability_by_hand(target):
    by_reading = [events.event_probability(target.replace(event_model=jnp.int32(i))) for i in range(3)]
    # All favourable, then high speed alone (state 2), in the order of the readings.
    assert float(by_reading[0][0]) == pytest.approx(0.004 + 0.005 + 0.005 + 0.004, rel=RTOL)
    assert float(by_reading[0][2]) == pytest.approx(0.004 + 0.005 + 0.4 + 0.004, rel=RTOL)
    marginal = 2 * (0.7 * 0.004 + 0.3 * 0.04) + (0.7 * 0.005 + 0.3 * 0.046) + (0.7 * 0.005 + 0.3 * 0.4)
    np.testing.assert_allclose(by_reading[1], marginal, rtol=RTOL)
    assert float(by_reading[2][2]) == pytest.approx(1 - 0.996 * 0.995 * 0.6 * 0.996, rel=RTOL)


def test_event_probability_is_clipped(target):
    sure = jnp.asarray([0.6, 0.9])
    params = target.replace(road=target.road.replace(event_probability=sure))
    params = params.replace(speed=target.speed.replace(event_probability=sure))
    for reading in range(2):
        np.testing.assert_array_equal(events.event_probability(params.replace(event_model=jnp.int32(reading))), 1.0)
    assert (events.event_probability(params.replace(event_model=jnp.int32(2))) < 1).all()


@pytest.mark.parametrize(("is_data", "event", "packets", "miss", "expected"), [
    (True, False, 4.0, 1.0, 4.0),
    (True, True, 4.0, 1.0, -100.0),
    (False, False, 0.0, 0.25, -1.0),
    (False, True, 0.0, 0.25, 37.5),
])  # fmt: skip
def test_reward_cases(is_data, event, packets, miss, expected, strict):
    got = rewards.reward(jnp.bool_(is_data), jnp.bool_(event), jnp.float32(packets), jnp.float32(miss), WEIGHTS)
    assert float(got) == expected


def test_reward_weights_are_used():
    weights = jnp.asarray([3.0, 5.0, 7.0, 11.0])
    is_data, event = (jnp.asarray(column) for column in zip(*product((True, False), repeat=2), strict=True))
    got = rewards.reward(is_data, event, jnp.full(4, 2.0), jnp.full(4, 0.5), weights)
    np.testing.assert_array_equal(got, [-5.0, 6.0, 5.5, -7.0])


# One episode of six slots: (data?, event?, packets, p_k), which is 1 in a slot spent on data.
EPISODE = [
    (True, False, 4.0, 1.0), (True, True, 2.0, 1.0), (False, True, 0.0, 0.25),
    (False, False, 0.0, 0.5), (True, False, 2.0, 1.0), (False, False, 0.0, 0.75),
]  # fmt: skip
MISS = (4.5 / 6, 1.25 / 2, 1.5 / 3)  # in the order of MissConvention


def _measured(episode, params):
    sums = metrics.zero()
    for is_data, event, packets, miss in episode:
        outcome = slot.Outcome(
            next_state=jnp.int32(0),
            reward=jnp.float32(1.0),
            event=jnp.bool_(event),
            is_data=jnp.bool_(is_data),
            packets=jnp.float32(packets),
            miss_ratio=jnp.float32(miss),
        )
        sums = slot.measure(sums, outcome, params)
    return sums


@pytest.mark.parametrize("count_event_packets", [0, 1])
@pytest.mark.parametrize("convention", MissConvention)
def test_metrics_of_an_episode(target, convention, count_event_packets, strict):
    params = target.replace(
        miss_convention=convention,
        count_event_packets=jnp.int32(count_event_packets),
    )
    sums = _measured(EPISODE, params)
    assert float(metrics.throughput(sums)) == (8.0 if count_event_packets else 6.0)
    assert float(metrics.miss_detection(sums)) == pytest.approx(MISS[convention], rel=RTOL)
    assert float(metrics.average_reward(sums)) == 1.0


@pytest.mark.parametrize(("convention", "slots"), [("event_slots", EPISODE[:1]), ("radar_slots", EPISODE[:2])])
def test_miss_detection_of_no_slot_is_nan(target, convention, slots):
    params = target.replace(miss_convention=convention)
    assert np.isnan(metrics.miss_detection(_measured(slots, params)))


def test_data_slot_misses_everything(strict):
    assert float(metrics.slot_miss(jnp.bool_(True), jnp.float32(0.25))) == 1.0
    assert float(metrics.slot_miss(jnp.bool_(False), jnp.float32(0.25))) == 0.25


def test_state_one(strict):
    levels = jnp.asarray([0, 0, 0, 0, 1])
    assert int(states.id_of(levels, (2, 2, 2, 2, 2))) == 1
    np.testing.assert_array_equal(states.levels_of(jnp.int32(1), (2, 2, 2, 2, 2)), levels)
    # The channel is the most significant digit.
    np.testing.assert_array_equal(states.levels_of(jnp.int32(16), (2, 2, 2, 2, 2)), [1, 0, 0, 0, 0])


@pytest.mark.parametrize("shape", SHAPES)
def test_state_ids_count_in_mixed_radix(shape, strict):
    ids = jnp.arange(states.num_states(shape))
    levels = states.levels_of(ids, shape)
    np.testing.assert_array_equal(levels, list(product(*map(range, shape))))
    np.testing.assert_array_equal(states.id_of(levels, shape), ids)
    features = np.asarray(states.features_of(ids, shape))
    scaled = np.array(list(product(*map(range, shape)))) / np.maximum(np.array(shape) - 1.0, 1.0)
    np.testing.assert_allclose(features, scaled, rtol=RTOL)
    assert len(np.unique(features, axis=0)) == len(ids)
    np.testing.assert_array_equal(states.all_features(shape), features)


def test_levels_follow_from_their_random_number(strict):
    prior = jnp.asarray([0.25, 0.5, 0.25])
    drawn = [int(transitions.draw_level(jnp.float32(u), prior)) for u in (0.0, 0.24, 0.25, 0.74, 0.75, 1 - 2**-24)]
    assert drawn == [0, 0, 1, 1, 2, 2]
    # Rounding in the sum of the prior must not lead past the last level.
    thirds = jnp.full(3, 1 / 3, jnp.float32)
    assert int(transitions.draw_level(jnp.float32(1 - 2**-24), thirds)) == 2


def test_impossible_levels_are_not_drawn(strict):
    prior = jnp.asarray([0.0, 1.0, 0.0])
    drawn = jax.vmap(transitions.draw_level, in_axes=(0, None))(jnp.linspace(0.0, 1 - 2**-24, 1001), prior)
    np.testing.assert_array_equal(drawn, 1)


def test_uniforms_lie_in_the_half_open_interval(strict):
    ends = rng.uniform(jnp.asarray([0, 2**32 - 1], jnp.uint32))
    np.testing.assert_array_equal(ends, [0.0, 1 - 2**-24])
