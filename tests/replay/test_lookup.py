"""Reads and writes of tables against NumPy, for one agent, for many, and for what many have in common."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jrcjax.replay import lookup

ROWS, WIDTH, BATCH = 6, 4, 5
AXES = {"agents": (3,), "points and agents": (2, 3)}


def written(table, places, words):
    """What NumPy makes of it; the last word counts where places are the same."""
    flat = np.array(table).reshape(-1)
    for place, word in zip(places, words, strict=True):
        flat[place] = word
    return flat.reshape(np.shape(table))


@pytest.fixture
def random():
    return np.random.default_rng(0)


def test_read_gives_the_words_from_each_place_on(random):
    table = random.random((ROWS, WIDTH), np.float32)
    places = random.integers(0, ROWS * WIDTH - 2, BATCH)
    wanted = [table.reshape(-1)[place : place + 3] for place in places]
    np.testing.assert_array_equal(lookup.read(jnp.asarray(table), jnp.asarray(places), 3), wanted)


def test_write_changes_these_places_alone(random):
    table = random.random((ROWS, WIDTH), np.float32)
    places, words = random.permutation(ROWS * WIDTH)[:BATCH], random.random(BATCH, np.float32)
    got = lookup.write(jnp.asarray(table), jnp.asarray(places), jnp.asarray(words))
    np.testing.assert_array_equal(got, written(table, places, words))


@pytest.mark.parametrize("common", [(), (0,), (1,), (2,), (0, 1)], ids=str)
@pytest.mark.parametrize("axes", AXES.values(), ids=AXES)
def test_write_for_many_agents_is_one_after_the_other(random, axes, common):
    shapes = ((ROWS, WIDTH), (BATCH,), (BATCH,))
    sizes = [() if i in common else axes for i in range(3)]
    table = random.random(sizes[0] + shapes[0], np.float32)
    places = np.stack([random.permutation(ROWS * WIDTH)[:BATCH] for _ in range(int(np.prod(sizes[1])))])
    places = places.reshape(sizes[1] + shapes[1])
    words = random.random(sizes[2] + shapes[2], np.float32)
    write = lookup.write
    for _ in axes:
        write = jax.vmap(write, in_axes=[None if i in common else 0 for i in range(3)])
    got = jax.jit(write)(table, places, words)
    each = [np.broadcast_to(x, axes + shape) for x, shape in zip((table, places, words), shapes, strict=True)]
    for agent in np.ndindex(axes):
        np.testing.assert_array_equal(got[agent], written(*(x[agent] for x in each)))


def test_tables_too_large_for_one_number_keep_to_themselves():
    agents, words = 4, 2**30
    table = jax.ShapeDtypeStruct((agents, words // WIDTH, WIDTH), jnp.float32)
    batch = [jax.ShapeDtypeStruct((agents, BATCH), kind) for kind in (jnp.int32, jnp.float32)]
    text = jax.jit(jax.vmap(lookup.write)).lower(table, *batch).as_text()
    assert f"tensor<{agents}x{words}xf32>" in text
    assert f"tensor<{agents * words}xf32>" not in text
