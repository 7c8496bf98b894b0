import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jrcjax import rng

LARGEST = 2**32 - 1
WORDS = st.integers(0, LARGEST)


def exact_index(word: int, n: int) -> int:
    return (word * n) >> 32


@settings(max_examples=300, deadline=None, derandomize=True)
@given(word=WORDS, n=st.integers(1, 2**31 - 1))
def test_index_is_the_high_half_of_the_product(word, n):
    assert int(rng.index(jnp.uint32(word), n)) == exact_index(word, n)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 64, 4096, 50_000, 65_535, 65_536, 65_537, 2**24 + 1, 2**31 - 1])
def test_index_over_many_words_and_at_the_edges(n):
    edges = [0, 1, 0xFFFF, 0x10000, 0x10001, 2**31 - 1, 2**31, LARGEST - 1, LARGEST]
    # Words beside which the index changes: the smallest of each index, and the one before it.
    steps = [-(-i * 2**32 // n) for i in {1, n // 2, n - 1} if 0 < i < n]
    random = np.random.default_rng(n).integers(0, 2**32, 20_000)
    words = [*edges, *steps, *(s - 1 for s in steps), *map(int, random)]
    got = np.asarray(rng.index(jnp.asarray(words, jnp.uint32), n))
    assert got.tolist() == [exact_index(w, n) for w in words]
    assert got.min() >= 0
    assert got.max() < n


def test_index_with_a_traced_n_of_either_type():
    words = jax.random.bits(jax.random.key(0), (100,), jnp.uint32)
    wanted = [exact_index(int(w), 27) for w in words]
    assert jax.jit(rng.index)(words, jnp.int32(27)).tolist() == wanted
    assert jax.jit(rng.index)(words, jnp.uint32(27)).tolist() == wanted


def test_index_is_an_int32():
    assert rng.index(jnp.uint32(5), 3).dtype == jnp.int32


@settings(max_examples=200, deadline=None, derandomize=True)
@given(word=WORDS)
def test_uniform_is_the_upper_24_bits_as_a_fraction(word):
    assert float(rng.uniform(jnp.uint32(word))) == (word >> 8) / 2**24


def test_uniform_reaches_0_but_never_1():
    u = rng.uniform(jnp.asarray([0, LARGEST], jnp.uint32))
    assert u.dtype == jnp.float32
    assert float(u[0]) == 0.0
    assert float(u[1]) == 1.0 - 2.0**-24 < 1.0


@pytest.mark.parametrize("shape", [(), (1,), (7,), (300, 73)])
def test_bits_are_those_of_jax(shape):
    keys = jax.random.split(jax.random.key(3), 5)
    wanted = jax.vmap(lambda key: jax.random.bits(key, shape, jnp.uint32))(keys)
    np.testing.assert_array_equal(jax.vmap(lambda key: rng.bits(key, shape))(keys), wanted)


def test_bits_of_another_generator():
    key = jax.random.key(3, impl="rbg")
    np.testing.assert_array_equal(rng.bits(key, (9,)), jax.random.bits(key, (9,), jnp.uint32))


@pytest.mark.parametrize("generator", ["threefry2x32", "rbg"])
def test_bits_of_several_are_those_of_one_after_the_other(generator):
    keys, sizes = jax.random.split(jax.random.key(1, impl=generator), 3), (5, 1, 32)
    wanted = np.concatenate([rng.bits(key, (size,)) for key, size in zip(keys, sizes, strict=True)])
    np.testing.assert_array_equal(jax.jit(lambda keys: rng.bits_of_several(list(keys), sizes))(keys), wanted)
