"""Environments from TOML files: exact round trips, defaults, overrides, and what is refused with which words."""

import math
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiling import nothing_compiles
from tiny import TEXT, tiny_params

import jrcjax
from jrcjax.config.toml import from_toml, to_toml


def assert_same(a, b):
    """Equal to the last bit, in types and in everything static."""
    assert jax.tree.structure(a) == jax.tree.structure(b)
    for x, y in zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True):
        assert x.dtype == y.dtype
        np.testing.assert_array_equal(x, y)


def edited(old, new):
    assert old in TEXT
    return TEXT.replace(old, new, 1)


def test_round_trip_is_exact(tmp_path):
    jrcjax.save_params(tmp_path / "env.toml", tiny_params())
    assert_same(jrcjax.load_params(tmp_path / "env.toml"), tiny_params())


def test_round_trip_of_every_reading_and_flag():
    params = tiny_params()
    params = params.replace(
        event_model=jnp.int32(2),
        miss_convention=jnp.int32(1),
        count_event_packets=jnp.int32(0),
        terminal_time_limit=jnp.int32(1),
        max_steps_in_episode=7,
        road=params.road.replace(persistence=0.5),
        speed=params.speed.replace(persistence=jnp.float32(1 / 3)),
        radar=params.radar.replace(
            distance=jnp.int32(1), counting_rule=jnp.int32(1), count_model=jnp.int32(1), bank_seed=jnp.int32(5)
        ).replace(placements="fresh", max_objects=(301, 99)),
    )
    wanted = params.replace(road=params.road.replace(persistence=jnp.float32(0.5)))  # a plain number is one, too
    assert_same(from_toml(to_toml(params)), wanted)


def test_shortest_digits_tell_float32_numbers_apart():
    bits = np.random.default_rng(0).integers(0, 2**31, 20_000, dtype=np.uint32)
    numbers = bits.view(np.float32)
    numbers = numbers[np.isfinite(numbers)]
    read = np.array([np.float32(float(str(x))) for x in numbers])
    np.testing.assert_array_equal(read, numbers)


def test_a_whole_environment_needs_no_preset():
    params = tiny_params()
    assert params.shape == (3, 2, 1, 3, 2)
    assert (params.num_rates, params.radar.num_modes, params.num_actions) == (3, 2, 5)
    np.testing.assert_array_equal(params.speed.persistence, np.float32(0.25))
    # Levels 0, 1 and 2 have SINR 100, 9.1 and 1.96: all rates, two of them, and the lowest alone decode.
    sent = jrcjax.exact.packet_table(params).reshape(3, -1, 5)[:, 0]
    np.testing.assert_array_equal(sent, [[1, 2, 4, 0, 0], [1, 2, 0, 0, 0], [1, 0, 0, 0, 0]])
    assert jrcjax.exact.stationary_distribution(params).shape == (36,)


def test_left_out_keys_have_the_defaults_of_the_deviations():
    params = from_toml(edited("max_steps_in_episode = 20\n", ""))
    assert params.max_steps_in_episode == 300
    assert [int(params.event_model), int(params.miss_convention)] == [0, 0]
    assert [int(params.count_event_packets), int(params.terminal_time_limit)] == [1, 0]
    radar = params.radar
    assert [int(radar.distance), int(radar.counting_rule), int(radar.count_model), int(radar.bank_seed)] == [0] * 4


def test_a_preset_alone_is_the_preset():
    assert_same(from_toml('environment = "target"'), jrcjax.paper_params("target"))
    text = 'environment = "source"\npreset = "paper_table"'
    assert_same(from_toml(text), jrcjax.paper_params("source", "paper_table"))


def test_overrides_change_what_they_name():
    text = 'preset = "paper"\nevent_model = "noisy_or"\nspeed.event_probability = [0.1, 0.2]\nroad.persistence = 0.5'
    paper = jrcjax.paper_params("target")
    wanted = paper.replace(
        event_model=jnp.int32(2),
        speed=paper.speed.replace(event_probability=jnp.array([0.1, 0.2])),
        road=paper.road.replace(persistence=jnp.float32(0.5)),
    )
    assert_same(from_toml(text), wanted)


def test_another_radar_over_a_preset():
    text = """
    environment = "target"
    [radar]
    bandwidth = [7.5e8]
    slope = [1.5e13]
    max_intermediate_frequency = [2e6]
    bank_size = 32
    """
    radar = from_toml(text).radar
    assert radar.num_modes == 1
    assert radar.miss_bank.shape == (1, 32)
    np.testing.assert_array_equal(radar.density, 27.0)
    most = 54.0 * (299_792_458 / 2 * 2e6 / 1.5e13 / 45) ** 2  # mean count in traffic as dense as the presets hold
    assert radar.max_objects == (math.ceil(most + 8 * math.sqrt(most) + 8),)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('presett = "paper"', "presett: 'an unknown key'; allowed: environment, preset, reward_weights"),
        (edited("noise = 0.01", "nose = 0.01"), "channel.nose: 'an unknown key'; allowed: prior, persistence"),
        (edited("noise = 0.01", ""), "channel.noise: 'missing'; allowed: a number > 0 W"),
        (edited("reward_weights = [1, 100, 1, 50]", ""), "reward_weights: 'missing'"),
        (edited("reward_weights = [1, 100, 1, 50]", "reward_weights = [1, 100, 1]"), "reward_weights: 'shape (3,)'"),
        (edited("[road]\nprior = [0.6, 0.4]\nevent_probability = [0.01, 0.1]", ""), "road.prior: 'missing'"),
        (edited("prior = [0.6, 0.4]", "prior = [0.6, 0.5]"), "road.prior: [0.6"),
        (edited("[0.01, 0.1]", "[0.01, 0.1, 0.2]"), "road.event_probability: 'shape (3,)'; allowed: shape (2,)"),
        (edited("[0.01, 0.1]", "0.01"), "road.event_probability: 'shape ()'; allowed: shape (2,)"),
        (edited("[0.01, 0.1]", "[0.01, [0.1]]"), "road.event_probability: '[0.01, [0.1]]'; allowed: an array"),
        (edited("[0.01, 0.1]", '[0.01, "0.1"]'), "road.event_probability: '0.1'; allowed: numbers"),
        (edited("[0.01, 0.1]", "[0.01, true]"), "road.event_probability: 'True'; allowed: numbers"),
        (edited("[0.01, 0.1]", "[0.01, nan]"), "road.event_probability: [0.0"),
        (edited("noise = 0.01", "noise = 1e300"), "channel.noise: inf; allowed: a number > 0 W"),
        (edited("noise = 0.01", f"noise = 1{'0' * 400}"), "channel.noise: '1000"),
        (edited("[1.5, 5, 20]", "[1.5, 20, 5]"), "channel.sinr_threshold: [1.5, 20.0, 5.0]; allowed: numbers, one"),
        (edited("[1.5, 5, 20]", "[5, 20]"), "channel.sinr_threshold: 'shape (2,)'; allowed: shape (3,)"),
        (edited("[1.0e13, 1.5e13]", "[1.5e13]"), "radar.slope: 'shape (1,)'; allowed: shape (2,)"),
        (edited("size_mean = [[4.6, 1.9]]", "size_mean = [4.6, 1.9]"), "radar.size_mean: 'shape (2,)'"),
        (edited("bank_size = 64", "bank_size = 64.0"), "radar.bank_size: '64.0'; allowed: integers"),
        (edited("bank_size = 64", "bank_size = 0"), "radar.bank_size: 0; allowed: an int from 1"),
        (edited("bank_size = 64", 'distance = "euclid"'), "radar.distance: 'euclid'; allowed: 'footprint_gap', "),
        (edited("bank_size = 64", "max_density = 20\nmax_objects = [99]"), "radar.max_density: 20; allowed: either"),
        (edited("episode = 20", "episode = 0"), "max_steps_in_episode: 0; allowed: an int from 1"),
        (edited("episode = 20", "episode = [3]"), "max_steps_in_episode: '[3]'; allowed: an int from 1"),
        ("count_event_packets = 1\n" + TEXT, "count_event_packets: '1'; allowed: true or false"),
        ('event_model = "or"\n' + TEXT, "event_model: 'or'; allowed: 'conditional', 'marginal', 'noisy_or'"),
        ("event_model = [1]\n" + TEXT, "event_model: '[1]'; allowed: 'conditional'"),
        ('environment = "town"', "environment: 'town'; allowed: 'source', 'target'"),
        ('environment = "target"\nroad = 3', "road: '3'; allowed: a table [road]"),
        ('environment = "target"\nradar.bandwith = 3', "radar.bandwith: 'an unknown key'; allowed: bandwidth, slope"),
        ("prior = ", "Invalid value"),
        # The paper's radar, over which these are written, is not built first.
        ('environment = "target"\nradar.density = 1e6', "radar.density: 1000000.0; allowed: at most 100000 objects"),
        ('environment = "source"\nradar.bank_size = 1000000', "radar.bank_size: 1000000; allowed: at most "),
        ('environment = "source"\nradar.bandwidth = [0.5, 0.5]', "radar.bandwidth: [0.5, 0.5]; allowed: numbers"),
        ("a = " + "[" * 3000, "nested too deeply; allowed: "),
    ],
)  # fmt: skip
def test_refusals_name_file_field_value_and_what_is_allowed(text, message, tmp_path):
    path = tmp_path / "env.toml"
    path.write_text(text)
    with nothing_compiles(), pytest.raises(ValueError, match=re.escape(f"{path}: {message}")):
        jrcjax.load_params(path)


@pytest.mark.parametrize("slots", ["[0, 99]", "[99, 99, 99]", "99", "[[99, 99]]"])
def test_wrong_slots_for_objects_are_refused(slots):
    with pytest.raises(ValueError, match=r"radar\.max_objects: .*; allowed: "):
        from_toml(edited("bank_size = 64", f"bank_size = 64\nmax_objects = {slots}"))


def test_bad_parameters_are_refused_before_the_file_is_touched(tmp_path):
    path = tmp_path / "env.toml"
    with pytest.raises(ValueError, match="event_model"):
        jrcjax.save_params(path, tiny_params().replace(event_model=jnp.int32(9)))
    assert not path.exists()


def test_a_missing_file_is_an_oserror(tmp_path):
    with pytest.raises(FileNotFoundError):
        jrcjax.load_params(tmp_path / "none.toml")
