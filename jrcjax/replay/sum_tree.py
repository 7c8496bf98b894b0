"""A sum tree: values that are drawn in proportion to their size, and replaced, in logarithmic time.

All nodes lie in one array. A row holds the values of one node's children, so that one look-up fetches all of them and
touches one cache line. The rows of one level follow each other, the parents of the leaves first. With 10 leaves a to j,
2 children per node, and levels of at most 3 rows not stored:

    row            level                     holds
    0 1 2 3 4      0, parents of leaves      a b | c d | e f | g h | i j
    (0 1 2)        1, the top                0 1 | 2 3 | 4 .       sums of rows 0 to 4; the last column is empty

Leaf i lies in row i // 2, column i % 2; the sum of that row lies in row (i // 2) // 2 of the level above, column
(i // 2) % 2. Levels of few rows are added up anew from the level below for every draw, all of their sums at once, which
costs less than to keep them. The tree ends where a level has very few rows, which are searched all at once. Nodes are
always recomputed from their children and never adjusted by differences: rounding can't pile up, however many updates
there are.
"""

from __future__ import annotations

import functools
import itertools
import operator
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jrcjax import rng
from jrcjax.replay import lookup
from jrcjax.types import Float, Int, Words

_TOP_ROWS = 16  # rows of the top level, at most
_STORED_ROWS = 256  # a level above one of so many rows or fewer is not stored
NUM_WORDS = 2
"""Random words of one draw."""


class Layout(NamedTuple):
    """Where the nodes lie; levels count from the parents of the leaves upwards."""

    leaves: int
    children: int
    """Children per node, a power of two: the length of a row."""
    levels: tuple[int, ...]
    """Rows of each level, the top last."""
    first_row: tuple[int, ...]
    """Where each level that is stored begins."""

    @property
    def rows(self) -> int:
        """Rows that are stored."""
        return sum(self.levels[: len(self.first_row)])

    def parent(self, index: Int) -> Int:
        """The row, counted from its level's first one, in which child number `index` lies."""
        return index >> (self.children.bit_length() - 1)  # a division would take care of negative numbers

    def column(self, index: Int) -> Int:
        """Where in that row the child lies."""
        return index & (self.children - 1)


def layout_of(leaves: int, children: int = 4) -> Layout:
    """The tree over so many leaves; 4 and 8 children are faster than more for 12,500 leaves and 64 draws."""
    levels, size = [], leaves
    while not levels or size > _TOP_ROWS:
        size = -(-size // children)
        levels.append(size)
    stored = 1 + sum(size > _STORED_ROWS for size in levels[:-1])
    first_row = tuple(sum(levels[:level]) for level in range(stored))
    return Layout(leaves, children, tuple(levels), first_row)


def init(values: Float, layout: Layout) -> Float:
    """The tree with these leaves, [leaves] values >= 0, as [rows, children]."""
    levels = [_as_rows(values, layout)]
    for _ in layout.first_row[1:]:
        levels.append(_above(levels[-1], layout))
    return jnp.concatenate(levels)


def _as_rows(values: Float, layout: Layout) -> Float:
    return jnp.pad(values, (0, -values.shape[0] % layout.children)).reshape(-1, layout.children)


def _above(rows: Float, layout: Layout) -> Float:
    """The level above one with these rows."""
    return _as_rows(sum_of(rows), layout)


def leaves(tree: Float, indices: Int, layout: Layout) -> Float:
    """Values of the leaves with these indices; any shape."""
    return tree.at[layout.parent(indices), layout.column(indices)].get(mode="promise_in_bounds")


def total(tree: Float, layout: Layout) -> Float:
    """Sum of all leaves."""
    # Behind a barrier, since a sum that XLA joins with those of the levels below rounds differently.
    return jax.lax.optimization_barrier(_upper(tree, layout)[-1]).sum()


def _upper(tree: Float, layout: Layout) -> list[Float]:
    """The highest level that is stored, and all above it, up to the top."""
    levels = [tree[layout.first_row[-1] :]]
    for _ in layout.levels[len(layout.first_row) :]:
        levels.append(_above(levels[-1], layout))
    return levels


def sum_of(rows: Float) -> Float:
    """Sums of rows [..., children], written out so that XLA joins them with the look-up of the rows."""
    return functools.reduce(operator.add, (rows[..., k] for k in range(rows.shape[-1])))


def update(tree: Float, indices: Int, values: Float, layout: Layout) -> Float:
    """Gives the leaves `indices` [B] the values [B].

    If an index appears more than once the last of its values counts, on an accelerator any of them; every sum agrees
    with its leaves in either case.
    """
    *lower, top = (first_row * layout.children for first_row in layout.first_row)
    for begin in lower:
        tree = lookup.write(tree, begin + indices, values)
        indices = layout.parent(indices)
        values = sum_of(lookup.read(tree, begin + indices * layout.children, layout.children))
    return lookup.write(tree, top + indices, values)


def update_one(tree: Float, index: Int, value: Float, layout: Layout) -> Float:
    """Gives one leaf a value.

    With an `index` that is the same for all agents under vmap the tree is written in place.
    """
    # All rows on the path are read first and written together, which XLA does in place.
    indices = [index]
    for _ in layout.first_row[1:]:
        indices.append(layout.parent(indices[-1]))
    path = jnp.stack([first + layout.parent(i) for first, i in zip(layout.first_row, indices, strict=True)])
    rows = []
    for row, i in zip(tree.at[path].get(mode="promise_in_bounds"), indices, strict=True):
        rows.append(jnp.where(jnp.arange(layout.children) == layout.column(i), value, row))
        value = sum_of(rows[-1])
    return tree.at[path].set(jnp.stack(rows), mode="promise_in_bounds")


def sample(tree: Float, words: Words, layout: Layout) -> tuple[Int, Float, Float]:
    """Draws leaves in proportion to their values, with replacement.

    Args:
      tree: a tree whose positive leaves come first, at least one of them; the others are zero.
      words: [NUM_WORDS, B] random words.
      layout: the tree's layout.

    Returns:
      Indices of the leaves, their values, and how far into them the draws lie, [B] each.
    """
    *upper, top = _upper(tree, layout)
    node = _node_at(top, rng.uniform(words[0]))
    value = top.reshape(-1)[node]
    # Two words, since the 24 bits of one uniform number are too coarse for 50,000 leaves.
    rest = rng.uniform(words[1]) * value
    levels = [(level, 0) for level in upper[::-1]] + [(tree, first_row) for first_row in layout.first_row[-2::-1]]
    for rows, first_row in levels:
        child, value, rest = child_at(lookup.read(rows, (first_row + node) * layout.children, layout.children), rest)
        node = node * layout.children + child
    return node, value, rest


def _node_at(rows: Float, share: Float) -> Int:
    """Which of the values [N, children] lies at these shares [B] of their running sum, among the positive ones, [B]."""
    # Written out: XLA hands what it knows as running sums, or as products, to a library, away from its loops.
    within = jnp.stack(list(itertools.accumulate(rows.T)), axis=1)  # sums up to each value
    of_rows = list(itertools.accumulate(within[:, -1]))
    before = jnp.stack([jnp.zeros_like(of_rows[0]), *of_rows[:-1]])
    running = before[:, None] + within
    at = share * running[-1, -1]
    # Row by row, which leaves a short sum, and vectors of a row's length.
    passed = functools.reduce(operator.add, ((at[:, None] >= row[None]).astype(jnp.int32) for row in running))
    positive = (rows > 0).sum(dtype=jnp.int32)
    return jnp.minimum(passed.sum(axis=1), positive - 1)  # rounding must not lead past the last positive one


def child_at(children: Float, rest: Float) -> tuple[Int, Float, Float]:
    """Which of children [B, N] lies at `rest` [B] of their running sum; its value; how far into it."""
    # In one array of three rows, one for each result, which XLA computes in one loop; of three arrays it makes seven.
    shape = (3, *rest.shape)
    values = [jnp.broadcast_to(children[:, k], shape) for k in range(children.shape[1])]
    rest, child = jnp.broadcast_to(rest, shape), jnp.zeros(shape, jnp.float32)
    while len(values) > 1:
        half = len(values) // 2
        left, right = values[:half], values[half:]
        sum_left = functools.reduce(operator.add, left)
        beyond = (rest >= sum_left) & (right[0] > 0)  # rounding must not lead past the last positive one
        child = jnp.where(beyond, child + half, child)
        rest = jnp.where(beyond, rest - sum_left, rest)
        values = [jnp.where(beyond, *pair) for pair in zip(right, left, strict=True)]
    result = jax.lax.broadcasted_iota(jnp.int32, shape, 0)
    child, value, rest = jnp.where(result == 0, child, jnp.where(result == 1, values[0], rest))
    return child.astype(jnp.int32), value, rest
