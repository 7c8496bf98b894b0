"""Pictures of slots: what they show is what the slot did."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from matplotlib.collections import PatchCollection
from tiny import tiny_params

import jrcjax
from jrcjax import render
from jrcjax.model import slot
from jrcjax.radar.detection import merged_objects
from jrcjax.radar.placement import Footprints


def words_of(seed):
    return jax.random.bits(jax.random.key(seed), (slot.NUM_WORDS,), jnp.uint32)


@pytest.mark.parametrize(("placements", "mode"), [("bank", 0), ("bank", 1), ("fresh", 0)])
def test_the_scene_is_the_placement_behind_the_slots_miss_ratio(placements, mode):
    params = tiny_params()
    params = params.replace(radar=params.radar.replace(placements=placements))
    ratios = []
    for seed in range(8):
        words = words_of(seed)
        outcome = render._run_slot(words, jnp.int32(0), jnp.int32(params.num_rates + mode), params, jnp.int32(0))
        scene = render.scene_of(words[-1], mode, params)
        ratios.append(scene.merged.mean())
        np.testing.assert_allclose(scene.merged.mean(), outcome.miss_ratio, rtol=1e-6)
    assert len(set(ratios)) > 1


def test_merged_objects_by_hand():
    """Gaps of 0.5 and 1.5 m along a line, in an order that is not that of the positions; the last object is absent."""
    footprints = Footprints(
        centre=jnp.array([[10.0, 4.0], [10.0, 1.0], [10.0, 2.5], [10.0, 9.0], [10.0, 9.1]]),
        size=jnp.full((5, 2), 1.0),
        present=jnp.array([True, True, True, True, False]),
    )
    got = jax.jit(merged_objects)(footprints, jnp.float32(0.6), jnp.int32(0))
    np.testing.assert_array_equal(got, [True, True, True, False, False])
    got = merged_objects(footprints, jnp.float32(0.4), jnp.int32(0))
    np.testing.assert_array_equal(got, [False] * 5)


def test_the_scene_lies_in_the_square():
    params = tiny_params()
    scene = render.scene_of(words_of(0)[-1], 0, params)
    assert ((scene.centre >= [0, -scene.reach / 2]) & (scene.centre <= [scene.reach, scene.reach / 2])).all()
    np.testing.assert_allclose(scene.reach, 299792458 / 2 * 2e6 / 1e13, rtol=1e-6)
    np.testing.assert_allclose(scene.resolution, 299792458 / 2 / 300e6, rtol=1e-6)
    assert scene.centre.shape[0] == round(10 * (scene.reach / 45) ** 2)


def drawn(figure):
    """Rectangles drawn for objects, by group, and all text of the figure."""
    left, right = figure.axes
    groups = [len(c.get_paths()) for c in left.collections if isinstance(c, PatchCollection)]
    legend = [text.get_text() for text in left.get_legend().get_texts()] if left.get_legend() else []
    return groups, legend, [text.get_text() for text in right.texts]


def test_a_radar_slot():
    params = tiny_params()
    env, key, state = jrcjax.JRCEnv(), jax.random.key(3), jrcjax.EnvState(jnp.int32(9), jnp.int32(0), jnp.int32(9))
    _, _, reward, _, info = env.step_env(key, state, 4, params)
    figure = render.slot_figure(key, state, 4, params)
    groups, legend, texts = drawn(figure)
    count = sum(groups)
    assert groups[1] / count == pytest.approx(float(info["miss_ratio"]))
    assert legend == [f"resolved ({groups[0]})", f"merged with a neighbour ({groups[1]})"]
    assert f"missed: {float(info['miss_ratio']):.0%} of the objects" in texts
    assert f"reward {float(reward):+.2f}" in texts
    assert ("an unexpected event" in texts) == bool(info["event"])
    assert texts[:2] == ["state 9: level of each factor", "channel"]


def test_a_data_slot_detects_nothing():
    params = tiny_params()
    groups, legend, texts = drawn(render.slot_figure(jax.random.key(0), 0, 2, params))
    assert len(groups) == 1
    assert legend == [f"not detected: the radar is off ({groups[0]})"]
    assert "missed: 100% of the objects" in texts
    assert "data: 4 packets delivered" in texts


def test_before_the_first_slot():
    figure = render.figure_of_words(None, 5, None, tiny_params())
    groups, legend, texts = drawn(figure)
    assert (groups, legend) == ([], [])
    assert not any("reward" in text for text in texts)


def test_pixels():
    picture = render.rgb_array(render.slot_figure(jax.random.key(0), 35, 4, tiny_params()))
    assert picture.dtype == np.uint8
    assert picture.shape == (560, 900, 3)


@pytest.mark.parametrize(("state", "action", "field"), [(36, 0, "state"), (-1, 0, "state"), (0, 5, "action")])
def test_refusals(state, action, field):
    with pytest.raises(ValueError, match=f"{field}: .*; allowed: an integer from 0 to"):
        render.slot_figure(jax.random.key(0), state, action, tiny_params())
