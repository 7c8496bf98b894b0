"""What decides numbers besides the parameters: JAX's settings, which a user's environment may have changed.

Commands pin them (`pin`). Results record what was in force (`in_force`), so that runs under other settings don't mix.
"""

from __future__ import annotations

from typing import Any

import jax

PINNED: dict[str, Any] = {
    "jax_default_prng_impl": "threefry2x32",
    "jax_threefry_partitionable": True,
    "jax_random_seed_offset": 0,
    "jax_enable_x64": False,
    "jax_default_matmul_precision": None,
    "jax_disable_jit": False,
}
"""JAX's own defaults."""


def pin() -> None:
    """Gives JAX the settings of PINNED, whatever the environment's variables say."""
    for name, value in PINNED.items():
        if getattr(jax.config, name, value) != value:
            jax.config.update(name, value)


def pin_accelerator() -> None:
    """Asks an accelerator for products of whole float32 numbers, which are shortened there by default."""
    if jax.default_backend() != "cpu":
        jax.config.update("jax_default_matmul_precision", "highest")


def in_force() -> dict[str, Any]:
    """The settings in force now, and the platform that computes."""
    settings = {name.removeprefix("jax_"): getattr(jax.config, name, value) for name, value in PINNED.items()}
    return {"platform": jax.default_backend()} | settings


def threefry(key: jax.Array) -> jax.Array:
    """A key of the Threefry generator: the key itself, or one that a key of another generator draws."""
    if jax.random.key_data(key).shape == (2,):
        return key
    return jax.random.wrap_key_data(jax.random.bits(key, (2,), "uint32"), impl=PINNED["jax_default_prng_impl"])
