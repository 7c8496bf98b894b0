"""The exact solver: the finite model's tables, its optimum, and the long-run figures of any policy.

The tables come from the functions that the simulator calls in each slot, over all states and actions.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jrcjax.checks import is_positive, require
from jrcjax.compiled import compiled
from jrcjax.model import metrics, states
from jrcjax.model.channel import delivered_packets
from jrcjax.model.events import event_probability
from jrcjax.model.params import EnvParams, of_params
from jrcjax.model.rewards import reward
from jrcjax.policies import greedy_policy
from jrcjax.radar.bank import mean_miss_ratio
from jrcjax.readings import RewardState

__all__ = [
    "LongRun",
    "as_observed",
    "best_constant_action",
    "evaluate_policy",
    "expected_reward",
    "greedy_policy",
    "largest_reward",
    "level_transition",
    "miss_table",
    "optimal_policy",
    "packet_table",
    "policy_of_actions",
    "slot_reward",
    "state_transition",
    "stationary_distribution",
    "transition_tensor",
    "value_iteration",
]


class LongRun(NamedTuple):
    """Long-run means per slot of one policy, scalars."""

    reward: Float[Array, ""]
    """Mean reward."""
    throughput: Float[Array, ""]
    """Packets per slot."""
    miss_detection: Float[Array, ""]
    """Equation (7) in the parameters' convention; NaN if the policy never meets a slot that counts."""


def level_transition(prior: Float[Array, " J"], persistence: Float[Array, ""]) -> Float[Array, "J J"]:
    """Transition matrix of one factor, [J, J]: kappa I + (1 - kappa) 1 tau^T."""
    return persistence * jnp.eye(prior.shape[0], dtype=prior.dtype) + (1.0 - persistence) * prior[None, :]


def _of_all(matrices: Sequence[Array]) -> Float[Array, "S S"]:
    """The factors evolve independently, so the matrix of all is the Kronecker product of theirs."""
    return functools.reduce(jnp.kron, matrices)


@of_params
@compiled
def state_transition(params: EnvParams) -> Float[Array, "S S"]:
    """P(s' | s), [S, S]."""
    return _of_all([level_transition(factor.prior, factor.persistence) for factor in params.factors])


@of_params
@compiled
def transition_tensor(params: EnvParams) -> Float[Array, "S A S"]:
    """P(s' | s, a), [S, A, S]; equation (10). Actions have no influence on the state."""
    matrix = state_transition(params)
    return jnp.broadcast_to(matrix[:, None, :], (params.num_states, params.num_actions, params.num_states))


@of_params
@compiled
def stationary_distribution(params: EnvParams) -> Float[Array, " S"]:
    """Long-run probability of each state under every policy, [S]: the product of the priors."""
    law = jnp.ones(1, jnp.float32)
    for factor in params.factors:
        law = jnp.kron(law, factor.prior)
    return law


@of_params
@compiled
def packet_table(params: EnvParams) -> Float[Array, "S A"]:
    """Packets delivered in each state by each action, [S, A]; 0 for radar."""
    channel = states.levels_of(jnp.arange(params.num_states), params.shape)[:, 0]
    rates = jnp.arange(params.num_rates)
    sent = jax.vmap(lambda c: jax.vmap(lambda r: delivered_packets(c, r, params.channel))(rates))(channel)
    return jnp.pad(sent, ((0, 0), (0, params.radar.num_modes)))


@of_params
@compiled
def miss_table(params: EnvParams) -> Float[Array, " A"]:
    """E[p_k] of each action, [A]; 1 for data."""
    return jnp.concatenate([jnp.ones(params.num_rates, jnp.float32), mean_miss_ratio(params.radar)])


def _is_data(params: EnvParams) -> Bool[Array, " A"]:
    return jnp.arange(params.num_actions) < params.num_rates


def _chances_of_new_levels(params: EnvParams) -> Float[Array, ...]:
    """How likely it is that just these factors were drawn anew since the first slot, the mean over the slots, [2] * F.

    Along a factor's axis 0 stands for a level that was kept, with kappa^t, and 1 for one that was drawn anew.
    """
    slots = jnp.arange(params.max_steps_in_episode, dtype=jnp.float32)
    chances = jnp.ones((len(slots), 1), jnp.float32)
    for factor in params.factors:
        kept = factor.persistence**slots
        chances = (chances[:, :, None] * jnp.stack([kept, 1.0 - kept], axis=1)[:, None]).reshape(len(slots), -1)
    return chances.mean(axis=0).reshape([2] * len(params.factors))


def _along(axis: int, matrix: Float[Array, "K J"], table: Array) -> Array:
    """The matrix times a table along one of its axes, whose length J becomes K."""
    return jnp.moveaxis(jnp.tensordot(matrix, table, (1, axis)), 0, axis)


def _mean_of_powers(params: EnvParams, table: Float[Array, "S A"]) -> Float[Array, "S A"]:
    """(1/T) sum over t < T of P^t times the table, [S, A]: the mean over the T slots of an episode.

    The power of a factor's matrix is kappa^t I + (1 - kappa^t) 1 tau^T. The product of all is a sum over the sets of
    factors that were drawn anew: the chance of the set, times the table's mean over their levels. The means lie behind
    the levels, as one more along each axis. So nothing is larger than the table with its means; P is never made.
    """
    parts, levels = table.reshape(*params.shape, -1), params.shape
    for axis, factor in enumerate(params.factors):
        parts = _along(axis, jnp.concatenate([jnp.eye(levels[axis], dtype=jnp.float32), factor.prior[None]]), parts)
    kept_or_new = np.ix_(*(np.arange(count + 1) // count for count in levels))
    parts = _chances_of_new_levels(params)[kept_or_new][..., None] * parts
    for axis, count in enumerate(levels):
        parts = _along(axis, jnp.eye(count, count + 1, dtype=jnp.float32).at[:, count].set(1.0), parts)
    return parts.reshape(table.shape)


@of_params
@compiled
def as_observed(params: EnvParams, table: Float[Array, "S A"]) -> Float[Array, "S A"]:
    """The mean of a table [S, A] of what slots give, over the slots in which the agent observes each state; [S, A].

    Under `reward_state` "current" that is the table itself. Under "episode_start" a slot gives what the episode's first
    state has in the table. The factors' chains are reversible, so seen from a state observed at time t the first state
    is distributed as the state t slots later, and the mean is over the slots of an episode.
    """
    is_first = params.reward_state == RewardState.EPISODE_START
    return jnp.where(is_first, _mean_of_powers(params, table), table)


@of_params
@compiled
def expected_reward(params: EnvParams) -> Float[Array, "S A"]:
    """E[rho | s, a] in the slots in which an agent observes s, [S, A]; see `as_observed`."""
    return as_observed(params, slot_reward(params))


@of_params
@compiled
def slot_reward(params: EnvParams) -> Float[Array, "S A"]:
    """E[rho | s, a] of a slot whose event and packets belong to s, [S, A].

    Equation (11) averaged over event and placement, in both of which it is linear.
    """
    p = event_probability(params)[:, None]
    is_data, packets, miss = _is_data(params)[None], packet_table(params), miss_table(params)[None]
    given = [reward(is_data, jnp.bool_(e), packets, miss, params.reward_weights) for e in (True, False)]
    return p * given[0] + (1.0 - p) * given[1]


@of_params
@compiled
def largest_reward(params: EnvParams) -> Float[Array, ""]:
    """Max |rho_t| over states, actions, events and miss ratios, a scalar; equation (11) is linear in the miss ratio."""
    is_data, packets = _is_data(params)[None], packet_table(params)
    extremes = [
        reward(is_data, jnp.bool_(event), packets, jnp.float32(miss), params.reward_weights)
        for event in (True, False)
        for miss in (0.0, 1.0)
    ]
    return jnp.abs(jnp.stack(extremes)).max()


@of_params
def value_iteration(
    params: EnvParams, gamma: Float[Array, ""] | float = 0.99, tolerance: float = 1e-4
) -> Float[Array, "S A"]:
    """Q* of the discounted problem, [S, A].

    Under `reward_state` "episode_start" what an agent observes is no Markov state. Q* then belongs to the problem in
    which each observed state earns its mean (`expected_reward`). Its greedy policy earns the most of all policies that
    look at the observed state alone, since actions have no influence on it; a memory of the first allows more.

    Relative value iteration with MacQueen's bounds: after each sweep the optimal values lie within gamma / (1 - gamma)
    times the smallest and largest change, so it stops when these bounds are `tolerance` apart and takes their middle.

    Args:
      params: the environment.
      gamma: discount in [0, 1).
      tolerance: largest error of a value, in units of reward; float32 rounding comes on top.

    Raises:
      ValueError: naming the argument, the value and what is allowed.
    """
    # As the numbers that they become: float32 rounds 0.99999999 to 1.
    require("gamma", gamma, (), lambda x: (x >= 0) & (x.astype(np.float32) < 1), "a float32 discount in [0, 1)")
    require("tolerance", tolerance, (), lambda x: is_positive(x.astype(np.float32)), "a float32 number > 0")
    return _value_iteration(params, jnp.asarray(gamma, jnp.float32), jnp.asarray(tolerance, jnp.float32))


@compiled
def _value_iteration(params: EnvParams, gamma: Float[Array, ""], tolerance: Float[Array, ""]) -> Float[Array, "S A"]:
    transition, rewards = transition_tensor(params), expected_reward(params)
    scale = gamma / (1.0 - gamma)

    def backup(values: Float[Array, " S"]) -> Float[Array, "S A"]:
        return rewards + gamma * transition @ values

    def bounds(change: Float[Array, " S"]) -> tuple[Float[Array, ""], Float[Array, ""]]:
        return scale * change.min(), scale * change.max()

    def unsettled(carry):
        _, change, sweeps = carry
        low, high = bounds(change)
        # Rounding keeps the change from becoming constant to the last bit, hence the limit on sweeps.
        return (high - low > tolerance) & (sweeps < 20_000)

    def sweep(carry):
        values, _, sweeps = carry
        new = backup(values).max(axis=1)
        change = new - values
        # Only differences matter until the end; small numbers round less.
        return new - new.min(), change, sweeps + 1

    start = (
        jnp.zeros(params.num_states, jnp.float32),
        jnp.full(params.num_states, jnp.inf, jnp.float32).at[0].set(-jnp.inf),
        jnp.int32(0),
    )
    relative, _, _ = jax.lax.while_loop(unsettled, sweep, start)
    # One more sweep from the relative values gives bounds that refer to exactly these values.
    new = backup(relative).max(axis=1)
    low, high = bounds(new - relative)
    return backup(new) + gamma * (low + high) / 2.0


@of_params
def optimal_policy(params: EnvParams, gamma: Float[Array, ""] | float = 0.99) -> Float[Array, "S A"]:
    """The greedy policy of Q*, [S, A] with one 1 per row."""
    return greedy_policy(value_iteration(params, gamma))


def policy_of_actions(actions: Int[Array, "*batch S"], num_actions: int) -> Float[Array, "*batch S A"]:
    """Probabilities [..., S, A] of a deterministic policy given as actions [..., S]."""
    return jax.nn.one_hot(actions, num_actions, dtype=jnp.float32)


@of_params
@compiled
def best_constant_action(params: EnvParams) -> Float[Array, "S A"]:
    """The policy [S, A] that takes the same action in every state and earns the most in the long run."""
    earned = stationary_distribution(params) @ expected_reward(params)
    return policy_of_actions(jnp.full(params.num_states, jnp.argmax(earned)), params.num_actions)


def _is_policy(policy: np.ndarray) -> bool:
    return bool((policy >= 0).all() and (np.abs(policy.sum(axis=1) - 1.0) < 1e-4).all())


@of_params
def evaluate_policy(params: EnvParams, policy: Float[Array, "S A"]) -> LongRun:
    """Long-run reward, throughput and miss detection per slot of a stationary policy.

    Under `reward_state` "episode_start" they are the means over the slots of many episodes: the first state of each is
    drawn from the priors, as the simulator draws it, and stays responsible for all of its slots.

    Args:
      params: the environment.
      policy: [S, A] probability of each action in each state.

    Raises:
      ValueError: naming the argument, the value and what is allowed.
    """
    shape = (params.num_states, params.num_actions)
    require("policy", policy, shape, _is_policy, "probabilities in [0, 1] whose rows sum to 1")
    return _long_run(params, policy)


@compiled
def _long_run(params: EnvParams, policy: Float[Array, "S A"]) -> LongRun:
    # How often an action is taken while each state decides what it gives.
    visits = stationary_distribution(params)[:, None] * as_observed(params, policy)
    p = event_probability(params)[:, None]
    packets, miss, is_data = packet_table(params), miss_table(params)[None], _is_data(params)[None]
    throughput, missed, counted = jnp.float32(0.0), jnp.float32(0.0), jnp.float32(0.0)
    for event, chance in ((jnp.bool_(True), p), (jnp.bool_(False), 1.0 - p)):
        weight = visits * chance
        throughput += (weight * metrics.counted_packets(packets, event, params.count_event_packets)).sum()
        counts = jnp.where(metrics.counts_for_miss(is_data, event, params.miss_convention), weight, 0.0)
        missed, counted = missed + (counts * miss).sum(), counted + counts.sum()
    sums = metrics.zero()._replace(missed=missed, counted=counted)
    return LongRun((visits * slot_reward(params)).sum(), throughput, metrics.miss_detection(sums))
