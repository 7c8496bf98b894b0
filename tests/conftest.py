"""Settings that all tests share, and the environments that they look at.

Two CPU devices, so that what is sharded over devices is sharded in the tests, too.
"""

import gc

import jax
import numpy_model
import pytest

import jrcjax
from jrcjax.model.channel import Channel
from jrcjax.model.params import EnvParams, Factor
from jrcjax.radar.bank import make_radar
from jrcjax.training import parallel

jax.config.update("jax_num_cpu_devices", 2)  # nothing above makes an array
parallel.set_flags()  # those of commands, so that both find each other's programs
gc.set_threshold(100_000, 20, 100)  # tracing makes many small objects that stay, and a session's are millions
parallel.keep_compiled()  # most of the time goes into compiling, often of what another process compiled before

PAPER = [(environment, preset) for preset in ("paper", "paper_table") for environment in ("source", "target")]
RANDOM_SEEDS = (0, 1, 2)


def random_params(seed: int) -> EnvParams:
    """A valid environment with 2 or 3 levels per factor, 3 rates and 3 radar modes; persistence from seed 1 on."""
    described = numpy_model.random_description(seed)
    factors = {name: Factor(**described[name]) for name in ("road", "weather", "speed", "nearby")}
    return EnvParams(
        channel=Channel(**described["channel"]),
        **factors,
        radar=make_radar(
            bandwidth=(3e8, 5e8, 7.5e8),
            slope=(1e13, 1.2e13, 1.5e13),
            max_intermediate_frequency=(4e6, 3e6, 2e6),
            density=12.0,
            class_share=(0.5, 0.3, 0.2),
            size_mean=((4.6, 1.9), (0.7, 0.7), (9.0, 2.5)),
            size_std=((0.2, 0.1), (0.1, 0.1), (1.0, 0.2)),
            bank_size=512,
        ),
        reward_weights=described["reward_weights"],
        event_model=described["event_model"],
    )


def short_params(name: str) -> EnvParams:
    """The paper's, with episodes of 20 slots and few objects and placements, which are quick to build in a program."""
    radar = make_radar(
        bandwidth=(300e6, 750e6),
        slope=(1e13, 1.5e13),
        max_intermediate_frequency=(2e6, 3e6),
        density=10.0,
        class_share=(1.0,),
        size_mean=((4.6, 1.9),),
        size_std=((0.2, 0.1),),
        bank_size=64,
        max_density=20.0,
    )
    return jrcjax.paper_params(name).replace(max_steps_in_episode=20, radar=radar)


class Environments(dict):
    """Environments by name, made when first asked for."""

    def __missing__(self, name: str) -> EnvParams:
        first, second = name.split("-")
        if first == "random":
            self[name] = random_params(int(second))
        else:
            self[name] = short_params(second) if first == "short" else jrcjax.paper_params(second, first)
        return self[name]


@pytest.fixture(scope="session")
def environments() -> Environments:
    """The paper's, random and short ones: "paper-source", "paper_table-target", "random-0", "short-target"."""
    return Environments()


@pytest.fixture(params=[f"{preset}-{name}" for name, preset in PAPER] + [f"random-{seed}" for seed in RANDOM_SEEDS])
def any_params(request, environments) -> EnvParams:
    """Each of the environments in turn."""
    return environments[request.param]


@pytest.fixture
def target(environments) -> EnvParams:
    """The paper's target environment."""
    return environments["paper-target"]


@pytest.fixture
def source(environments) -> EnvParams:
    """The paper's source environment."""
    return environments["paper-source"]


@pytest.fixture
def strict():
    """Refuses implicit changes of rank and type."""
    with jax.numpy_rank_promotion("raise"), jax.numpy_dtype_promotion("strict"):
        yield
