"""The trade-off: which (throughput, miss detection) policies can reach in the long run, and the best of them.

Actions have no influence on the state, so in the long run each state is visited with the probability of its levels
whatever the policy does, and both figures are sums over states of what the action there contributes. The points that
can be reached are therefore the Minkowski sum of one small polygon per state, the convex hull of its actions' points.
Its corners belong to deterministic policies, and what lies between corners to policies that mix two of them in one
state. This solves the linear program of average reward for every weighting of the two figures at once: the boundary
is walked from corner to corner by taking, among all states, the exchange with the best ratio next.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax.checks import is_not_negative, is_traced, refuse, require
from jrcjax.compiled import compiled
from jrcjax.exact import as_observed, miss_table, packet_table, policy_of_actions, stationary_distribution
from jrcjax.model import metrics
from jrcjax.model.events import event_probability
from jrcjax.model.params import EnvParams, of_params
from jrcjax.readings import MissConvention
from jrcjax.types import Float

_ROUNDING = 1e-5  # of sums over states, relative


class Boundary(NamedTuple):
    """Corners of a boundary in the order of rising throughput; V = S (A - 1) + 1 of them, some of which coincide."""

    throughput: Float
    """[V] packets per slot."""
    miss_detection: Float
    """[V] equation (7) in the parameters' convention."""


@of_params
@compiled
def contributions(params: EnvParams) -> tuple[Float, Float]:
    """What each action in each state adds to (throughput, miss detection) per slot in the long run, both [S, A].

    The miss detection is NaN under the convention `radar_slots`: there it depends on the share of slots with radar, and
    the best radar mode in an ever smaller share of slots comes as near as one likes to both ideals at once.
    """
    visits = stationary_distribution(params)[:, None]
    p = event_probability(params)[:, None]
    packets, miss = packet_table(params), jnp.broadcast_to(miss_table(params), (params.num_states, params.num_actions))
    is_data = (jnp.arange(params.num_actions) < params.num_rates)[None]
    sent, missed, counted = jnp.zeros_like(packets), jnp.zeros_like(packets), jnp.float32(0.0)
    for event, chance in ((jnp.bool_(True), p), (jnp.bool_(False), 1.0 - p)):
        chances = jnp.broadcast_to(chance, packets.shape)
        sent += chances * metrics.counted_packets(packets, event, params.count_event_packets)
        counts = jnp.where(metrics.counts_for_miss(is_data, event, params.miss_convention), chances, 0.0)
        missed += counts * miss
        counted += (visits * counts)[:, 0].sum()  # of data; the same for radar under all conventions but the last
    sent, missed = (visits * as_observed(params, table) for table in (sent, missed))
    has_trade_off = params.miss_convention != MissConvention.RADAR_SLOTS
    return sent, jnp.where(has_trade_off, missed / counted, jnp.nan)


def _exchanges(gain: Float, cost: Float) -> tuple[Float, Float, Float, Float]:
    """The lower boundary of the convex hull of the points (gain, cost), [A] each, walked from its left end.

    Returns:
      Gain and cost of the left end, and those that each of the A - 1 steps adds, [A - 1]; zeros once the right end
      is reached.
    """
    first = jnp.argmin(jnp.where(gain == gain.min(), cost, jnp.inf))

    def step(here, _):
        further = gain > gain[here]
        slope = jnp.where(further, (cost - cost[here]) / jnp.where(further, gain - gain[here], 1.0), jnp.inf)
        steepest = slope == slope.min()  # of equal slopes the furthest
        to = jnp.where(further.any(), jnp.argmax(jnp.where(steepest, gain, -jnp.inf)), here)
        return to, (gain[to] - gain[here], cost[to] - cost[here])

    _, (gains, costs) = jax.lax.scan(step, first, length=gain.shape[0] - 1)
    return gain[first], cost[first], gains, costs


def _lower_boundary(gain: Float, cost: Float) -> Boundary:
    """The lower boundary of the Minkowski sum of the states' polygons, from contributions [S, A]."""
    start_gain, start_cost, gains, costs = jax.vmap(_exchanges)(gain, cost)
    gains, costs = gains.ravel(), costs.ravel()
    order = jnp.argsort(jnp.where(gains > 0, costs / jnp.where(gains > 0, gains, 1.0), jnp.inf))

    def walk(start, steps):
        return start.sum() + jnp.concatenate([jnp.zeros(1, steps.dtype), jnp.cumsum(steps[order])])

    return Boundary(walk(start_gain, gains), walk(start_cost, costs))


@of_params
@compiled
def reachable(params: EnvParams) -> tuple[Boundary, Boundary]:
    """The exact set of (throughput, miss detection) that policies can reach: what lies between two boundaries.

    Returns:
      The smallest and the largest miss detection at each throughput, as corners joined by straight lines. NaN under
      the convention `radar_slots` (see `contributions`).
    """
    gain, cost = contributions(params)
    highest = _lower_boundary(gain, -cost)
    return _lower_boundary(gain, cost), highest._replace(miss_detection=-highest.miss_detection)


@of_params
@compiled
def front(params: EnvParams) -> Boundary:
    """The part of the reachable set on which nothing is gained in one figure without losing in the other.

    It starts at the smallest miss detection of all policies and ends at the largest throughput. Corners of the lower
    boundary that send fewer packets than the first of these, if there are any, coincide with it.
    """
    lowest = _lower_boundary(*contributions(params))
    start = jnp.argmax(jnp.where(lowest.miss_detection == lowest.miss_detection.min(), lowest.throughput, -jnp.inf))
    corner = jnp.maximum(jnp.arange(lowest.throughput.shape[0]), start)
    return Boundary(lowest.throughput[corner], lowest.miss_detection[corner])


@of_params
@compiled
def lowest_miss_detection(params: EnvParams, throughput: Float | float) -> Float:
    """The smallest miss detection of any policy with this throughput or more, in packets per slot; any shape.

    NaN beyond the largest throughput that can be reached, by more than rounding.
    """
    corners = front(params)
    wanted = jnp.asarray(throughput, jnp.float32)
    lowest = jnp.interp(wanted, corners.throughput, corners.miss_detection)
    return jnp.where(wanted <= (1.0 + _ROUNDING) * corners.throughput[-1], lowest, jnp.nan)


@of_params
def policy_at(params: EnvParams, price: Float | float) -> Float:
    """A policy on the front, [S, A] with one 1 per row: it minimises miss detection minus `price` times throughput.

    The convention `radar_slots` has no front (see `contributions`). It is refused, or gives NaN where it is traced.

    Args:
      params: the environment.
      price: [] miss detection that a packet per slot is worth, at least 0.

    Raises:
      ValueError: naming the argument, the value and what is allowed.
    """
    require("price", price, (), is_not_negative, "a number >= 0")
    convention = params.miss_convention
    if not is_traced(convention) and (np.asarray(convention) == MissConvention.RADAR_SLOTS).any():
        refuse("miss_convention", "radar_slots", "all_slots, event_slots, which have a front")
    gain, cost = contributions(params)
    policy = policy_of_actions(jnp.argmax(price * gain - cost, axis=1), params.num_actions)
    return jnp.where(jnp.isnan(cost), jnp.nan, policy)
