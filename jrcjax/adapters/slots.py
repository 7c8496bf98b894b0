"""The slots of an environment, from random words and in NumPy's numbers: by tables, or by JAX where none can hold it.

Both ways give what `slot.run_slot` gives for the same words. Tables need no JAX, so they are fast for one environment
and work in forked processes.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple, TypeAlias

import jax
import numpy as np

from jrcjax.adapters.forks import require_jax
from jrcjax.adapters.tables import UNIFORM_BITS, Tables, fit, tables_of
from jrcjax.checks import require_type
from jrcjax.model import slot, states
from jrcjax.model.params import EnvParams, check_params
from jrcjax.model.presets import paper_params
from jrcjax.readings import RewardState

_SHIFT = 32 - UNIFORM_BITS
_KEPT = 16  # environments whose tables stay in memory


class Outcome(NamedTuple):
    """What a slot gives: plain numbers for one environment, arrays [N] for N of them."""

    next_state: Any
    reward: Any
    event: Any
    packets: Any
    """Packets delivered."""
    miss_ratio: Any
    """p_k(t); 1 in a slot spent on data."""


class TableSlots:
    """Slots by tables."""

    def __init__(self, params: EnvParams, tables: Tables):
        """Args: params: with NumPy's arrays; tables: theirs."""
        self.params = params
        self.tables = tables
        self._rates = params.num_rates
        self._placements = params.radar.miss_bank.shape[-1]
        self._first = [(table.first.tolist(), table.stride) for table in tables.factors]
        self._later = [(t.kept_below, t.later.tolist(), t.stride, t.size) for t in tables.factors]
        self._first_cell: list[int] = tables.first_cell.tolist()
        self._reward, self._reward_in_event = tables.reward
        self._first_decides = bool(params.reward_state == RewardState.EPISODE_START)

    def features(self, state: np.ndarray | int) -> np.ndarray:
        """Observations [..., F] float32 of state ids [...], as a new array."""
        return self.tables.features.take(state, axis=0)

    def first_state(self, words: Sequence[int]) -> int:
        """State id in which an episode begins, from words [NUM_WORDS]."""
        of_factors = zip(words, self._first, strict=False)
        return sum(bisect_right(cuts, word >> _SHIFT) * stride for word, (cuts, stride) in of_factors)

    def first_states(self, words: np.ndarray) -> np.ndarray:
        """State ids [N] in which episodes begin, from words [NUM_WORDS, N] uint32."""
        state = np.zeros(words.shape[1], np.int64)
        for number, (cuts, stride) in zip(words >> _SHIFT, self._first, strict=False):
            state += _level(number, cuts) * stride
        return state

    def run_one(self, words: Sequence[int], state: int, action: int, first: int) -> Outcome:
        """One slot of one environment; arguments as for `slot.run_slot`."""
        tables, new = self.tables, 0
        deciding = first if self._first_decides else state
        for word, (kept_below, cuts, stride, size) in zip(words, self._later, strict=False):
            number = word >> _SHIFT
            level = state // stride % size if number < kept_below else bisect_right(cuts, number)
            new += level * stride
        event = (words[-2] >> _SHIFT) < tables.event_below.item(deciding)
        within = deciding // self._later[0][2] if action < self._rates else words[-1] * self._placements >> 32
        cell = self._first_cell[action] + within
        reward = self._reward_in_event if event else self._reward
        return Outcome(new, reward.item(cell), event, tables.packets.item(cell), tables.miss_ratio.item(cell))

    def run(self, words: np.ndarray, state: np.ndarray, action: np.ndarray, first: np.ndarray) -> Outcome:
        """One slot of N environments: words [NUM_WORDS, N] uint32, state ids and first ones [N] int64, actions [N]."""
        deciding = first if self._first_decides else state
        tables, numbers = self.tables, words >> _SHIFT
        new = np.zeros_like(state)
        for number, (kept_below, cuts, stride, size) in zip(numbers, self._later, strict=False):
            level = _level(number, cuts)
            if kept_below:
                level = np.where(number < kept_below, state // stride % size, level)
            new += level * stride
        event = numbers[-2] < tables.event_below.take(deciding)
        placement = (words[-1].astype(np.uint64) * self._placements >> 32).astype(np.int64)
        within = np.where(action < self._rates, deciding // self._later[0][2], placement)
        cell = tables.first_cell.take(action) + within
        reward = np.where(event, self._reward_in_event.take(cell), self._reward.take(cell))
        return Outcome(new, reward, event, tables.packets.take(cell), tables.miss_ratio.take(cell))


def _level(number: np.ndarray, cuts: Sequence[int]) -> np.ndarray:
    """How many cuts the numbers k [N] reach, [N]."""
    level = np.zeros(number.shape, np.int64)
    for cut in cuts:
        level += number >= cut
    return level


class JaxSlots:
    """Slots by JAX, for fresh placements and for more states than tables hold; methods as those of `TableSlots`."""

    def __init__(self, params: EnvParams):
        """Args: params: with NumPy's arrays."""
        self.params = params

    def features(self, state: np.ndarray | int) -> np.ndarray:
        """Observations [..., F] float32 of state ids [...], as a new array."""
        require_jax("an environment without tables")
        return np.array(states.features_of(np.asarray(state, np.int32), self.params.shape))  # pyright: ignore[reportArgumentType]

    def first_state(self, words: Sequence[int]) -> int:
        """State id in which an episode begins, from words [NUM_WORDS]."""
        return int(self.first_states(np.asarray(words, np.uint32)[:, None])[0])

    def first_states(self, words: np.ndarray) -> np.ndarray:
        """State ids [N] in which episodes begin, from words [NUM_WORDS, N] uint32."""
        require_jax("an environment without tables")
        return np.array(_first_states(words, self.params), np.int64)

    def run_one(self, words: Sequence[int], state: int, action: int, first: int) -> Outcome:
        """One slot of one environment; arguments as for `slot.run_slot`."""
        require_jax("an environment without tables")
        ids = np.int32(state), np.int32(action)
        outcome = _run_slot(np.asarray(words, np.uint32), *ids, self.params, np.int32(first))
        return Outcome(*(getattr(outcome, name).item() for name in Outcome._fields))

    def run(self, words: np.ndarray, state: np.ndarray, action: np.ndarray, first: np.ndarray) -> Outcome:
        """One slot of N environments: words [NUM_WORDS, N] uint32, state ids and first ones [N] int64, actions [N]."""
        require_jax("an environment without tables")
        state, action, first = (ids.astype(np.int32) for ids in (state, action, first))
        outcome = _run_slots(words, state, action, self.params, first)
        numbers = Outcome(*(np.array(getattr(outcome, name)) for name in Outcome._fields))
        return numbers._replace(next_state=numbers.next_state.astype(np.int64))


_run_slot = jax.jit(slot.run_slot)
_run_slots = jax.jit(jax.vmap(slot.run_slot, in_axes=(1, 0, 0, None, 0)))
_first_states = jax.jit(jax.vmap(slot.initial_state, in_axes=(1, None)))

Slots: TypeAlias = TableSlots | JaxSlots


class _Content:
    """Parameters that compare by their numbers."""

    def __init__(self, params: EnvParams):
        leaves, tree = jax.tree.flatten(params)
        arrays = [np.asarray(leaf) for leaf in leaves]
        self.params: EnvParams = jax.tree.unflatten(tree, arrays)
        self._key = tree, *((array.dtype.str, array.shape, array.tobytes()) for array in arrays)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Content) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)


def slots_of(params: EnvParams) -> Slots:
    """The slots of an environment; made once for equal parameters, so that forked processes find them.

    Raises:
      ValueError: naming the field, the value and what is allowed.
      RuntimeError: in a forked process that JAX does not run in, for parameters that were new to its parent.
    """
    require_type("params", params, EnvParams)
    return _slots_of(_Content(params))


@lru_cache(maxsize=_KEPT)
def _slots_of(content: _Content) -> Slots:
    require_jax("an environment with new parameters")
    check_params(content.params)
    return TableSlots(content.params, tables_of(content.params)) if fit(content.params) else JaxSlots(content.params)


def paper_slots(environment: str = "target", preset: str = "paper") -> Slots:
    """The slots of the paper's source or target environment; arguments and errors as those of `paper_params`."""
    return _paper_slots(environment, preset)  # so that a default and the same argument are found as one


@lru_cache
def _paper_slots(environment: str, preset: str) -> Slots:
    require_jax("an environment with new parameters")
    return slots_of(paper_params(environment, preset))
