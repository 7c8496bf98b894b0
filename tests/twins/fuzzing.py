"""Mutates files and reads them: `python fuzzing.py toml|agents|parts FOLDER NUMBER`; any fault is an exception.

Banks of placements are not built, since nothing that takes time or memory may happen before a file is accepted; and
the process may take no more memory than some GB above what it starts with.
"""

from __future__ import annotations

import json
import os
import random
import re
import resource
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import tiny
import xarray as xr

import jrcjax
from jrcjax.agents import layout
from jrcjax.config.toml import load_params, to_toml
from jrcjax.radar import bank
from jrcjax.training.rollout import init_agent, learner_for
from sweeps.results import parts

_ROOM, _SECONDS, _CHARACTERS = 2**32, 20.0, 2000
_VALUES = (
    *("1e6", "1e9", "10000000000", "1e38", "1e308", "-1", "0", "1e-46", "nan", "inf", "-inf", "true", '"x"', "[]"),
    *("{}", "[[1]]", "[" * 3000, "[" * 300 + "]" * 300, "1" * 5000, f'"{"y" * 5000}"', "9223372036854775808"),
    *("1979-05-27", "0.5", "1e12", "[1e-30, 1e30]", "[0.5, 0.5]"),
)
_LINES = ("a.b.c.d = 1", "[radar.x]", "a" * 4000 + " = 1", "\x00", "\ufeff", "]" * 50)
_JUNK = (None, -1, 10**9, 2**70, 1e308, "x" * 5000, [], {}, [[[]]], True, "1", [1] * 5000, {"a": {"b": [None]}})


def limit_memory() -> None:
    """Lets this process take `_ROOM` more than it has, where the system tells what that is."""
    pages = Path("/proc/self/statm")
    if pages.exists():
        now = int(pages.read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (now + _ROOM, resource.RLIM_INFINITY))


def outcome(read):
    """What was read, or None if it was refused in few words; neither takes long."""
    begin, said = time.monotonic(), ""
    try:
        found = read()
    except (ValueError, OSError) as error:
        found, said = None, str(error)
    assert len(said) < _CHARACTERS, said[:500]
    assert time.monotonic() - begin < _SECONDS
    return found


def with_bytes_changed(content: bytes, chance: random.Random) -> bytes:
    changed = bytearray(content)
    for _ in range(chance.choice((1, 1, 2, 20))):
        place, length = chance.randrange(len(changed)), chance.choice((1, 8, 1000))
        match chance.randrange(4):
            case 0:
                changed[place] ^= 1 << chance.randrange(8)
            case 1:
                del changed[place : place + length]
            case 2:
                changed[place:place] = chance.randbytes(length)
            case 3:
                changed[place : place + 8] = changed[:8]
        if not changed:
            break
    return bytes(changed)


def mutated_toml(text: str, chance: random.Random) -> bytes:
    for _ in range(chance.choice((1, 1, 2, 5))):
        lines = text.split("\n")
        i = chance.randrange(len(lines))
        match chance.randrange(6):
            case 0:
                numbers = list(re.finditer(r"[0-9][0-9.e+]*", lines[i]))
                if numbers:
                    place = chance.choice(numbers)
                    lines[i] = lines[i][: place.start()] + chance.choice(_VALUES) + lines[i][place.end() :]
            case 1:
                lines[i] = lines[i].split("=")[0] + "= " + chance.choice(_VALUES)
            case 2:
                lines.pop(i)
            case 3:
                lines.insert(i, chance.choice(lines))
            case 4:
                lines[i] = chance.choice(_LINES)
            case 5:
                lines[i] = lines[i][: chance.randrange(len(lines[i]) + 1)]
        text = "\n".join(lines)
    return text.encode("utf-8", "replace")


def fuzz_toml(folder: Path, number: int, chance: random.Random) -> int:
    target = 'environment = "target"\n[radar]\ndensity = 20\nbank_size = 64\n'
    texts = [tiny.TEXT, target, to_toml(jrcjax.paper_params("source"))]
    path, refused = folder / "file.toml", 0
    limit_memory()
    for i in range(number):
        text = chance.choice(texts)
        path.write_bytes(mutated_toml(text, chance) if i % 4 else with_bytes_changed(text.encode(), chance))
        params = outcome(lambda: load_params(path))
        if params is not None:
            jrcjax.check_params(params)
        refused += params is None
    return refused


def changed_json(value, chance: random.Random):
    """A JSON value with something in it exchanged or missing."""
    if not isinstance(value, dict | list) or not value or chance.random() > 0.7:
        return chance.choice(_JUNK)
    copy = value.copy()
    key = chance.choice(list(value) if isinstance(value, dict) else range(len(value)))
    if chance.random() < 0.2:
        del copy[key]
    else:
        copy[key] = changed_json(value[key], chance)
    return copy


def changed_tensors(tensors: dict[str, np.ndarray], chance: random.Random) -> dict[str, np.ndarray]:
    name = chance.choice(list(tensors))
    tensor = tensors[name]
    bits = np.frombuffer(chance.randbytes(tensor.nbytes), tensor.dtype).reshape(tensor.shape)
    others = (None, tensor.astype(np.float64), tensor[None], tensor.ravel()[:0], np.zeros(10**6, np.int8), bits)
    other = chance.choice((*others, np.full_like(tensor, chance.choice((0, 255)))))
    return {key: value for key, value in (tensors | {name: other}).items() if value is not None}


def saved_agent(path: Path) -> Path:
    """A file with an agent that learned nothing."""
    params, config = tiny.tiny_params(), jrcjax.Config(episodes=1, hidden=(4,))
    rule = learner_for("ddqn", params, config)
    agent = jax.eval_shape(lambda: init_agent(jax.random.key(0), jrcjax.HParams(), rule, None))
    state = agent.learner._replace(weights=jax.tree.map(lambda leaf: jnp.zeros(leaf.shape), agent.learner.weights))
    agent = agent._replace(key=jax.random.key(0), learner=state)
    return jrcjax.save_agent(path, agent, params, learner="ddqn", config=config)


def fuzz_agents(folder: Path, number: int, chance: random.Random) -> int:
    path = saved_agent(folder / "agent.safetensors")
    whole, file, refused = path.read_bytes(), layout.read(path), 0
    assert jrcjax.load_agent(path).learner == "ddqn"
    limit_memory()
    for i in range(number):
        match i % 3:
            case 0:
                path.write_bytes(with_bytes_changed(whole, chance))
            case 1:
                about = changed_json(file.about, chance)
                path.write_bytes(layout.content_of(file.tensors, about))
            case 2:
                path.write_bytes(layout.content_of(changed_tensors(file.tensors, chance), file.about))
        agent = outcome(lambda: jrcjax.load_agent(path))
        refused += agent is None
        assert agent is None or i % 3 or path.read_bytes() == whole, "damaged, and loaded"
        if agent is not None:
            jrcjax.check_params(agent.params)
            assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves(agent.values))
    return refused


def fuzz_parts(folder: Path, number: int, chance: random.Random) -> int:
    about = {"configuration": json.dumps({"sweep": "x"}), "provenance": json.dumps({"finished": "now"})}
    rewards = np.random.default_rng(0).normal(size=(2, 30)).astype(np.float32)
    data = xr.Dataset({"reward": (("seed", "episode"), rewards)}, {"seed": np.arange(2)}, about)
    path = parts.write_part(folder, range(2), data)
    whole, refused = path.read_bytes(), 0
    limit_memory()
    for i in range(number):
        path.write_bytes(with_bytes_changed(whole, chance))
        os.utime(path, (i, i))
        is_whole = path.read_bytes() == whole
        found = outcome(lambda: parts.parts_of(folder))
        assert bool(found) == is_whole
        refused += not found
        for aside in folder.glob("*.damaged*"):
            aside.unlink()
    return refused


def main() -> None:
    kind, folder, number = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3])
    bank._known_bank = lambda known: jnp.asarray(np.full((known.modes.num_modes, known.size), 0.5, np.float32))
    fuzz = {"toml": fuzz_toml, "agents": fuzz_agents, "parts": fuzz_parts}[kind]
    print(fuzz(folder, number, random.Random(kind)))


if __name__ == "__main__":
    main()
