"""Agents in blocks on all devices give what a plain vmap gives."""

import math
import os
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jrcjax
from jrcjax import numerics
from jrcjax.learners.hparams import Config, HParams
from jrcjax.training import parallel
from jrcjax.training.rollout import init_agent, learner_for, run_episodes

ROOT = Path(__file__).parents[2]
UNIT = parallel.BLOCK * jax.device_count()
CONFIG = Config(episodes=3, batch_size=8, replay_capacity=64, hidden=(9,), optimiser="sgd")


def environment():
    return jrcjax.paper_params("target").replace(max_steps_in_episode=20)


def train(shared, key):
    return jrcjax.train(key, *shared, learner="ddqn", config=CONFIG)[1]


@pytest.mark.parametrize("count", [1, 2, parallel.BLOCK, UNIT - 1, UNIT, UNIT + 1, 10 * UNIT, 1000])
def test_padded_is_the_next_multiple(count):
    padded = parallel.padded(count)
    assert padded % UNIT == 0
    assert count <= padded < count + UNIT


@pytest.mark.parametrize("cores", [2, 3, 16, 64, 192])
@pytest.mark.parametrize(("points", "most"), [(1, 32), (2, 32), (9, 96)])
def test_ten_seeds_fill_no_more_blocks_on_many_cores_than_on_two(points, most, cores):
    asked = 10 * points
    lanes = parallel.padded(asked, parallel.BLOCK, cores)
    assert asked <= lanes <= most
    assert lanes == parallel.padded(lanes, parallel.BLOCK, cores)
    assert lanes % (parallel.BLOCK * parallel.devices_for(asked, parallel.BLOCK, cores)) == 0


@pytest.mark.parametrize("cores", [2, 16, 64])
@pytest.mark.parametrize("count", [1, 90, 1000, 12_345])
def test_every_core_has_its_share_of_blocks_and_less_than_a_round_is_padding(count, cores):
    devices = parallel.devices_for(count, parallel.BLOCK, cores)
    lanes = parallel.padded(count, parallel.BLOCK, cores)
    assert 2 <= devices <= cores
    assert lanes - count < parallel.BLOCK * devices
    assert lanes // (parallel.BLOCK * devices) == math.ceil(count / (parallel.BLOCK * cores))  # rounds of all cores


def test_pad_agents_repeats_the_last():
    tree = {"a": jnp.arange(3), "keys": jax.random.split(jax.random.key(0), 3), "b": jnp.arange(6.0).reshape(3, 2)}
    padded = parallel.pad_agents(tree, 5)
    assert padded["a"].tolist() == [0, 1, 2, 2, 2]
    assert padded["b"].tolist() == [[0, 1], [2, 3], [4, 5], [4, 5], [4, 5]]
    assert (padded["keys"][2:] == tree["keys"][2]).all()
    same = parallel.pad_agents(tree["a"], 3)
    assert same.tolist() == [0, 1, 2]


@pytest.mark.parametrize("count", [1, UNIT, UNIT + 1])
def test_groups_are_the_padded_agents_in_their_order(count):
    agents = {"x": np.arange(count), "key": jax.random.split(jax.random.key(0), count), "nothing": None}
    groups, padded = parallel.groups(agents), parallel.pad_agents(agents, parallel.padded(count))
    assert {len(group["x"]) for group in groups} == {parallel.group_size(count)}
    np.testing.assert_array_equal(np.concatenate([group["x"] for group in groups]), padded["x"])
    keys = np.concatenate([jax.random.key_data(group["key"]) for group in groups])
    np.testing.assert_array_equal(keys, jax.random.key_data(padded["key"]))


@pytest.mark.parametrize("blocks", [1, 2, 3])
def test_over_agents_is_a_vmap(blocks):
    def function(shared, agent):
        x, y = agent
        return {"sum": shared * x + y.sum(), "vector": y * 2.0}

    count = blocks * UNIT
    agents = (jnp.arange(count, dtype=jnp.float32), jnp.arange(count * 3, dtype=jnp.float32).reshape(count, 3))
    got = parallel.over_agents(function)(jnp.float32(3.0), agents)
    wanted = jax.vmap(function, in_axes=(None, 0))(jnp.float32(3.0), agents)
    jax.tree.map(np.testing.assert_array_equal, got, wanted)


@pytest.mark.parametrize("blocks", [1, 2])
def test_all_devices_take_an_equal_share(blocks):
    got = parallel.over_agents(lambda shared, agent: agent + shared)(1, jnp.arange(blocks * UNIT))
    shares = {shard.device: shard.data.shape for shard in got.addressable_shards}
    assert shares == dict.fromkeys(jax.devices(), (blocks * parallel.BLOCK,))


@pytest.mark.parametrize(("count", "block"), [(1, 32), (64, 32), (100, 64), (1280, 640), (5000, 2528), (9000, 4096)])
def test_blocks_of_an_accelerator_hold_its_share(monkeypatch, count, block):
    """Devices of this machine stand for two accelerators: an agent's numbers are those of a CPU's blocks."""
    monkeypatch.setattr(parallel, "devices_for", lambda count, block=None, available=None: 2)
    monkeypatch.setattr(jax, "device_count", lambda: 2)
    agents = jnp.arange(float(count))
    wanted = 3.0 * agents + 1.0
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    assert parallel.block_for(count) == block
    lanes = parallel.padded(count)
    assert lanes % (2 * block) == 0
    assert lanes < count + 2 * block
    assert parallel.block_for(lanes) == block  # the padded agents are worked on in the same blocks
    whole = parallel.pad_agents(agents, lanes)
    triple = parallel.over_agents(lambda one, agent: 3.0 * agent + one)
    np.testing.assert_array_equal(triple(1.0, whole)[:count], wanted)
    of_groups = [triple(1.0, group) for group in parallel.groups(agents)]
    np.testing.assert_array_equal(np.concatenate(of_groups)[:count], wanted)
    in_place = parallel.over_agents(lambda one, agent: (3.0 * agent + one, agent), in_place=True)
    np.testing.assert_array_equal(in_place(1.0, jnp.copy(whole))[0][:count], wanted)


def test_agents_are_refused_unless_they_fill_blocks():
    with pytest.raises((ValueError, TypeError)):
        parallel.over_agents(lambda shared, agent: agent)(0, jnp.arange(UNIT + 1))


@pytest.fixture(scope="module")
def keys():
    return jax.random.split(jax.random.key(7), 3 * UNIT)


@pytest.fixture(scope="module")
def logs(keys):
    """Logs of training the first 1, 2 and 3 units of agents."""
    run = parallel.over_agents(train)
    return [run((environment(), HParams()), keys[: n * UNIT]) for n in (1, 2, 3)]


def test_training_in_blocks_is_training_one_by_one(keys, logs):
    """To rounding: XLA multiplies matrices of a batch in another order than those of one agent."""
    single = jax.jit(train)
    for agent in (0, 1, parallel.BLOCK, 2 * UNIT, 3 * UNIT - 1):
        alone = single((environment(), HParams()), keys[agent])
        jax.tree.map(lambda a, b, i=agent: np.testing.assert_allclose(a, b[i], rtol=1e-5), alone, logs[2])


def test_numbers_do_not_depend_on_how_many_agents_train(logs):
    """Blocks of fixed size on one code path: several blocks give the same bits whatever their number."""
    one, two, three = logs
    jax.tree.map(lambda a, b: np.testing.assert_array_equal(a, b[: len(a)]), two, three)
    # A single block is compiled without a loop around it, so its last bits may differ.
    jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b[: len(a)], rtol=1e-5), one, three)


def test_agents_with_different_keys_differ(logs):
    assert len(np.unique(np.asarray(logs[2].reward), axis=0)) == 3 * UNIT


def test_in_place_gives_the_same_agents_and_results():
    def one(step, agent):
        return {name: leaf + step for name, leaf in agent.items()}, agent["a"].sum()

    agents = {"a": jnp.arange(6.0 * UNIT).reshape(3 * UNIT, 2), "b": jnp.arange(3 * UNIT)}
    wanted = parallel.over_agents(one)(jnp.int32(5), agents)
    got = parallel.over_agents(one, in_place=True)(jnp.int32(5), jax.tree.map(jnp.copy, agents))
    jax.tree.map(np.testing.assert_array_equal, got, wanted)
    np.testing.assert_array_equal(got[0]["b"], np.arange(3 * UNIT) + 5)


@pytest.mark.parametrize("blocks", [1, 3])
@pytest.mark.parametrize("name", ["ddqn", "tlwd"])
def test_a_slot_computes_the_network_once(name, blocks):
    """For the action, the target and the loss; XLA must see that they are the same, in whatever loop it is."""
    params = environment()
    config = Config(episodes=2, batch_size=8, replay_capacity=64, demonstrations=32, pretraining=0)
    learner = learner_for(name, params, config)
    source = jax.eval_shape(
        lambda key: jrcjax.train_source(key, params, HParams(), config)[0], jax.random.key(0)
    )  # shapes are all that compiling needs
    agents = jax.eval_shape(
        jax.vmap(lambda key, source: init_agent(key, HParams(), learner, source), in_axes=(0, None)),
        jax.random.split(jax.random.key(0), blocks * UNIT),
        source,
    )

    def run(first, agent):
        return run_episodes(agent, first, 2, params, HParams(), learner)

    text = parallel.over_agents(run, in_place=True).lower(jnp.int32(0), agents).compile().as_text()
    forward = [
        line.count("while/body")
        for line in text.splitlines()
        if " dot(" in line and 'ColumnDense_1/dot_general"' in line and "transpose(" not in line
    ]
    assert forward.count(max(forward)) == 1


# --- Commands in other people's environments --------------------------------------------------------------------------

_LANES = """
import jax
from jrcjax.training import parallel
jax.config.update("jax_num_cpu_devices", 8)
double = parallel.over_agents(lambda shared, agent: 2 * agent)
for count in (1, 10, 40, 100, 128, 129, 1000):
    agents = jax.numpy.arange(parallel.padded(count))
    doubled = double(0, agents)
    assert (doubled == 2 * agents).all()
    groups = parallel.groups(agents[:count])
    assert sum(map(len, groups)) == len(agents), (count, [len(group) for group in groups])
    print(count, len(agents), len(doubled.sharding.device_set))
"""


def run_python(code: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess:
    """Runs a program in this project, in an environment with other variables."""
    command = [sys.executable, "-W", "error", "-c", code, *arguments]
    return subprocess.run(command, cwd=ROOT, env=os.environ | environment, capture_output=True, text=True)


def test_many_cores_do_no_more_than_is_asked():
    done = run_python(_LANES, JAX_PLATFORMS="cpu")
    assert done.stderr == ""
    rows = [tuple(map(int, line.split())) for line in done.stdout.splitlines()]
    assert rows == [(1, 32, 2), (10, 32, 2), (40, 48, 3), (100, 112, 7), (128, 128, 8), (129, 160, 5), (1000, 1024, 8)]


def test_an_accelerator_is_asked_for_whole_numbers(monkeypatch):
    with jax.default_matmul_precision("tensorfloat32"):
        numerics.pin_accelerator()
        assert numerics.in_force()["default_matmul_precision"] == "tensorfloat32"
    asked = {}
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    monkeypatch.setattr(jax.config, "update", asked.__setitem__)
    numerics.pin_accelerator()
    assert asked == {"jax_default_matmul_precision": "highest"}


_PINNED = """
from jrcjax import numerics
from jrcjax.training import parallel
parallel.start()
import jax
numbers = jax.random.normal(jax.random.key(0), (3,)), jax.numpy.arange(2)
print(numerics.in_force(), *(leaf.tolist() for leaf in numbers), *(leaf.dtype for leaf in numbers))
"""
OTHERS = {
    "JAX_THREEFRY_PARTITIONABLE": "0",
    "JAX_DEFAULT_PRNG_IMPL": "rbg",
    "JAX_ENABLE_X64": "1",
    "JAX_DEFAULT_MATMUL_PRECISION": "bfloat16",
    "JAX_RANDOM_SEED_OFFSET": "3",
}


def test_commands_draw_the_same_numbers_whatever_a_users_variables_say():
    plain, other = run_python(_PINNED), run_python(_PINNED, **OTHERS)
    assert plain.returncode == 0, plain.stderr
    assert (plain.stdout, plain.stderr) == (other.stdout, other.stderr)


def test_a_platform_that_is_not_there_is_one_line():
    code = "from jrcjax.training import parallel; parallel.start()"
    done = run_python(code, JAX_PLATFORMS="nonsense")
    assert "ValueError: JAX_PLATFORMS: 'nonsense'; allowed: cpu, or a platform that works here" in done.stderr


@pytest.mark.parametrize(
    ("flag", "known"),
    [
        (("--xla_cpu_prefer_vector_width", "512"), True),
        (("--xla_backend_extra_options", "-unroll-full-max-count=8,xla_cpu_use_multi_output_fusion=true"), True),
        (("--xla_cpu_no_such_flag", "1"), False),
        (("--xla_backend_extra_options", "-no-such-option=8"), False),
    ],
)
def test_flags_that_this_jaxlib_does_not_know_are_left_out(flag, known, monkeypatch):
    monkeypatch.setattr(parallel, "_XLA_FLAGS", dict([flag]))
    monkeypatch.setenv("XLA_FLAGS", "")
    monkeypatch.setattr(parallel.jax.config, "update", lambda *args: None)
    parallel.use_all_cores()
    assert os.environ["XLA_FLAGS"] == ("=".join(flag) if known else "")


def test_a_user_without_a_home_keeps_nothing_compiled():
    code = "import os, jax; from jrcjax.training import parallel; parallel.keep_compiled()"
    code += "; print(jax.config.jax_compilation_cache_dir)"
    nobody = "import os; [os.environ.pop(name, 0) for name in ('HOME', 'XDG_CACHE_HOME', 'JAX_COMPILATION_CACHE_DIR')]"
    no_entry = "import pwd; pwd.getpwuid = lambda uid: {}[uid]"
    done = run_python(f"{nobody}; {no_entry}; {code}")
    assert (done.returncode, done.stdout.strip()) == (0, "None"), done.stderr
