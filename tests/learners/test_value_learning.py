import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jrcjax.learners import schedules, value_learning
from jrcjax.learners.hparams import HParams
from jrcjax.readings import Exploration, ImportanceOver, Loss

Q = jnp.asarray([[1.0, 5.0, 2.0], [4.0, 0.0, 3.0]])


def test_double_q_value_chooses_with_one_table_and_reads_the_other():
    other = jnp.asarray([[10.0, 20.0, 30.0], [40.0, 50.0, 60.0]])
    # The largest of `other` itself are 30 and 60.
    assert jax.vmap(value_learning.double_q_value)(Q, other).tolist() == [20.0, 40.0]


def test_double_q_value_takes_the_first_of_equals():
    assert float(value_learning.double_q_value(jnp.asarray([7.0, 7.0]), jnp.asarray([1.0, 2.0]))) == 1.0


def test_double_q_value_against_a_loop():
    generator = np.random.default_rng(0)
    online, target = generator.normal(size=(2, 50, 4)).astype(np.float32)
    wanted = [target[i][max(range(4), key=online[i].__getitem__)] for i in range(50)]
    arguments = jnp.asarray(online), jnp.asarray(target)
    assert jax.vmap(value_learning.double_q_value)(*arguments).tolist() == wanted
    columns = jax.vmap(value_learning.double_q_value, in_axes=1)
    assert columns(*(values.T for values in arguments)).tolist() == wanted


def test_td_target():
    assert float(value_learning.td_target(jnp.float32(-3.0), jnp.float32(0.5), jnp.float32(8.0))) == 1.0
    assert float(value_learning.td_target(jnp.float32(-3.0), jnp.float32(0.0), jnp.float32(8.0))) == -3.0


ERRORS = jnp.asarray([0.0, 1.0, -1.0, 1.5, 2.0, -3.0, 100.0])


@pytest.mark.parametrize(("loss", "wanted", "slopes"), [
    (Loss.SQUARED, [0.0, 1.0, 1.0, 2.25, 4.0, 9.0, 10_000.0], [0.0, 2.0, -2.0, 3.0, 4.0, -6.0, 200.0]),
    # From 1.5 on a line of slope 3 through 2.25.
    (Loss.HUBER, [0.0, 1.0, 1.0, 2.25, 3.75, 6.75, 297.75], [0.0, 2.0, -2.0, 3.0, 3.0, -3.0, 3.0]),
])  # fmt: skip
def test_td_loss_and_its_slope(loss, wanted, slopes):
    of_one = jax.value_and_grad(value_learning.td_loss)
    values, gradient = jax.vmap(of_one, in_axes=(0, None, None))(ERRORS, jnp.int32(loss), jnp.float32(1.5))
    assert values.tolist() == wanted
    assert gradient.tolist() == slopes


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


# --- The margin and the weights' squares ------------------------------------------------------------------------------


def margin_and_gradient(q, expert, margin):
    """Equation (29) for one state in double precision, and its gradient with respect to q [A]."""
    raised = [value + (0.0 if a == expert else margin) for a, value in enumerate(q)]
    best = max(range(len(q)), key=raised.__getitem__)
    gradient = np.zeros(len(q))
    gradient[best] += 1
    gradient[expert] -= 1
    return raised[best] - q[expert], gradient


@pytest.mark.parametrize("margin", [0.0, 0.8, 1.0])
@pytest.mark.parametrize("num_actions", [2, 4, 7])
def test_large_margin_loss_and_gradient_against_a_loop(margin, num_actions):
    generator = np.random.default_rng(num_actions)
    q, expert = generator.normal(size=(200, num_actions)).astype(np.float32), generator.integers(0, num_actions, 200)
    wanted, gradients = zip(
        *(margin_and_gradient(row.astype(float), e, margin) for row, e in zip(q, expert, strict=True)), strict=True
    )
    arguments = jnp.asarray(q), jnp.asarray(np.eye(num_actions, dtype=bool)[expert]), jnp.float32(margin)
    rows = jax.vmap(value_learning.large_margin_loss, in_axes=(0, 0, None))
    np.testing.assert_allclose(rows(*arguments), wanted, rtol=0, atol=2e-6)
    columns = jax.vmap(value_learning.large_margin_loss, in_axes=(1, 1, None))(*(a.T for a in arguments))
    np.testing.assert_allclose(columns, wanted, rtol=0, atol=2e-6)
    gradient = jax.grad(lambda q, *rest: rows(q, *rest).sum())(*arguments)
    np.testing.assert_array_equal(gradient, gradients)
    # Otherwise the expert's action would always, or never, win.
    assert 0.02 < np.mean(np.array(wanted) == 0) < 0.98


@pytest.mark.parametrize("margin", [0.8, 1.0])
def test_margin_loss_is_zero_from_a_lead_of_the_margin_on(margin):
    leads = np.array([-1.0, 0.0, margin / 2, margin, margin + 1e-3, 5.0])
    q = jnp.asarray(np.stack([np.full(6, 2.0), 2.0 + leads, np.full(6, -9.0)], axis=1), jnp.float32)
    of_rows = jax.vmap(value_learning.large_margin_loss, in_axes=(0, None, None))
    loss = of_rows(q, jnp.asarray([False, True, False]), jnp.float32(margin))
    np.testing.assert_allclose(loss, np.maximum(margin - leads, 0), rtol=0, atol=1e-6)
    assert loss[4:].tolist() == [0.0, 0.0]


def test_margin_loss_is_of_one_state():
    with pytest.raises(AssertionError):
        value_learning.large_margin_loss(Q, jnp.asarray([True, False, False]), jnp.float32(1.0))


def test_l2_loss_and_gradient():
    generator = np.random.default_rng(0)
    weights = {"a": {"kernel": generator.normal(size=(5, 3)), "bias": generator.normal(size=5)}, "b": np.array(-2.0)}
    on_device = jax.tree.map(lambda a: jnp.asarray(a, jnp.float32), weights)
    wanted = sum((leaf**2).sum() for leaf in jax.tree.leaves(weights))
    np.testing.assert_allclose(value_learning.l2_loss(on_device), wanted, rtol=1e-6)
    gradient = jax.grad(value_learning.l2_loss)(on_device)
    jax.tree.map(lambda g, w: np.testing.assert_allclose(g, 2 * w, rtol=1e-6), gradient, weights)
    assert float(value_learning.l2_loss(())) == 0.0


# --- Schedules --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("start", "end"), [(1.0, 0.01), (0.6, 1.0), (0.0, 0.0)])
def test_linear_schedule_reaches_its_end_and_stays(start, end):
    steps = [0, 1, 50, 99, 100, 101, 10**9]
    got = [schedules.linear(jnp.float32(start), jnp.float32(end), jnp.int32(step), 100) for step in steps]
    wanted = [start + (end - start) * min(step / 100, 1) for step in steps]
    np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-7)
    assert got[0] == np.float32(start)
    assert got[4] == got[5] == got[6]


def beta(update: int, pretraining: int, training: int, hparams: HParams) -> jax.Array:
    return schedules.importance_exponent(jnp.int32(update), pretraining, training, hparams)


def test_beta_rises_from_0_6_in_the_first_update_to_1_after_the_last():
    updates = 10_000 + 300_000
    at = lambda update: float(beta(update, 10_000, 300_000, HParams()))  # noqa: E731
    assert at(0) == float(np.float32(0.6))
    np.testing.assert_allclose([at(10_000), at(155_000)], [0.6 + 0.4 / 31, 0.8], rtol=1e-6)
    np.testing.assert_allclose([at(updates - 1), at(updates)], 1.0, rtol=2e-6)
    assert float(beta(0, 0, 1, HParams())) == float(np.float32(0.6))  # the last update itself is a step before the end
    constant = HParams(importance_start=jnp.float32(0.3), importance_end=jnp.float32(0.3))
    assert float(beta(7, 5, 5, constant)) == float(np.float32(0.3))


def test_beta_may_rise_over_training_alone():
    hparams = HParams(importance_over=ImportanceOver.TRAINING)
    got = [float(beta(update, 10_000, 300_000, hparams)) for update in (0, 9_999, 10_000, 160_000, 310_000)]
    np.testing.assert_allclose(got, [0.6, 0.6, 0.6, 0.8, 1.0], rtol=1e-6)


def test_epsilon_falls_linearly_and_stays():
    slots = [0, 7500, 15_000, 29_999, 30_000, 30_001, 10**6]
    got = [float(schedules.epsilon(jnp.int32(slot), HParams(), 300)) for slot in slots]
    wanted = [1 - 0.99 * min(slot / 30_000, 1) for slot in slots]
    np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-6)
    assert got[4:] == [got[4]] * 3


def test_epsilon_may_fall_by_the_same_factor_from_episode_to_episode():
    hparams = HParams(exploration=Exploration.EXPONENTIAL, epsilon_slots=600.0, epsilon_start=0.8, epsilon_end=0.05)
    got = [float(schedules.epsilon(jnp.int32(slot), hparams, 100)) for slot in range(900)]
    wanted = [0.8 * (0.05 / 0.8) ** (min(slot // 100, 6) / 6) for slot in range(900)]
    np.testing.assert_allclose(got, wanted, rtol=1e-5)


@pytest.mark.parametrize(("p", "cost"), [(0.05, -100.0), (0.2, -100.0), (0.2, -1000.0)])
def test_the_huber_loss_hardly_sees_a_rare_cost_and_squares_see_its_mean(p, cost):
    reward, delta = 3.0, 1.0
    mean = (1 - p) * reward + p * cost

    def minimum(near, loss):
        values = jnp.linspace(near - 2.0, near + 2.0, 40_001)
        errors = jnp.stack([reward - values, cost - values])
        losses = value_learning.td_loss(errors, loss, jnp.float32(delta))
        return float(values[((1 - p) * losses[0] + p * losses[1]).argmin()])

    assert minimum(reward, Loss.HUBER) == pytest.approx(reward - delta * p / (1 - p), abs=3e-3)
    assert minimum(mean, Loss.SQUARED) == pytest.approx(mean, rel=2e-3)
