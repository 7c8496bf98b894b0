"""The agent axis on all cores: blocks of fixed size, sharded over one device per core.

XLA runs one batched program on a CPU mostly on one core. With one device per core and the agents shared between them
both cores work, and blocks of fixed size keep each block's memory in the cache and its compiled code the same whatever
the number of agents. An accelerator is one device with larger blocks.
"""

from __future__ import annotations

import functools
import mmap
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import jaxlib
import numpy as np
from jax.sharding import AxisType, Mesh, PartitionSpec

from jrcjax import numerics
from jrcjax.checks import refuse
from jrcjax.machine import usable_cores

BLOCK = 16
"""Agents that one CPU device advances at once: their memory stays in the cache."""
ACCELERATOR_BLOCK = 4096
"""The most that an accelerator advances at once: beyond it a slot takes longer in proportion."""
_WARP = 32
_XLA_FLAGS = {
    # Loops over 24 or 32 numbers stay loops, which LLVM turns into vector instructions; unrolled they would be scalar.
    # What several loops read is computed once, in one loop with several results.
    "--xla_backend_extra_options": "-unroll-full-max-count=8,xla_cpu_use_multi_output_fusion=true",
    "--xla_cpu_prefer_vector_width": "512",
    # Each core has a device, so nothing is gained by handing half of a loop of some microseconds to another thread.
    "--xla_disable_hlo_passes": "cpu-parallel-task-assigner",
}


def start() -> None:
    """What every command does before its first array: pinned numerics, all cores, and programs kept compiled.

    Raises:
      ValueError: naming JAX_PLATFORMS, if this machine has none of the platforms that it asks for.
    """
    use_all_cores()
    keep_compiled()
    try:
        jax.devices()
    except RuntimeError as error:
        asked = jax.config.jax_platforms or ""  # pyright: ignore[reportAttributeAccessIssue]
        refuse("JAX_PLATFORMS", asked, f"cpu, or a platform that works here ({str(error).splitlines()[0]})")
    numerics.pin_accelerator()


def use_all_cores() -> None:
    """Pins numerics, makes one JAX device per core, at least two, and lets XLA use the cores' vector instructions.

    XLA compiles other code for a single device, which rounds differently; with two on one core numbers are those of
    any other number of cores. Call it before any array is made; on an accelerator it changes nothing but numerics.
    Flags that XLA_FLAGS has already are left, and so are those that this jaxlib does not know, which would end the
    process.

    XLA of jaxlib 0.10 ends the process when it compiles some programs that are not this package's, such as a DQN of
    flax and optax, with `xla_cpu_use_multi_output_fusion`, one of these flags. Beside such programs set
    XLA_FLAGS=--xla_backend_extra_options=-unroll-full-max-count=8 before, which leaves it out.
    """
    numerics.pin()
    set_flags()
    jax.config.update("jax_num_cpu_devices", max(usable_cores(), 2))


def set_flags() -> None:
    """Adds the flags of _XLA_FLAGS to XLA_FLAGS, for the backend that JAX is yet to start."""
    given = os.environ.get("XLA_FLAGS", "")
    missing = {name: value for name, value in _XLA_FLAGS.items() if name not in given}
    added = [f"{name}={value}" for name, value in missing.items() if _is_known(name, value)]
    os.environ["XLA_FLAGS"] = " ".join([given, *added]).strip()


def _is_known(name: str, value: str) -> bool:
    """Whether jaxlib's library holds all words of a flag; without a library to look into they are taken as unknown."""
    words = [word for word in re.split(r"[=,]", f"{name},{value}") if not word.isdigit() and word != "true"]
    return all(map(_in_library, words))


@functools.cache
def _in_library(word: str) -> bool:
    for path in Path(jaxlib.__file__).parent.glob("*.so"):
        with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            if content.find(word.lstrip("-").encode()) >= 0:
                return True
    return False


def keep_compiled() -> None:
    """Keeps compiled programs on disk, so that a second run starts in seconds.

    The folder is `jrcjax` in XDG_CACHE_HOME, or in ~/.cache; JAX_COMPILATION_CACHE_DIR overrules it. A user without
    a home has none.
    """
    if jax.config.jax_compilation_cache_dir is None:  # pyright: ignore[reportAttributeAccessIssue]
        try:
            base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        except RuntimeError:
            return
        jax.config.update("jax_compilation_cache_dir", str(Path(base) / "jrcjax"))
        # A command compiles a hundred small programs, too, which take two seconds together.
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


def mesh(devices: int) -> Mesh:
    """The first so many devices along one axis of agents."""
    return Mesh(np.array(jax.devices()[:devices]), ("agents",), axis_types=(AxisType.Auto,))


def block_for(count: int) -> int:
    """Agents that one device advances at once, of so many: on an accelerator its share, in whole warps."""
    if jax.default_backend() == "cpu":
        return BLOCK
    share = -(-count // jax.device_count())
    return min(-(-share // _WARP) * _WARP, ACCELERATOR_BLOCK)


def devices_for(count: int, block: int | None = None, available: int | None = None) -> int:
    """Devices that work on so many agents: no more than take part in every round of blocks, and two if there are.

    Args:
      count: agents.
      block: agents that one device advances at once, `block_for` their number if None.
      available: devices, those of this process if None.
    """
    blocks, available = -(-count // (block or block_for(count))), available or jax.device_count()
    return min(max(-(-blocks // rounds_for(count, block, available)), 2), available)


def rounds_for(count: int, block: int | None = None, available: int | None = None) -> int:
    """Blocks that the busiest device advances one after the other; the arguments are those of `devices_for`."""
    return -(-count // ((block or block_for(count)) * (available or jax.device_count())))


def padded(count: int, block: int | None = None, available: int | None = None) -> int:
    """The number of agents that `over_agents` works with for `count` of them: a multiple of block times devices.

    The arguments are those of `devices_for`.
    """
    block = block or block_for(count)
    unit = block * devices_for(count, block, available)
    return -(-count // unit) * unit


@functools.partial(jax.jit, static_argnums=1)  # leaf by leaf each would be some programs, and a learner has many
def pad_agents(tree: Any, count: int) -> Any:
    """Repeats the last agent along the leading axis of every leaf up to `count` agents."""

    def pad(leaf: jax.Array) -> jax.Array:
        return jnp.concatenate([leaf, jnp.repeat(leaf[-1:], count - leaf.shape[0], axis=0)])

    return jax.tree.map(pad, tree)


@functools.partial(jax.jit, static_argnums=1)
def first_agents(tree: Any, count: int) -> Any:
    """The first `count` along the leading axis of every leaf: what `pad_agents` added goes."""
    return jax.tree.map(lambda leaf: leaf[:count], tree)


def groups(tree: Any) -> list[Any]:
    """Agents in groups that give each device that works on them one block, the last of them padded as by `pad_agents`.

    A function compiled for such a group is the same code for any number of agents, and so are an agent's bits.
    """
    count = jax.tree.leaves(tree)[0].shape[0]
    size = group_size(count)
    rows = np.minimum(np.arange(padded(count)), count - 1).reshape(-1, size)
    return [jax.tree.map(functools.partial(_taken, rows=of_group), tree) for of_group in rows]


def group_size(count: int) -> int:
    """Agents of one of the `groups` of so many agents."""
    return block_for(count) * devices_for(count)


def _taken(leaf: Any, rows: np.ndarray) -> Any:
    return on_host(lambda array: array[rows], leaf)


def on_host(function: Callable[..., np.ndarray], *leaves: Any) -> Any:
    """A NumPy function of arrays; of random keys it takes their data, and gives keys.

    As programs such functions would be compiled for every shape, which waits for what is being compiled already.
    """
    if isinstance(leaves[0], jax.Array) and jnp.issubdtype(leaves[0].dtype, jax.dtypes.prng_key):
        data = jax.device_put(on_host(function, *map(jax.random.key_data, leaves)))
        return jax.random.wrap_key_data(data, impl=jax.random.key_impl(leaves[0]))
    return function(*map(np.asarray, leaves))


def over_agents(function: Callable, block: int | None = None, *, in_place: bool = False) -> Callable:
    """`function(shared, agents)` of one agent as a compiled function of many.

    Args:
      function: pure; `shared` is the same for all agents, `agents` a pytree of one agent's values.
      block: agents that one device advances at once, `block_for` their number if None; more where little is done per
        agent.
      in_place: for a function that returns (agents, result): the new agents take the memory of the old ones, which are
        gone after the call.

    Returns:
      A function of the same arguments, every leaf of `agents` and of the result with a leading axis of agents, whose
      length must be a multiple of `block` times the devices that work on it (see `padded`); otherwise it raises
      ValueError.
    """
    along, everywhere = PartitionSpec("agents"), PartitionSpec()
    of_block = jax.vmap(function, in_axes=(None, 0))

    def on_one_device(size, shared, agents):
        blocks = jax.tree.leaves(agents)[0].shape[0] // size
        # A single block needs no loop, which would copy the agents' memory in and out.
        if blocks == 1:
            return of_block(shared, agents)
        if in_place:
            return _in_place(of_block, shared, agents, blocks)
        split = jax.tree.map(lambda a: a.reshape(blocks, size, *a.shape[1:]), agents)
        return _joined(jax.lax.map(lambda agents: of_block(shared, agents), split))

    def checked(shared, agents):
        count = jax.tree.leaves(agents)[0].shape[0]
        size = block or block_for(count)
        devices = devices_for(count, size)
        if count % (size * devices):
            refuse("agents", count, f"a multiple of {size} agents x {devices} devices")
        specs = {"in_specs": (everywhere, along), "out_specs": along}
        of_device = functools.partial(on_one_device, size)
        return jax.shard_map(of_device, mesh=mesh(devices), **specs, check_vma=False)(shared, agents)

    return jax.jit(checked, donate_argnums=1 if in_place else ())


def _joined(blocks: Any) -> Any:
    return jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), blocks)


def _in_place(of_block: Callable, shared: Any, agents: Any, blocks: int) -> tuple[Any, Any]:
    """One block after the other, each written over what it was."""

    def one(agents, i):
        def here(a):
            return i * (a.shape[0] // blocks)

        old = jax.tree.map(lambda a: jax.lax.dynamic_slice_in_dim(a, here(a), a.shape[0] // blocks), agents)
        new, result = of_block(shared, old)
        return jax.tree.map(lambda a, b: jax.lax.dynamic_update_slice_in_dim(a, b, here(a), 0), agents, new), result

    agents, results = jax.lax.scan(one, agents, jnp.arange(blocks))
    return agents, _joined(results)
