"""The sum tree beside a plain array of its leaves, which is all that it stands for."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from significance import ALPHA, chi_square

from jrcjax.replay import sum_tree

RADIX = 4  # children per node
# Below, at and above every size at which a level or a node begins.
SIZES = [1, 2, 3, 4, 5, 64, 65, 256, 257, 1024, 1025, 4096, 4097, 16_384, 16_385, 50_000]
# A sum of RADIX numbers >= 0, in any order.
RTOL = RADIX * float(np.finfo(np.float32).eps)
LARGEST_WORD = 2**32 - 1

INIT = jax.jit(sum_tree.init, static_argnums=1)
UPDATE = jax.jit(sum_tree.update, static_argnums=3)
UPDATE_ONE = jax.jit(sum_tree.update_one, static_argnums=3)
SAMPLE = jax.jit(lambda *args: sum_tree.sample(*args)[:2], static_argnums=2)


def f32(values) -> jax.Array:
    return jnp.asarray(values, jnp.float32)


def assert_stands_for(tree, layout, leaves: np.ndarray, rtol: float) -> None:
    """The tree has these leaves, and every node is the sum of its children, in all levels that are stored."""
    assert tree.shape == (layout.rows, RADIX)
    assert layout.first_row[0] == 0
    rows, children = np.asarray(tree, np.float64), leaves.astype(np.float32).astype(np.float64)
    np.testing.assert_array_equal(rows.ravel()[: layout.leaves], children)
    sizes = np.diff([*layout.first_row, layout.rows])
    assert sizes.tolist() == list(layout.levels[: len(sizes)])
    assert all(size > 256 for size in sizes[:-1])  # what is above few rows is not stored
    assert sizes[-1] <= 256 or len(sizes) == len(layout.levels)
    for first, end in zip(layout.first_row, [*layout.first_row[1:], layout.rows], strict=True):
        stored = rows[first:end].ravel()
        np.testing.assert_allclose(stored[: len(children)], children, rtol=rtol)
        assert not stored[len(children) :].any()  # what fills the last row
        assert end - first == -(-len(children) // RADIX)
        children = rows[first:end].sum(axis=1)
    assert layout.levels[-1] <= 16


@partial(jax.jit, static_argnums=0)
def everything(layout, values, batches, single):
    """Trees, leaves and totals: at first, after each batch, and after the single update that follows it."""

    def look(tree):
        return tree, sum_tree.leaves(tree, jnp.arange(layout.leaves), layout), sum_tree.total(tree, layout)

    def one_round(tree, operations):
        (indices, new), (index, value) = operations
        between = sum_tree.update(tree, indices, new, layout)
        after = sum_tree.update_one(between, index, value, layout)
        return after, (look(between), look(after))

    start = sum_tree.init(values, layout)
    return look(start), jax.lax.scan(one_round, start, (batches, single))[1]


def drive(leaves: int, rng: np.random.Generator, values, rtol: float, rounds: int = 6) -> None:
    """The same random operations on a tree and on an array."""
    layout = sum_tree.layout_of(leaves)
    twin = values(leaves)
    # Half of a batch is crowded into a few leaves, so that there are duplicates, also with many leaves.
    shape = (rounds, 16)
    few = rng.integers(0, leaves, 3)
    indices = np.where(rng.random(shape) < 0.5, rng.choice(few, shape), rng.integers(0, leaves, shape))
    new, index, value = values(shape), rng.integers(0, leaves, rounds), values(rounds)
    start, later = everything(layout, f32(twin), (jnp.asarray(indices), f32(new)), (jnp.asarray(index), f32(value)))

    def check(seen):
        tree, got, total = seen
        np.testing.assert_array_equal(got, f32(twin))
        assert_stands_for(tree, layout, twin, rtol)
        # Over the levels below the top, and the top's at most 16 rows.
        np.testing.assert_allclose(float(total), twin.sum(), rtol=(len(layout.levels) + 16) * rtol)

    check(start)
    for k in range(rounds):
        between, after = jax.tree.map(lambda x: x[k], jax.device_get(later))  # noqa: B023
        for i, x in zip(indices[k], new[k], strict=True):
            twin[i] = x  # of duplicates the last counts
        check(between)
        twin[index[k]] = value[k]
        check(after)


@pytest.mark.parametrize("leaves", SIZES)
def test_every_sum_is_exact_where_it_can_be(leaves):
    rng = np.random.default_rng(leaves)
    drive(leaves, rng, lambda n: rng.integers(0, 256, n).astype(np.float64), rtol=0.0)


@settings(max_examples=7, deadline=None, derandomize=True)
@given(leaves=st.one_of(st.integers(1, 5000), st.integers(1, 300)), seed=st.integers(0, 2**32 - 1))
def test_tree_against_an_array(leaves, seed):
    # Leaves over eleven decades: adjusting sums by differences would leave nothing right of the small ones.
    rng = np.random.default_rng(seed)
    large = lambda n: np.float32(10.0 ** rng.uniform(-3, 8, n))  # noqa: E731
    drive(leaves, rng, lambda n: large(n) * (rng.random(n) < 0.9).astype(np.float64), RTOL)


def test_small_leaves_come_back_after_a_large_one():
    layout = sum_tree.layout_of(300)
    before = INIT(jnp.full(300, 0.1), layout)
    for update in (lambda t, x: UPDATE(t, jnp.asarray([123]), f32([x]), layout),
                   lambda t, x: UPDATE_ONE(t, jnp.asarray(123), f32(x), layout)):  # fmt: skip
        after = update(update(before, 1e12), 0.1)
        np.testing.assert_allclose(after, before, rtol=RTOL)


def test_no_drift_in_a_million_updates():
    layout = sum_tree.layout_of(50_000)

    def one(tree, key):
        of_index, of_value = jax.random.split(key)
        indices = jax.random.randint(of_index, (64,), 0, layout.leaves)
        values = 10.0 ** jax.random.uniform(of_value, (64,), minval=-3.0, maxval=3.0)
        return sum_tree.update(tree, indices, values, layout), None

    keys = jax.random.split(jax.random.key(0), 16_000)
    tree = jax.jit(lambda tree: jax.lax.scan(one, tree, keys)[0])(INIT(jnp.ones(layout.leaves), layout))
    leaves = np.asarray(sum_tree.leaves(tree, jnp.arange(layout.leaves), layout))
    assert (leaves != 1.0).all()  # each was updated; 20 times on average
    np.testing.assert_allclose(float(sum_tree.total(tree, layout)), leaves.astype(np.float64).sum(), rtol=1e-6)
    assert_stands_for(tree, layout, leaves, RTOL)


@pytest.mark.parametrize("leaves", [5, 200, 700])
def test_update_of_one_leaf_of_many_trees(leaves):
    layout = sum_tree.layout_of(leaves)
    rng = np.random.default_rng(leaves)
    trees = jax.vmap(lambda values: sum_tree.init(values, layout))(f32(rng.integers(0, 256, (3, leaves))))
    index, values = jnp.int32(leaves - 2), f32([7.0, 0.0, 9.0])
    got = jax.jit(jax.vmap(lambda tree, i, x: sum_tree.update_one(tree, i, x, layout), (0, None, 0)))(
        trees, index, values
    )
    wanted = jax.vmap(lambda tree, x: sum_tree.update(tree, index[None], x[None], layout))(trees, values)
    np.testing.assert_array_equal(got, wanted)


def draws(tree, layout, count: int, seed: int) -> np.ndarray:
    """How often each leaf was drawn; what comes with an index must be the leaf's value."""
    words = jax.random.bits(jax.random.key(seed), (sum_tree.NUM_WORDS, count), jnp.uint32)
    indices, values = SAMPLE(tree, words, layout)
    assert indices.shape == values.shape == (count,)
    assert indices.min() >= 0
    assert indices.max() < layout.leaves
    np.testing.assert_array_equal(values, sum_tree.leaves(tree, indices, layout))
    return np.bincount(indices, minlength=layout.leaves)


@pytest.mark.parametrize(("leaves", "filled"), [(3, 3), (4, 4), (17, 17), (64, 40), (65, 65), (2000, 1100)])
def test_leaves_are_drawn_in_proportion_to_their_values(leaves, filled):
    layout = sum_tree.layout_of(leaves)
    values = np.zeros(leaves)
    values[:filled] = 10.0 ** np.random.default_rng(leaves).uniform(-3, 3, filled)
    counts = draws(INIT(f32(values), layout), layout, 400_000, leaves)
    assert chi_square(counts, values / values.sum()) > ALPHA


def test_leaves_of_the_papers_memory_are_drawn_in_proportion_to_their_values():
    layout = sum_tree.layout_of(50_000)
    values = 10.0 ** np.random.default_rng(1).uniform(-3, 3, layout.leaves)
    tree = INIT(f32(values), layout)
    counts = draws(tree, layout, 1_000_000, 1)
    # By neighbourhood, and by size: equal neighbours could hide a mistake in either.
    for order in (np.arange(layout.leaves), values.argsort()):
        bins = lambda x: x[order].reshape(500, 100).sum(axis=1)  # noqa: B023, E731
        assert chi_square(bins(counts), bins(values / values.sum())) > ALPHA
    # Within neighbourhoods, since one word chooses those and another the leaf: position among 1024.
    position = np.arange(layout.leaves) % RADIX ** (len(layout.levels) - 1)
    assert chi_square(np.bincount(position, counts), np.bincount(position, values / values.sum())) > ALPHA


def test_equal_leaves_are_drawn_uniformly_down_to_the_leaf():
    layout = sum_tree.layout_of(50_000)
    counts = draws(INIT(jnp.ones(layout.leaves), layout), layout, 500_000, 2)
    assert chi_square(counts, np.full(layout.leaves, 1 / layout.leaves)) > ALPHA


def test_draws_do_not_depend_on_each_other():
    layout = sum_tree.layout_of(4)
    words = jax.random.bits(jax.random.key(3), (sum_tree.NUM_WORDS, 200_000), jnp.uint32)
    values = np.array([1.0, 2.0, 3.0, 4.0])
    indices = np.asarray(SAMPLE(INIT(f32(values), layout), words, layout)[0]).reshape(-1, 2)
    pairs = np.bincount(indices[:, 0] * 4 + indices[:, 1], minlength=16)
    assert chi_square(pairs, np.outer(values, values).ravel() / 100.0) > ALPHA


EDGE_WORDS = [0, 1, 255, 256, 2**31 - 1, 2**31, LARGEST_WORD - 256, LARGEST_WORD - 255, LARGEST_WORD - 1, LARGEST_WORD]


@pytest.mark.parametrize("filled", [1, 2, 3, 4, 5, 15, 16, 17, 63, 64, 65, 255, 256, 257, 4095, 4096, 4097, 5000])
def test_zero_leaves_are_never_drawn(filled):
    layout = sum_tree.layout_of(5000)
    edges = np.array(np.meshgrid(EDGE_WORDS, EDGE_WORDS)).reshape(2, -1)
    random = jax.random.bits(jax.random.key(4), (sum_tree.NUM_WORDS, 4000), jnp.uint32)
    words = jnp.concatenate([jnp.asarray(edges, jnp.uint32), random], axis=1)
    for seed in range(8):  # sums are rounded in another way each time
        values = np.zeros(layout.leaves)
        values[:filled] = 10.0 ** np.random.default_rng(seed).uniform(-3, 3, filled)
        tree = INIT(f32(values), layout)
        indices, drawn = SAMPLE(tree, words, layout)
        assert indices.min() >= 0
        assert indices.max() < filled
        assert (drawn > 0).all()
        np.testing.assert_array_equal(drawn, f32(values)[indices])
        assert indices[0] == 0  # both words 0


@pytest.mark.parametrize("filled", [1, 2, 3, 4, 5, 63, 64, 65, 256, 257, 4096, 4097, 5000])
def test_first_and_last_leaf_are_reached(filled):
    layout = sum_tree.layout_of(5000)
    words = jnp.asarray([[0, LARGEST_WORD]] * sum_tree.NUM_WORDS, jnp.uint32)
    indices, _ = SAMPLE(INIT(f32(np.arange(layout.leaves) < filled), layout), words, layout)
    assert indices.tolist() == [0, filled - 1]
