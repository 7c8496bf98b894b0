"""Functions that are one program by themselves, and leave no trace inside another."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiling import compiled_programs

import jrcjax
from jrcjax import events, exact, front
from jrcjax.model import environment
from jrcjax.model import events as model_events
from jrcjax.model.params import Factor

ENV = jrcjax.JRCEnv()


def params_of_a_shape_of_its_own() -> jrcjax.EnvParams:
    """Seven levels of weather, which no other test has, so that nothing is compiled before."""
    seven = np.full(7, 1 / 7, np.float32)
    return jrcjax.paper_params("target").replace(weather=Factor(prior=seven, event_probability=seven / 10))


PARAMS = params_of_a_shape_of_its_own()
KEY = jax.random.key(0)
STATE = jrcjax.EnvState(jnp.int32(5), jnp.int32(0), jnp.int32(5))
POLICY = np.full((PARAMS.num_states, PARAMS.num_actions), 1 / PARAMS.num_actions, np.float32)
FUNCTIONS = {
    "reset": lambda p: ENV.reset(KEY, p),
    "step": lambda p: ENV.step(KEY, STATE, 2, p),
    "step_env": lambda p: ENV.step_env(KEY, STATE, 2, p),
    "event_probability": events.event_probability,
    "expected_reward": exact.expected_reward,
    "transition_tensor": exact.transition_tensor,
    "stationary_distribution": exact.stationary_distribution,
    "largest_reward": exact.largest_reward,
    "best_constant_action": exact.best_constant_action,
    "value_iteration": exact.value_iteration,
    "evaluate_policy": lambda p: exact.evaluate_policy(p, POLICY),
    "front": front.front,
    "reachable": front.reachable,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_call_by_itself_is_one_program(name):
    """Else a hundred small programs, each compiled and sent to the device by itself."""
    with compiled_programs() as programs:
        FUNCTIONS[name](PARAMS)
    assert len(programs) == 1, programs


@pytest.mark.parametrize("name", FUNCTIONS)
def test_inside_another_program_it_dissolves(name):
    """Nothing is called inside the program, except what JAX's own library calls."""
    own = {name for module in (environment, model_events, exact, front) for name in vars(module)}
    text = str(jax.make_jaxpr(FUNCTIONS[name])(PARAMS))
    called = {line.split("name=")[1].split()[0] for line in text.splitlines() if "name=" in line}
    assert not called & own


def test_a_step_by_hand_costs_no_program_more():
    _, state = ENV.reset(KEY, PARAMS)
    ENV.step(KEY, state, 0, PARAMS)
    with compiled_programs() as programs:
        for action in range(PARAMS.num_actions):
            _, state, *_ = ENV.step(KEY, state, action, PARAMS)
    assert not programs


@dataclass
class Scaled(jrcjax.JRCEnv):
    """Scaled rewards, and observations from 1 to 2. Like any dataclass it has no hash, and its number may change."""

    scale: float

    def get_obs(self, state, params=None):
        return 1 + super().get_obs(state, params)

    def step_env(self, key, state, action, params):
        obs, state, reward, terminated, info = super().step_env(key, state, action, params)
        return obs, state, self.scale * reward, terminated, info


def test_what_a_subclass_changes_holds_in_a_step():
    env, plain = Scaled(2.0), ENV.step(KEY, STATE, 2, PARAMS)
    changed = env.step(KEY, STATE, 2, PARAMS)
    np.testing.assert_array_equal(changed[0], 1 + plain[0])
    assert changed[2] == 2 * plain[2] != 0
    env.scale = 3.0
    assert env.step(KEY, STATE, 2, PARAMS)[2] == 3 * plain[2]
    np.testing.assert_array_equal(env.reset(KEY, PARAMS)[0], 1 + ENV.reset(KEY, PARAMS)[0])


def test_environments_of_one_class_share_their_programs():
    ENV.step(KEY, STATE, 2, PARAMS)
    with compiled_programs() as programs:
        jrcjax.JRCEnv(PARAMS).step(KEY, STATE, 2)
    assert not programs
