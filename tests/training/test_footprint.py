"""Memory of agents, told before anything is compiled."""

import functools

import jax.numpy as jnp
import optax
import pytest

from jrcjax.learners import LEARNERS, Spec, ddqn
from jrcjax.learners.hparams import Config
from jrcjax.training import footprint

SMALL = {"replay_capacity": 3, "demonstrations": 2, "batch_size": 1, "n_step": 1}
SPECS = {"one": Spec((1,), 1, 1), "paper": Spec((2,) * 5, 4, 300), "many": Spec((64,) * 3, 7, 50)}
CONFIGS = {
    "paper": Config(),
    "smallest": Config(hidden=(), **SMALL),
    "wide": Config(hidden=(1, 500, 1), **SMALL),
    "table": Config(form="table", **SMALL),
    "soft": Config(target_update="soft", hidden=(80, 80), **SMALL),
    "long returns": Config(**SMALL | {"n_step": 300}),
}


@pytest.mark.parametrize("config", CONFIGS)
@pytest.mark.parametrize("spec", SPECS)
@pytest.mark.parametrize("learner", LEARNERS)
def test_the_bound_is_none_of_less_than_the_estimate(learner, spec, config):
    rule = LEARNERS[learner](SPECS[spec], CONFIGS[config])
    estimate = footprint.agent_bytes(rule, SPECS[spec], CONFIGS[config])
    assert footprint.bytes_at_most(rule, SPECS[spec], CONFIGS[config]) >= estimate


def test_agents_too_large_by_what_no_setting_says_are_refused(monkeypatch):
    """Tables of all states, the state of a learner of one's own, and that of an optimiser of one's own."""
    monkeypatch.setattr(footprint, "physical_memory", lambda: 2**30)
    spec, config = Spec((2,) * 25, 4, 300), Config()
    with pytest.raises(ValueError, match=r"^shape: '\(2, 2.*; allowed: sizes that fit 1 GiB .* 2 GiB for 1 agents"):
        footprint.check_memory(LEARNERS["q_learning"](spec, config), spec, config, agents=1)
    refused = functools.partial(pytest.raises, ValueError, match="allowed: sizes that fit 1 GiB of memory")
    spec = SPECS["paper"]
    hoarding = ddqn(spec, config)._replace(init=lambda key, hparams, source: jnp.zeros(2**28))
    with refused():
        footprint.check_memory(hoarding, spec, config, agents=1)
    config = Config(optimiser=optax.GradientTransformation(lambda weights: jnp.zeros(2**28), lambda *given: given[:2]))
    with refused():
        footprint.check_memory(ddqn(spec, config), spec, config, agents=1)
