"""An environment as tables: what `slot.run_slot` does in each state, computed by JAX once and read by NumPy.

A slot turns random words into levels, an event and a placement. A uniform number of the model has 24 bits, k / 2^24, so
everything that depends on it changes at whole numbers k. The tables hold these thresholds, found by asking the model's
own functions, and thus give the same outcome as `run_slot` for the same words, to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax import rng
from jrcjax.model import events, states, transitions
from jrcjax.model.channel import Channel, delivered_packets
from jrcjax.model.metrics import slot_miss
from jrcjax.model.params import EnvParams, Factor
from jrcjax.model.rewards import reward
from jrcjax.types import Float, Int

UNIFORM_BITS = 24
"""Random bits of a uniform number, the upper ones of its word; see `rng.uniform`."""
MOST_STATES = 2**20
"""Above it, the tables would take more memory than they save time."""


class FactorTable(NamedTuple):
    """One factor with J levels."""

    stride: int
    """What one level adds to the state id."""
    size: int
    """J."""
    kept_below: int
    """The level stays as it is if the number k is below."""
    first: np.ndarray
    """[J - 1] smallest k of levels 1, 2, ... in the first slot of an episode."""
    later: np.ndarray
    """[J - 1] smallest k of levels 1, 2, ... in every other slot, where the level does not stay."""


class Tables(NamedTuple):
    """An environment with S states, A actions, and J levels of its channel.

    What a slot gives, but for the event, is one of M cells: for a data rate one cell for each level of the channel, for
    a radar mode one for each placement of the bank. The cells of an action follow one another.
    """

    factors: tuple[FactorTable, ...]
    features: np.ndarray
    """[S, F] what an agent observes."""
    event_below: np.ndarray
    """[S] an event happens if the number k is below."""
    first_cell: np.ndarray
    """[A] where the cells of an action begin."""
    reward: np.ndarray
    """[2, M] reward without and with an event."""
    packets: np.ndarray
    """[M] packets delivered."""
    miss_ratio: np.ndarray
    """[M] p_k; 1 for data."""


def fit(params: EnvParams) -> bool:
    """Whether tables can hold the environment: not one that places its objects afresh in every slot."""
    return params.radar.placements == "bank" and params.num_states <= MOST_STATES


def tables_of(params: EnvParams) -> Tables:
    """The tables of an environment that they fit."""
    computed = jax.tree.map(np.asarray, _compute(params))
    factors, stride = [], params.num_states
    thresholds = zip(params.factors, params.shape, computed["first"], computed["later"], strict=True)
    for factor, size, first, later in thresholds:
        stride //= size
        factors.append(FactorTable(stride, size, int(_numbers_below(factor.persistence)), first, later))
    num_cells = [params.shape[0]] * params.num_rates + [params.radar.miss_bank.shape[-1]] * params.radar.num_modes
    return Tables(
        factors=tuple(factors),
        features=computed["features"],
        event_below=_numbers_below(computed["event_probability"]),
        first_cell=np.cumsum([0, *num_cells[:-1]]),
        **{name: computed[name] for name in ("reward", "packets", "miss_ratio")},
    )


def _numbers_below(probability: Float | np.ndarray) -> np.ndarray:
    """How many of the numbers k have k / 2^24 below each probability."""
    return np.ceil(np.asarray(probability, np.float64) * 2**UNIFORM_BITS).astype(np.uint32)


@jax.jit
def _compute(params: EnvParams) -> dict[str, Any]:
    level, rate = jnp.arange(params.shape[0]), jnp.arange(params.num_rates)
    sent = jax.vmap(lambda r: jax.vmap(lambda c: delivered_packets(c, r, params.channel))(level))(rate).ravel()
    missed = params.radar.miss_bank.ravel()
    is_data = jnp.arange(sent.size + missed.size) < sent.size
    packets = jnp.concatenate([sent, jnp.zeros_like(missed)])
    miss_ratio = slot_miss(is_data, jnp.concatenate([jnp.ones_like(sent), missed]))
    given = [reward(is_data, jnp.bool_(e), packets, miss_ratio, params.reward_weights) for e in (False, True)]
    return {
        "first": [_first(factor) for factor in params.factors],
        "later": [_later(factor) for factor in params.factors],
        "features": states.all_features(params.shape),
        "event_probability": events.event_probability(params),
        "reward": jnp.stack(given),
        "packets": packets,
        "miss_ratio": miss_ratio,
    }


def _first(factor: Channel | Factor) -> Int:
    return _thresholds(lambda u: transitions.draw_level(u, factor.prior), factor.prior.shape[0])


def _later(factor: Channel | Factor) -> Int:
    # A level that stays is level 0 here, so that levels rise with the number.
    return _thresholds(lambda u: transitions.next_level(u, jnp.int32(0), factor), factor.prior.shape[0])


def _thresholds(draw: Callable[[Float], Int], levels: int) -> Int:
    """The smallest k from which on `draw`, rising in its uniform number, gives levels 1, 2, ...; [levels - 1]."""

    def halve(_, bounds: tuple[Int, Int]) -> tuple[Int, Int]:
        low, high = bounds
        middle = (low + high) // 2
        word = middle.astype(jnp.uint32) << (32 - UNIFORM_BITS)
        reached = jax.vmap(draw)(rng.uniform(word)) >= jnp.arange(1, levels)
        return jnp.where(reached, low, middle + 1), jnp.where(reached, middle, high)

    start = jnp.zeros(levels - 1, jnp.int32), jnp.full(levels - 1, 2**UNIFORM_BITS, jnp.int32)
    return jax.lax.fori_loop(0, UNIFORM_BITS + 1, halve, start)[1]
