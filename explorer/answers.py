"""What the page asks: fields of an environment, what is exact about it, a picture of a slot."""

from __future__ import annotations

import base64
import dataclasses
import io
import json
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jrcjax import exact, front
from jrcjax.checks import refuse
from jrcjax.config.document import fields_of
from jrcjax.config.toml import description_of, params_of, text_of, to_toml
from jrcjax.containers import Kind, schema_of
from jrcjax.model import states
from jrcjax.model.params import FACTORS, EnvParams
from jrcjax.model.presets import paper_params
from jrcjax.radar.bank import Radar

Description = dict[str, Any]


def described(params: EnvParams) -> Description:
    """An environment as the tables of its TOML file."""
    return description_of(to_toml(params))


def fields(description: Description) -> list[dict[str, Any]]:
    """Each field of the tables: dotted path, value, what is allowed, names of its readings, meaning."""
    kinds = {name: field.part for name, field in schema_of(EnvParams).items() if field.part is not None}
    found = []
    for prefix, kind, table in [
        ("", EnvParams, description),
        *((f"{n}.", k, description[n]) for n, k in kinds.items()),
    ]:
        meanings = fields_of(kind)
        for name, field in schema_of(kind).items():
            if name in table and field.kind is not Kind.PART:
                about = {"path": prefix + name, "value": table[name], "allowed": field.words, "names": field.names}
                found.append(about | {"meaning": meanings.get(name, "")})
    return found


@lru_cache(maxsize=32)
def _radar(table: str) -> Radar:
    """The radar of a table; its bank of placements takes seconds, so it is kept."""
    return params_of({"environment": "target", "radar": json.loads(table)}).radar


def environment(description: Description) -> EnvParams:
    """The environment of tables that came from the page.

    Raises:
      ValueError: naming the field, the value and what is allowed.
    """
    _refuse_gaps("", description)
    given = description_of(text_of(description))
    radar = _radar(json.dumps(given.pop("radar"), sort_keys=True))
    return dataclasses.replace(params_of({"environment": "target"} | given), radar=radar)


def _refuse_gaps(prefix: str, table: Description) -> None:
    for name, value in table.items():
        if isinstance(value, dict):
            _refuse_gaps(f"{prefix}{name}.", value)
        elif any(number is None for number in np.asarray(value, object).ravel()):
            refuse(f"{prefix}{name}", "nothing", "a number")


@jax.jit
def _solved(params: EnvParams) -> dict[str, Any]:
    best = exact.optimal_policy(params)
    even = jnp.full(best.shape, 1.0 / params.num_actions)
    return {
        "actions": best.argmax(axis=1),
        "optimum": exact.evaluate_policy(params, best)._asdict(),
        "constant": exact.evaluate_policy(params, exact.best_constant_action(params))._asdict(),
        "random": exact.evaluate_policy(params, even)._asdict(),
        "front": front.front(params)._asdict(),
    }


def answer(description: Description) -> dict[str, Any]:
    """All that the page shows of an environment at once."""
    params = environment(description)
    solved = jax.tree.map(lambda leaf: _plain(np.asarray(leaf)), _solved(params))
    levels = np.asarray(states.levels_of(jnp.arange(params.num_states), params.shape))
    actions = [f"data {packets:g}" for packets in np.asarray(params.channel.packets)]
    actions += [f"radar {mode + 1}" for mode in range(params.radar.num_modes)]
    return solved | {
        "levels": levels.tolist(),
        "factors": FACTORS,
        "action_names": actions,
        "toml": to_toml(params),
        "fields": fields(described(params)),
    }


def _plain(array: np.ndarray) -> Any:
    """Numbers for JSON, which knows no NaN."""
    plain = array.astype(object)
    plain[np.isnan(array)] = None
    return plain.tolist()


def picture(description: Description, state: int, action: int, seed: int) -> str:
    """One slot as a PNG in base64."""
    from jrcjax import render  # matplotlib, only where a picture is wanted

    params = environment(description)
    if not 0 <= state < params.num_states or not 0 <= action < params.num_actions:
        refuse("state, action", f"{state}, {action}", f"below {params.num_states} and {params.num_actions}")
    file = io.BytesIO()
    render.slot_figure(jax.random.key(seed), state, action, params).savefig(file, format="png", dpi=90)
    return base64.b64encode(file.getvalue()).decode()


def start(name: str) -> dict[str, Any]:
    """The answer for one of the paper's environments."""
    return answer(described(paper_params(name)))


def of_toml(text: str) -> dict[str, Any]:
    """The answer for a file's text."""
    return answer(described(params_of(description_of(text))))
