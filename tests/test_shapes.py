"""The shapes in signatures hold: a process checks each call of the model's functions against them."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PROGRAM = """
import jaxtyping
with jaxtyping.install_import_hook(MODULES, "beartype.beartype"):
    import jrcjax
    from jrcjax import exact, front
import jax
import jax.numpy as jnp

radar = jrcjax.radar.make_radar(
    bandwidth=(3e8, 7.5e8), slope=(1e13, 1.5e13), max_intermediate_frequency=(2e6, 2e6),
    density=10.0, class_share=(0.5, 0.5), size_mean=((4.6, 1.9), (0.7, 0.7)), size_std=((0.2, 0.1), (0.1, 0.1)),
    bank_size=16, max_density=20.0,
)
three = dict(prior=(0.5, 0.3, 0.2), event_probability=(0.0, 0.1, 0.2), persistence=0.5)
paper = jrcjax.paper_params("target")
params = paper.replace(radar=radar, speed=paper.speed.replace(**three), max_steps_in_episode=5)  # S = 48
jrcjax.check_params(params)
env, key = jrcjax.JRCEnv(params), jax.random.key(0)
# Calls are checked while they are traced, so nothing need be compiled and run.
_, state = jax.eval_shape(env.reset, key)
jax.eval_shape(jax.vmap(env.step, in_axes=(0, None, None, None)), jax.random.split(key, 3), state, 3, params)
jax.eval_shape(exact.evaluate_policy, params, jax.eval_shape(exact.optimal_policy, params))
jax.eval_shape(exact.evaluate_policy, params, jax.eval_shape(exact.best_constant_action, params))
for function in (exact.largest_reward, exact.transition_tensor, front.reachable):
    jax.eval_shape(function, params)
for wrong in (
    lambda: jax.eval_shape(exact.evaluate_policy, params, jnp.ones(48) / 4),
    lambda: jax.eval_shape(exact.level_transition, jnp.ones(2) / 2, jnp.ones(2)),
):
    try:
        wrong()
    except jaxtyping.TypeCheckError:
        continue
    raise SystemExit("a wrong shape passed")
"""
MODULES = ["jrcjax.radar", "jrcjax.model", "jrcjax.exact", "jrcjax.policies", "jrcjax.front"]


@pytest.mark.slow
def test_shapes_in_signatures():
    program = f"MODULES = {MODULES!r}\n{PROGRAM}"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
