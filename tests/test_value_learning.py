import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jrcjax import value_learning

Q = jnp.asarray([[1.0, 5.0, 2.0], [4.0, 0.0, 3.0]])


def test_double_q_value_chooses_with_one_table_and_reads_the_other():
    other = jnp.asarray([[10.0, 20.0, 30.0], [40.0, 50.0, 60.0]])
    # The largest of `other` itself are 30 and 60.
    assert value_learning.double_q_value(Q, other).tolist() == [20.0, 40.0]


def test_double_q_value_takes_the_first_of_equals():
    assert value_learning.double_q_value(jnp.asarray([[7.0, 7.0]]), jnp.asarray([[1.0, 2.0]])).tolist() == [1.0]


def test_double_q_value_against_a_loop():
    generator = np.random.default_rng(0)
    online, target = generator.normal(size=(2, 50, 4)).astype(np.float32)
    wanted = [target[i][max(range(4), key=online[i].__getitem__)] for i in range(50)]
    assert value_learning.double_q_value(jnp.asarray(online), jnp.asarray(target)).tolist() == wanted


def test_td_target():
    assert float(value_learning.td_target(jnp.float32(-3.0), jnp.float32(0.5), jnp.float32(8.0))) == 1.0
    assert float(value_learning.td_target(jnp.float32(-3.0), jnp.float32(0.0), jnp.float32(8.0))) == -3.0


def test_squared_td_loss_is_the_mean_of_squares_without_a_factor():
    assert float(value_learning.squared_td_loss(jnp.asarray([1.0, -2.0, 3.0, 0.0]))) == 3.5
    gradient = jax.grad(value_learning.squared_td_loss)(jnp.asarray([1.0, -2.0, 3.0, 0.0]))
    assert gradient.tolist() == [0.5, -1.0, 1.5, 0.0]


def test_q_learning_error():
    error = value_learning.q_learning_error(
        Q, jnp.int32(0), jnp.int32(2), jnp.float32(10.0), jnp.int32(1), jnp.float32(0.5)
    )
    assert float(error) == 10.0 + 0.5 * 4.0 - 2.0


@pytest.mark.parametrize("exponent", [0.51, 0.7, 1.0])
def test_robbins_monro_step_is_a_power_of_the_visits(exponent):
    visits = np.array([1, 2, 10, 1000, 10**6])
    steps = value_learning.robbins_monro_step(jnp.asarray(visits, jnp.int32), jnp.float32(exponent))
    # Rounding of the exponent to float32 is multiplied by log n < 14: 14 * 6e-8 < 1e-6.
    np.testing.assert_allclose(steps, visits.astype(float) ** -exponent, rtol=2e-6)
    assert float(steps[0]) == 1.0


@pytest.mark.parametrize("exponent", [0.51, 0.7, 1.0])
def test_robbins_monro_steps_satisfy_equation_14(exponent):
    """Sums up to N lie where integrals of n^-e put them: without bound for the steps, bounded for their squares."""
    n = 10**6
    steps = np.asarray(value_learning.robbins_monro_step(jnp.arange(1, n + 1), jnp.float32(exponent)), np.float64)
    assert (steps > 0).all()
    assert (steps <= 1).all()
    diverging = np.log(n + 1) if exponent == 1.0 else ((n + 1) ** (1 - exponent) - 1) / (1 - exponent)
    assert steps.sum() >= diverging * (1 - 1e-5)
    assert np.square(steps).sum() <= 1 + 1 / (2 * exponent - 1)


def test_robbins_monro_step_before_the_first_visit_is_finite():
    assert float(value_learning.robbins_monro_step(jnp.int32(0), jnp.float32(0.7))) == 1.0
