import functools

import jax
import numpy as np
import pytest

from jrcjax.learners.networks import QNetwork, initial_kernels
from jrcjax.learners.q_function import QFunction
from jrcjax.readings import Initialiser

AXES = {"in_axis": 1, "out_axis": 0}
OF_JAX = {
    Initialiser.LECUN_NORMAL: jax.nn.initializers.lecun_normal(**AXES),
    Initialiser.GLOROT_UNIFORM: jax.nn.initializers.glorot_uniform(**AXES),
    Initialiser.HE_NORMAL: jax.nn.initializers.he_normal(**AXES),
}


def initial_kernel(key, shape, choice=0):
    (kernel,) = initial_kernels([key], [shape], choice)
    return kernel


@pytest.mark.parametrize("choice", Initialiser, ids=Initialiser.names())
@pytest.mark.parametrize("shape", [(24, 5), (4, 24), (40, 24), (1, 1)], ids=str)
def test_kernels_are_those_of_jax(choice, shape):
    keys = jax.random.split(jax.random.key(7), 50)
    found = jax.jit(jax.vmap(functools.partial(initial_kernel, shape=shape, choice=choice)))(keys)
    wanted = jax.jit(jax.vmap(functools.partial(OF_JAX[choice], shape=shape)))(keys)
    np.testing.assert_array_equal(found, wanted)


def test_the_choice_may_be_traced():
    key, shape = jax.random.key(3), (24, 5)
    found = jax.jit(jax.vmap(functools.partial(initial_kernel, key, shape)))(np.arange(3))
    wanted = [jax.jit(functools.partial(OF_JAX[choice], shape=shape))(key) for choice in Initialiser]
    np.testing.assert_array_equal(found, wanted)


@pytest.mark.parametrize(
    "hidden", [(24,), (24, 24), (3,) * 11], ids=["one", "two", "eleven, whose names sort otherwise"]
)
def test_a_networks_weights_are_those_that_flax_draws_layer_by_layer(hidden):
    key, network = jax.random.key(5), QNetwork(4, hidden)
    found = jax.jit(QFunction(network, (2, 2, 2, 2, 2), True).init)(key)
    by_flax = network.clone(kernel_init=OF_JAX[Initialiser.LECUN_NORMAL])
    wanted = jax.jit(by_flax.init)(key, np.zeros((5, 1), np.float32))
    jax.tree.map(np.testing.assert_array_equal, found, wanted)


def test_kernels_have_32_bits_where_64_are_allowed():
    with jax.enable_x64(True):
        assert initial_kernel(jax.random.key(0), (4, 3), 1).dtype == np.float32
