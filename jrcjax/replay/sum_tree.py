"""A sum tree: values that are drawn in proportion to their size, and replaced, in logarithmic time.

All nodes lie in one array with the values of a node's children in its row, so that one look-up fetches all children and
touches one cache line. The tree ends where a level has few rows, which are searched all at once. Nodes are always
recomputed from their children and never adjusted by differences: rounding can't pile up, however many updates there
are.
"""

from __future__ import annotations

import functools
import operator
from typing import NamedTuple

import jax.numpy as jnp

from jrcjax import rng
from jrcjax.types import Float, Int, Words

RADIX = 4
"""Children per node, a power of two; of 4, 8, 16 and 32 the fastest for 50,000 leaves, 64 draws and 64 updates."""
_TOP_ROWS = 16  # rows of the top level, at most
NUM_WORDS = 2
"""Random words of one draw."""


class Layout(NamedTuple):
    """Where the nodes lie; levels count from the parents of the leaves upwards."""

    leaves: int
    first_node: tuple[int, ...]
    """Row of each level's first node."""
    nodes: int
    """Rows of the array."""


def layout(leaves: int) -> Layout:
    """The tree over so many leaves."""
    first_node, nodes, size = [], 0, leaves
    while not first_node or size > _TOP_ROWS:
        size = -(-size // RADIX)
        first_node.append(nodes)
        nodes += size
    return Layout(leaves, tuple(first_node), nodes)


def init(values: Float, where: Layout) -> Float:
    """The tree with these leaves, [leaves] values >= 0, as [nodes, RADIX]."""
    levels = []
    for _ in where.first_node:
        rows = jnp.pad(values, (0, -values.shape[0] % RADIX)).reshape(-1, RADIX)
        levels.append(rows)
        values = rows.sum(axis=-1)
    return jnp.concatenate(levels)


def leaves(tree: Float, indices: Int) -> Float:
    """Values of the leaves with these indices; any shape."""
    return tree.at[_row(indices), _column(indices)].get(mode="promise_in_bounds")


def total(tree: Float, where: Layout) -> Float:
    """Sum of all leaves."""
    return _top(tree, where).sum()


def _top(tree: Float, where: Layout) -> Float:
    return tree[where.first_node[-1] :]


def _row(index: Int) -> Int:
    """A child's parent; a division would take care of negative numbers."""
    return index >> (RADIX.bit_length() - 1)


def _column(index: Int) -> Int:
    return index & (RADIX - 1)


def _sum(rows: Float) -> Float:
    """Sums of rows [..., RADIX], written out so that XLA joins them with the look-up of the rows."""
    return functools.reduce(operator.add, (rows[..., k] for k in range(RADIX)))


def update(tree: Float, indices: Int, values: Float, where: Layout) -> Float:
    """Gives the leaves `indices` [B] the values [B].

    If an index appears more than once the last of its values counts, on an accelerator any of them; every sum agrees
    with its leaves in either case.
    """
    *lower, top = where.first_node
    for first_node in lower:
        row = first_node + _row(indices)
        tree = tree.at[row, _column(indices)].set(values, mode="promise_in_bounds")
        values = _sum(tree.at[row].get(mode="promise_in_bounds"))
        indices = _row(indices)
    return tree.at[top + _row(indices), _column(indices)].set(values, mode="promise_in_bounds")


def update_one(tree: Float, index: Int, value: Float, where: Layout) -> Float:
    """Gives one leaf a value.

    With an `index` that is the same for all agents under vmap the tree is written in place.
    """
    # All nodes on the path are read first and written together, which XLA does in place.
    indices = [index]
    for _ in where.first_node[1:]:
        indices.append(_row(indices[-1]))
    path = jnp.stack([first_node + _row(i) for first_node, i in zip(where.first_node, indices, strict=True)])
    rows = []
    for children, i in zip(tree.at[path].get(mode="promise_in_bounds"), indices, strict=True):
        rows.append(jnp.where(jnp.arange(RADIX) == _column(i), value, children))
        value = _sum(rows[-1])
    return tree.at[path].set(jnp.stack(rows), mode="promise_in_bounds")


def sample(tree: Float, words: Words, where: Layout) -> tuple[Int, Float]:
    """Draws leaves in proportion to their values, with replacement.

    Args:
      tree: a tree whose positive leaves come first, at least one of them; the others are zero.
      words: [NUM_WORDS, B] random words.
      where: the tree's layout.

    Returns:
      Indices of the leaves and their values, [B] each.
    """
    *lower, _ = where.first_node
    top = _top(tree, where)
    node = _node_at(top, rng.uniform(words[0]))
    value = top.reshape(-1)[node]
    # Two words, since the 24 bits of one uniform number are too coarse for 50,000 leaves.
    rest = rng.uniform(words[1]) * value
    for first_node in reversed(lower):
        child, value, rest = _child_at(tree.at[first_node + node].get(mode="promise_in_bounds"), rest)
        node = node * RADIX + child
    return node, value


def _node_at(rows: Float, share: Float) -> Int:
    """Which of the values [N, RADIX] lies at these shares [B] of their running sum, among the positive ones, [B]."""
    within = rows @ jnp.triu(jnp.ones((RADIX, RADIX)))  # sums up to each value
    before = jnp.tril(jnp.ones((rows.shape[0],) * 2), -1) @ within[:, -1]
    running = before[:, None] + within
    at = share * running[-1, -1]
    # Row by row, which leaves a short sum, and vectors of a row's length.
    passed = functools.reduce(operator.add, ((at[:, None] >= row[None]).astype(jnp.int32) for row in running))
    positive = (rows > 0).sum(dtype=jnp.int32)
    return jnp.minimum(passed.sum(axis=1), positive - 1)  # rounding must not lead past the last positive one


def _child_at(children: Float, rest: Float) -> tuple[Int, Float, Float]:
    """Which of children [B, RADIX] lies at `rest` [B] of their running sum; its value; how far into it."""
    values = [children[:, k] for k in range(RADIX)]
    child = jnp.zeros(rest.shape, jnp.int32)
    while len(values) > 1:
        half = len(values) // 2
        left, right = values[:half], values[half:]
        sum_left = functools.reduce(operator.add, left)
        beyond = (rest >= sum_left) & (right[0] > 0)  # rounding must not lead past the last positive one
        child = jnp.where(beyond, child + half, child)
        rest = jnp.where(beyond, rest - sum_left, rest)
        values = [jnp.where(beyond, *pair) for pair in zip(right, left, strict=True)]
    return child, values[0], rest
