"""Questions that the paper leaves open act on those who read them, and on nobody else."""

import functools
import itertools
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console
from safetensors.numpy import load_file

from jrcjax.config.paths import Range
from jrcjax.training.transfer import TARGET_LEARNERS
from paper_figs.claims.effects import learners_of, metric_of
from paper_figs.claims.table import CLAIMS
from paper_figs.studies.multiverse import can_act
from sweeps.engine.run import run_sweep
from sweeps.results import store
from sweeps.results.agents import agents_path
from sweeps.studies.multiverse import block_sweep
from sweeps.studies.readings import READINGS, SOURCE, is_static, range_of
from sweeps.sweep import SMOKE

SIZE = replace(SMOKE, seeds=1)
SOON = {"hparams.epsilon_slots": 300.0}
"""What learners know shows after an episode."""
SIMULATED = ("reward", "throughput", "miss_detection")
METRICS = (*SIMULATED, "policy_reward")


def another(where: Range) -> float:
    """An answer that is no default."""
    return where.levels[1] if where.levels else where.low + 0.7 * (where.high - where.low)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Source and target under the default, and under another answer to each question in turn, by path."""
    asked = [reading for reading in READINGS if not is_static(reading)]
    answers = {"": SOON} | {r.path: SOON | {r.path: another(range_of(r))} for r in asked}
    answers[SOURCE] |= {"hparams.discount": 0.5}
    answers["beside the source"] = SOON | {"hparams.discount": 0.5}
    out = tmp_path_factory.mktemp("results")
    sweep = block_sweep("asked", range(len(answers)), list(answers.values()), points=(0,), seeds_per_part=1)
    run_sweep(sweep, SIZE, out, Console(), resume=False, save_agents=True)
    found = [store.load(out / name, 1) for name in (sweep.source.name, sweep.name)]
    weights = load_file(agents_path(out / sweep.name, range(1)))
    return {
        path: (
            *(metrics_of(of.isel(point=i)) for of in found),
            {name: of[i] for name, of in weights.items() if name.startswith("agents.")},
        )
        for i, path in enumerate(answers)
    }


def metrics_of(data):
    names = [str(name) for name in data["algorithm"].values]
    return {(name, metric): data[metric].sel(algorithm=name).values for name in names for metric in METRICS}


def changed(found, beside):
    return {name for name in beside if not np.array_equal(found[name], beside[name], equal_nan=True)}


@pytest.mark.slow
def test_a_question_acts_on_those_who_read_it_alone(results):
    for question in [reading for reading in READINGS if not is_static(reading)]:
        beside = results["beside the source"] if question.path == SOURCE else results[""]
        in_source, in_target, weights = map(changed, results[question.path], beside)
        readers, metrics = question.learners or TARGET_LEARNERS, question.metrics or METRICS
        assert in_target <= set(itertools.product(readers, metrics)), question.path
        assert {name.split(".")[1] for name in weights} <= set(readers), question.path
        assert in_target or weights, question.path
        if question.path.startswith("env.") and not (question.learners or question.metrics):
            for simulated in in_source, in_target:  # what happens changes, not only what is computed of it
                assert simulated & {("round_robin", name) for name in SIMULATED}, question.path
        of_source = ("ddqn", "q_learning") if question.path == SOURCE else readers
        assert {name for name, _ in in_source} <= set(of_source), question.path


def asked_of(claim, **of_what):
    (one,) = [c for c in CLAIMS if c.claim == claim]
    return {reading.path for reading in READINGS if can_act(reading, one, **of_what)}


def test_each_claim_knows_its_learners_and_its_metric():
    learners, metrics = ({c.claim: of(c.measure) for c in CLAIMS} for of in (learners_of, metric_of))
    assert learners["C3 (TLwD, much)"] == {"tlwd", "ddqn"}
    assert learners["C8 (throughput, DDQN)"] == {"tlwd", "ddqn", "dpr"}
    assert learners["C12 (miss detection, DPR)"] == {"dpr", "ddqn"}
    assert learners["C12 (throughput, DDQN)"] == {"ddqn"}
    assert learners["C15 (episodes)"] == {"tlwd"}
    assert learners["C2 (Round Robin, source)"] == {"round_robin", "ddqn", "q_learning"}
    assert all(learners.values())
    assert {metrics[claim] for claim in ("C9", "C14 (DPR)", "C13 (miss detection, TLwD)")} == {"miss_detection"}
    assert metrics["C12 (throughput, TLwD)"] == "throughput"
    assert {metrics[claim] for claim in ("C1 (stable)", "C4 (reward)", "C13 (highest)")} == {"reward"}


def test_only_questions_that_can_act_are_asked_of_a_claim():
    tlwd = {"hparams.margin", "config.n_step", "hparams.importance_start"}
    assert not asked_of("C6 (fall, DDQN)") & (tlwd | {SOURCE, "hparams.step_exponent", "env.miss_convention"})
    assert asked_of("C6 (fall, DDQN)") >= {"hparams.learning_rate", "config.optimiser", "env.radar.distance"}
    assert asked_of("C5 (highest)") >= tlwd | {SOURCE}
    assert SOURCE in asked_of("C1 (reached)") & asked_of("C2 (Q-learning, source)")
    assert "hparams.learning_rate" not in asked_of("C2 (Q-learning, target)")
    assert "hparams.step_exponent" in asked_of("C2 (Q-learning, target)")
    counts = {"env.count_event_packets", "env.miss_convention"}
    assert asked_of("C9") & counts == {"env.miss_convention"}
    assert asked_of("C8 (throughput, TLwD)") & counts == {"env.count_event_packets"}


def test_whether_anybody_converges_is_asked_of_all_who_are_there():
    known = functools.partial(asked_of, on_whether_known=True)
    assert known("C2 (Q-learning, target)") == known("C3 (DPR, about 100)") == known("C3 (TLwD, about 100, curve)")
    assert known("C2 (Q-learning, target)") == {r.path for r in READINGS if "reward" in r.metrics or not r.metrics}
    assert known("C1 (reached)") == known("C2 (Q-learning, source)") == known("C1 (about 200)")
    assert known("C1 (reached)") >= asked_of("C1 (reached)") | asked_of("C2 (Q-learning, source)")
    assert not known("C1 (reached)") & {"hparams.margin", "hparams.initial_weights"}  # TLwD is not in the source
    assert known("C3 (TLwD, much)") == asked_of("C3 (TLwD, much)")  # known where one of the two converges
