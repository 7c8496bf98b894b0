"""Rows of packed words: they take as little room as the ids fit, and give back what was put in."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jrcjax.replay import packing, prioritised, uniform
from jrcjax.replay.n_step import NStepTransition
from jrcjax.replay.packing import NUMBER, SWITCH, Power

GAMMA = 0.75
PAPER = (2**5, 4)  # states and actions of the paper's problem
NUMBERS = {"reward", "n_return"}
FLOATS = NUMBERS | {"discount", "n_discount"}
N = 10
SIZES = [1, 2, 3, 32, 1000, 2**15, 10**6, 2**31 - 1]
LAYOUTS = {
    "uniform": uniform.layout_of,
    "prioritised": lambda states, actions: prioritised.layout_of(states, actions, 4, 2, N).rows,
}
# A few fields of any sort in any order; layouts know no more of a NamedTuple than that.
NO_IDS = st.sampled_from([NUMBER, SWITCH, Power(1), Power(20)])
ANY_SIZES = st.lists(st.one_of(NO_IDS, st.sampled_from(SIZES), st.integers(1, 2**31 - 1)), min_size=1, max_size=8)


def fields_of(*values) -> tuple:
    """Stands for a NamedTuple of any length."""
    return values


def assert_fields_lie_apart(layout: packing.Layout, sizes) -> None:
    """Every id has room for its largest value, every number a word of its own, no bit is used twice."""
    taken = [0] * layout.words
    for place, size in zip(layout.places, sizes, strict=True):
        if size == NUMBER:
            assert (place.shift, place.bits) == (0, 32)
        else:
            ids = 2 if size == SWITCH else size.ids if isinstance(size, Power) else size
            assert ids - 1 < 2**place.bits
        mask = (2**place.bits - 1) << place.shift
        assert mask < 2**32
        assert not taken[place.word] & mask
        taken[place.word] |= mask


@pytest.mark.parametrize(
    ("states", "actions", "words"),
    [(*PAPER, 2), (1, 1, 2), (2**14, 4, 2), (2**15, 4, 3), (2**16, 2**15, 3), (2**31 - 1, 4, 4)],
)
def test_transitions_take_as_few_words_as_the_ids_fit(states, actions, words):
    layout = uniform.layout_of(states, actions)
    assert layout.kind is uniform.Transition
    assert layout.words == words
    assert uniform.init(3, layout).shape == (3, words)
    assert_fields_lie_apart(layout, (states, actions, NUMBER, states, SWITCH))


@pytest.mark.parametrize(
    ("states", "actions", "words"),
    [(*PAPER, 3), (1, 1, 3), (2**7, 8, 3), (2**9, 8, 4), (2**14, 4, 4), (2**31 - 1, 4, 7)],
)
def test_n_step_transitions_take_as_few_words_as_the_ids_fit(states, actions, words):
    layout = prioritised.layout_of(states, actions, 4, 2, N).rows
    assert layout.kind is NStepTransition
    assert [place.bits == 32 for place in layout.places] == [name in NUMBERS for name in NStepTransition._fields]
    assert layout.words == words
    assert_fields_lie_apart(layout, (states, actions, NUMBER, states, SWITCH, NUMBER, Power(N), states))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(sizes=ANY_SIZES)
def test_fields_lie_apart(sizes):
    assert_fields_lie_apart(packing.layout_of(fields_of, tuple(sizes)), sizes)


def some_ids(size: int):
    return st.one_of(st.integers(0, size - 1), st.just(size - 1))  # the largest id has all bits in use


def some_fields(data, kind, states: int, actions: int):
    ids = {"action": some_ids(actions), "discount": st.sampled_from([0.0, GAMMA])}
    ids["n_discount"] = st.sampled_from([0.0, *(GAMMA**k for k in range(N + 1))])
    numbers = st.floats(width=32, allow_nan=False)
    return kind(*(data.draw(numbers if f in NUMBERS else ids.get(f, some_ids(states))) for f in kind._fields))


@pytest.mark.parametrize("name", LAYOUTS)
@settings(max_examples=80, deadline=None, derandomize=True)
@given(st.data(), st.sampled_from(SIZES), st.integers(1, 70_000))
def test_pack_and_unpack_are_inverse(name, data, states, actions):
    layout = LAYOUTS[name](states, actions)
    value = some_fields(data, layout.kind, states, actions)
    row = packing.pack(value, layout, GAMMA)
    assert row.shape == (layout.words,)
    assert row.dtype == jnp.uint32
    back = packing.unpack(row, layout, GAMMA)
    assert isinstance(back, layout.kind)
    for field, name_of_field in zip(back, back._fields, strict=True):
        assert field.dtype == (jnp.float32 if name_of_field in FLOATS else jnp.int32)
    assert tuple(np.asarray(field).item() for field in back) == value


@pytest.mark.parametrize("name", LAYOUTS)
@pytest.mark.parametrize("shape", [(7,), (2, 3), (0,)])
def test_rows_of_many(name, shape):
    layout = LAYOUTS[name](32, 4)
    rng = np.random.default_rng(0)
    number = lambda: rng.normal(size=shape).astype(np.float32)  # noqa: E731
    value = layout.kind(*(number() if f in NUMBERS else rng.integers(0, 2, shape) for f in layout.kind._fields))
    value = value._replace(discount=value.discount * np.float32(GAMMA))
    rows = packing.pack(value, layout, GAMMA)
    assert rows.shape == (*shape, layout.words)
    for got, wanted in zip(packing.unpack(rows, layout, GAMMA), value, strict=True):
        np.testing.assert_array_equal(got, wanted)


@pytest.mark.parametrize("bits", [0, 1, 0x7F800000, 0xFF800000, 0x7FC00001, 0x80000000])
def test_numbers_keep_their_bits(bits):
    layout = uniform.layout_of(32, 4)
    number = np.uint32(bits).view(np.float32)  # subnormal, infinite, NaN with a payload, -0
    back = packing.unpack(packing.pack(uniform.Transition(31, 3, number, 31, 1), layout), layout)
    assert np.asarray(back.reward).view(np.uint32) == bits


@pytest.mark.parametrize("gamma", [0.0, 0.3, 0.9, 0.99, 0.999])
@pytest.mark.parametrize("most", [1, 10, 20])
def test_powers_are_those_that_returns_multiply(gamma, most):
    layout = packing.layout_of(fields_of, (Power(most),))
    powers = [np.float32(1.0)]
    for _ in range(most):
        powers.append(powers[-1] * np.float32(gamma))
    for number in (*powers, np.float32(0.0)):
        (back,) = packing.unpack(packing.pack((number,), layout, np.float32(gamma)), layout, np.float32(gamma))
        assert back == number
    # How many steps a return has is kept, whatever their discount was.
    for steps in range(1, most + 1) if gamma else ():
        (back,) = packing.unpack(packing.pack((powers[steps],), layout, np.float32(gamma)), layout, np.float32(0.5))
        assert back == 0.5**steps
