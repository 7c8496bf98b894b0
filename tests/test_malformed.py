"""A thousand malformed inputs, made by a seeded generator: each is refused by name before anything compiles."""

import dataclasses
import os
import random

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiling import nothing_compiles
from rich.console import Console

import jrcjax
from benchmarks.__main__ import main as benchmarks_main
from jrcjax import exact, radar
from jrcjax.learners.hparams import check_config, check_hparams
from jrcjax.training import footprint, rollout
from paper_figs.__main__ import main as figures_main
from sweeps.__main__ import main as sweeps_main
from sweeps.engine.run import run_sweep
from sweeps.studies.registry import SWEEPS
from sweeps.sweep import Size

NAN, INF = float("nan"), float("inf")
JUNK = (None, "x", "", b"x", 1j, [], {}, (), object(), NAN, INF, -INF, [NAN], np.array(["a"]), {"a": 1}, range(2), str)
NO_SIZES = (0, -1, 1.5, True, NAN, np.int64(5), np.float32(2), "3", 10**30, None, [], jnp.int32(4), 2**31)
BAD_NUMBERS = (*JUNK, -1.0, -1e30, np.full(3, NAN), np.zeros((2, 2, 2)), np.full(2, -INF), "0.5")
HUGE = 2**31 - 1


def leaves_of(params, prefix=""):
    """Dotted names of all fields that hold numbers."""
    for field in dataclasses.fields(params):
        value, name = getattr(params, field.name), f"{prefix}{field.name}"
        if dataclasses.is_dataclass(value):
            yield from leaves_of(value, f"{name}.")
        elif hasattr(value, "shape") and field.init:
            yield name


def put(params, field, value):
    first, _, rest = field.partition(".")
    return dataclasses.replace(params, **{first: put(getattr(params, first), rest, value) if rest else value})


class Malformed:
    """Makes malformed calls; every method returns a function to call and what the error must name."""

    def __init__(self, seed: int, target, tmp_path):
        self.random = random.Random(seed)
        self.target, self.key, self.path = target, jax.random.key(0), tmp_path
        self.keys, self.state = jax.random.split(self.key, 2), jrcjax.EnvState(jnp.int32(0), jnp.int32(0), jnp.int32(0))
        self.fields = sorted(leaves_of(target))
        self.env = jrcjax.JRCEnv(target)
        for name in ("ddqn", "tlwd"):  # estimates use small constants, such as the features of states
            learner = rollout.learner_for(name, target, jrcjax.Config())
            footprint.agent_bytes(learner, rollout.spec_of(target), jrcjax.Config())
        self.file = tmp_path / "file"
        self.file.write_text("")

    def pick(self, *values):
        return self.random.choice(values)

    def word(self):
        return "".join(self.random.choices("abcdefgh_", k=self.random.randint(4, 9)))

    def environment_field(self):
        field = self.pick(*self.fields)
        value = self.pick(*BAD_NUMBERS)
        return lambda: jrcjax.check_params(put(self.target, field, value)), "; allowed: "

    def environment_shape(self):
        field, value = self.pick(*self.fields), np.zeros(self.random.choices(range(4), k=4))
        return lambda: jrcjax.check_params(put(self.target, field, value)), "; allowed: "

    def slots(self):
        bad = dataclasses.replace(self.target, max_steps_in_episode=self.pick(*NO_SIZES))
        return lambda: jrcjax.train(self.key, bad, learner="ddqn"), "max_steps_in_episode"

    def unknown_field(self):
        where = self.pick(self.target, self.target.road, self.target.channel, self.target.radar, jrcjax.HParams())
        return lambda: where.replace(**{self.word(): 1.0}), ".replace"

    def parameters(self):
        bad = self.pick(*JUNK)
        call = self.pick(
            lambda: jrcjax.train(self.key, bad, learner="ddqn"),
            lambda: jrcjax.train_agents(self.keys, bad, learner="ddqn"),
            lambda: jrcjax.train_source(self.key, bad, jrcjax.HParams(), jrcjax.Config()),
            lambda: jrcjax.transfer(self.key, bad, self.target),
            lambda: jrcjax.transfer(self.key, self.target, bad),
            lambda: jrcjax.check_params(bad),
            lambda: exact.value_iteration(bad),
            lambda: exact.transition_tensor(bad),
            lambda: exact.expected_reward(bad),
            lambda: exact.stationary_distribution(bad),
            lambda: exact.optimal_policy(bad),
            lambda: exact.best_constant_action(bad),
            lambda: exact.evaluate_policy(bad, np.ones((32, 4)) / 4),
            lambda: jrcjax.events.event_probability(bad),
            lambda: self.env.reset_env(self.key, bad),
            lambda: self.env.step_env(self.key, self.state, 0, bad),
        )
        return call, "params"

    def key_of_agents(self):
        bad = self.pick(*JUNK, 0, jnp.zeros(2), jnp.zeros(3, jnp.uint32), jnp.int32(1))
        call = self.pick(
            lambda: jrcjax.train(bad, self.target, learner="ddqn"),
            lambda: jrcjax.train(self.keys, self.target, learner="ddqn"),
            lambda: jrcjax.train_agents(bad, self.target, learner="ddqn"),
            lambda: jrcjax.train_agents(self.key, self.target, learner="ddqn"),
            lambda: jrcjax.transfer(bad, self.target, self.target),
            lambda: jrcjax.train_source(bad, self.target, jrcjax.HParams(), jrcjax.Config()),
            lambda: self.env.reset(bad, self.target),
            lambda: self.env.step(bad, self.state, 0, self.target),
            lambda: radar.miss_ratio(bad, 27.0, 0),
        )
        return call, "key"

    def step_of_environment(self):
        action = self.pick(-1, 4, 1.5, True, *JUNK)
        state = self.pick(*JUNK)
        return self.pick(
            (lambda: self.env.step(self.key, self.state, action, self.target), "action"),
            (lambda: self.env.step(self.key, state, 0, self.target), "state"),
            (lambda: jrcjax.JRCEnv(self.pick(*[j for j in JUNK if j is not None])), "params"),
        )

    def learner(self):
        bad = self.pick(self.word(), None, 3, [], {}, ["ddqn"], b"ddqn", lambda spec, config: 5, object())
        call = self.pick(
            lambda: jrcjax.train(self.key, self.target, learner=bad),
            lambda: jrcjax.train_agents(self.keys, self.target, learner=bad),
            lambda: jrcjax.transfer(self.key, self.target, self.target, learners=(bad,)),
        )
        return call, "learner"

    def source(self):
        bad = self.pick(*[j for j in JUNK if j is not None])
        call = self.pick(
            lambda: jrcjax.train(self.key, self.target, learner="tlwd", source=bad),
            lambda: jrcjax.train_agents(self.keys, self.target, learner="dpr", source=bad),
        )
        return call, "source"

    def hyperparameter(self):
        name = self.pick(*[field.name for field in dataclasses.fields(jrcjax.HParams)])
        bad = dataclasses.replace(jrcjax.HParams(), **{name: self.pick(*BAD_NUMBERS)})
        return self.pick(
            (lambda: check_hparams(bad), f"hparams.{name}"),
            (lambda: jrcjax.train(self.key, self.target, bad, learner="ddqn"), f"hparams.{name}"),
            (lambda: check_hparams(self.pick(*JUNK)), "hparams"),
        )

    def setting(self):
        sizes = ("episodes", "batch_size", "replay_capacity", "demonstrations", "n_step")
        name, value = self.pick(*[(size, value) for size in sizes for value in NO_SIZES], *[
            (name, value)
            for name, values in (
                ("hidden", ([24], (0,), (True,), (1.5,), "x", None, (np.int64(24),))),
                ("optimiser", ("Adam", None, 3, [], np.array(["adam", "sgd"]))),
                ("form", ("tables", None, 3, [], np.array(["auto", "auto"]))),
            )
            for value in values
        ])  # fmt: skip
        bad = dataclasses.replace(jrcjax.Config(), **{name: value})
        call = self.pick(
            lambda: check_config(bad), lambda: jrcjax.train(self.key, self.target, learner="ddqn", config=bad)
        )
        return call, f"config.{name}"

    def too_large(self):
        name, value, learner = self.pick(
            ("episodes", HUGE, "ddqn"), ("replay_capacity", HUGE, "tlwd"), ("batch_size", HUGE, "ddqn"),
            ("hidden", (10**6, 10**6), "ddqn"),
        )  # fmt: skip
        bad = dataclasses.replace(jrcjax.Config(), **{name: value})
        call = self.pick(
            lambda: jrcjax.train(self.key, self.target, learner=learner, config=bad),
            lambda: jrcjax.train_agents(self.keys, self.target, learner=learner, config=bad),
            lambda: jrcjax.transfer(self.key, self.target, self.target, learners=(learner,), config=bad),
        )
        return call, f"config.{name}"

    def names_of_presets(self):
        bad = self.pick(self.word(), *JUNK)
        return self.pick(
            (lambda: jrcjax.paper_params(bad), "environment"),
            (lambda: jrcjax.paper_params("source", bad), "preset"),
            (lambda: radar.miss_ratio(self.key, 27.0, 0, distance=bad), "distance"),
            (lambda: radar.miss_ratio(self.key, 27.0, 0, rule=bad), "rule"),
        )

    def new_radar(self):
        good = {
            "bandwidth": (3e8,), "slope": (1e13,), "max_intermediate_frequency": (2e6,), "density": 4.0,
            "class_share": (1.0,), "size_mean": ((4.0, 2.0),), "size_std": ((0.1, 0.1),),
        }  # fmt: skip
        name = self.pick(*good)
        return lambda: radar.make_radar(**(good | {name: self.pick(*BAD_NUMBERS)})), "radar."

    def solver(self):
        gamma, tolerance = self.pick(1.0, -0.1, *JUNK), self.pick(0.0, -1.0, *JUNK)
        policy = self.pick(np.full((32, 4), NAN), np.ones((32, 4)), np.ones((4, 32)) / 32, *JUNK)
        return self.pick(
            (lambda: exact.value_iteration(self.target, gamma), "gamma"),
            (lambda: exact.value_iteration(self.target, tolerance=tolerance), "tolerance"),
            (lambda: exact.evaluate_policy(self.target, policy), "policy"),
        )

    def size_of_sweep(self):
        name = self.pick("seeds", "episodes", "preset", "pretraining", "demonstrations")
        junk = (self.word(), *JUNK) if name == "preset" else [v for v in NO_SIZES if v != 0 or v is True]
        bad = Size(**{name: self.pick(*junk)})
        out = self.path / "out"
        return lambda: run_sweep(SWEEPS["fig5a"], bad, out, Console(quiet=True), resume=self.pick(True, False)), name

    def place_of_sweep(self):
        out = self.pick(self.file, self.file / "under", *([] if os.access("/proc/1/x", os.F_OK) else ["/proc/1/x"]))
        return lambda: run_sweep(
            SWEEPS["fig5a"], Size(seeds=1), type(self.file)(out), Console(quiet=True), resume=True
        ), str(out)

    def command(self):
        out = ("--out", str(self.path / "out"))
        number = self.pick("0", "-1", "1.5", "x", "", "nan", "1000001", str(10**30))
        main, arguments = self.pick(
            (sweeps_main, ["run", self.word(), *out]),
            (sweeps_main, ["run", "fig5a", "--seeds", number, *out]),
            (sweeps_main, ["run", "fig6", "--episodes", number, *out]),
            (sweeps_main, ["run", "fig6", "--preset", self.word(), *out]),
            (sweeps_main, ["run", "fig6", f"--{self.word()}", *out]),
            (sweeps_main, ["run", "fig6", "--out", str(self.file)]),
            (sweeps_main, ["verify", str(self.path / self.word())]),
            (sweeps_main, [self.word()]),
            (sweeps_main, []),
            (figures_main, ["--seeds", number, *out]),
            (figures_main, ["--episodes", number, *out]),
            (figures_main, ["--only", self.pick("4", "10", "-5", "x"), *out]),
            (figures_main, ["--preset", self.word(), *out]),
            (figures_main, ["--out", str(self.file)]),
            (figures_main, [self.word(), *out]),
            (benchmarks_main, [self.word()]),
            (benchmarks_main, ["--json", str(self.path / self.word() / "x.json")]),
            (benchmarks_main, ["--json", str(self.path)]),
            (benchmarks_main, [f"--{self.word()}"]),
        )

        def call():
            try:
                status = main(arguments)
            except SystemExit as stop:  # from the parser of flags
                status = stop.code
            assert status == 2
            raise ValueError("refused")

        return call, "refused"


KINDS = sorted(name for name in vars(Malformed) if not name.startswith("_") and name not in ("pick", "word"))


@pytest.mark.parametrize("kind", KINDS)
def test_malformed_input_is_refused_by_name(kind, environments, tmp_path, capsys):
    malformed = Malformed(KINDS.index(kind), environments["paper-target"], tmp_path)
    before = sorted(tmp_path.iterdir())
    for _ in range(60):
        call, named = getattr(malformed, kind)()
        with nothing_compiles(), pytest.raises((ValueError, OSError)) as error:
            call()
        assert named in str(error.value)
    assert sorted(tmp_path.iterdir()) == before


def test_there_are_a_thousand_of_them():
    assert 60 * len(KINDS) >= 1000


def test_what_fits_into_memory_is_not_refused(target, monkeypatch):
    """The estimate decides, and not the bound that saves the tracing."""
    spec, config = rollout.spec_of(target), jrcjax.Config()
    learner = rollout.learner_for("ddqn", target, config)
    one = footprint.agent_bytes(learner, spec, config)
    assert 8 * config.replay_capacity <= one <= 16 * config.replay_capacity
    monkeypatch.setattr(footprint, "physical_memory", lambda: 20 * one)
    footprint.check_memory(learner, spec, config, agents=10)
    with pytest.raises(ValueError, match=r"^config\.replay_capacity: '50000'; allowed: .* GiB for 11 agents"):
        footprint.check_memory(learner, spec, config, agents=11)
