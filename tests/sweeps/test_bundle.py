"""Sweeps that are run together: what is run once for several of them, in what order, and that each gets its own."""

import shutil
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rich.console import Console

from jrcjax import files
from jrcjax.config.paths import parameter_at
from jrcjax.config.stacking import Values, changes, stacked
from jrcjax.training import parallel
from sweeps.design import along, table
from sweeps.engine.bundle import bundled
from sweeps.engine.job import Job
from sweeps.engine.plan import plan, to_do
from sweeps.engine.run import run_sweep, run_together
from sweeps.engine.sources import sources_of
from sweeps.preset import base_of
from sweeps.results import store
from sweeps.results.parts import parts_of
from sweeps.studies.registry import SWEEPS
from sweeps.studies.source import SOURCE
from sweeps.sweep import Size

TINY = Size(seeds=2, episodes=2, pretraining=12, demonstrations=70)
QUIET = Console(quiet=True)
FIGURES = [sweep for name, sweep in SWEEPS.items() if name.startswith("fig")]
_P, _TAU, _OMEGA = (SWEEPS[name].design.columns[0] for name in ("fig6", "fig7", "fig8"))
FEW = [
    SWEEPS["fig5a"],
    SWEEPS["fig5b"],
    replace(SWEEPS["fig6"], design=along(_P.name, _P.path, (0.4, 0.9))),  # 0.4 is the target's
    replace(SWEEPS["fig7"], design=along(_TAU.name, _TAU.path, (0.1, 0.7))),  # and 0.7
    replace(SWEEPS["fig8"], design=along(_OMEGA.name, _OMEGA.path, (8.0,))),
    SWEEPS["fig9"],
]


def digests(out, names):
    """What makes the results of sweeps the same: a hash of all numbers, names and settings, by sweep and seeds."""
    return {(name, part.seeds): part.digest for name in names for part in parts_of(out / name)}


def names_of(sweeps, size, out):
    return [[member.job.sweep.name for member in bundle.members] for bundle in plan(sweeps, size, out)]


def test_together_or_alone_a_figure_has_the_same_bits(tmp_path):
    names = [sweep.name for sweep in FEW] + [SOURCE.name]
    assert list(run_together(FEW, TINY, tmp_path / "together", QUIET)) == FEW
    for sweep in FEW:
        run_sweep(sweep, TINY, tmp_path / "alone", QUIET, resume=False)
    found = digests(tmp_path / "together", names)
    assert {name for name, _ in found} == set(names)
    assert found == digests(tmp_path / "alone", names)
    for sweep in FEW:  # also to a reader
        a, b = (store.load(tmp_path / where / sweep.name, 2).drop_attrs() for where in ("together", "alone"))
        assert a.identical(b)


def test_the_paper_s_figures_are_two_programs_and_share_the_target(tmp_path):
    assert names_of(FIGURES, Size(), tmp_path) == [["fig5a", "source"], ["fig5b", "fig6", "fig7", "fig8", "fig9"]]
    source, target = plan(FIGURES, Size(), tmp_path)
    assert len(source.job.sweep.design) == 1
    # 1 + 9 + 9 + 9 + 2 points, of which the target is in all but Fig. 8, whose densities leave it out.
    assert len(target.job.sweep.design) == 27
    of = {member.job.sweep.name: member.points for member in target.members}
    assert of["fig5b"] == (0,)
    assert (of["fig6"][3], of["fig7"][6], of["fig9"][0]) == (0, 0, 0)
    assert len({point for points in of.values() for point in points}) == 27


def test_shared_points_have_the_numbers_that_each_sweep_asks_for(tmp_path):
    for bundle in plan(FIGURES, Size(), tmp_path):
        for member in bundle.members:
            some = jax.tree.map(lambda leaf, rows=list(member.points): np.asarray(leaf)[rows], bundle.job.points)
            jax.tree.map(np.testing.assert_array_equal, some, jax.tree.map(np.asarray, member.job.points))


def test_parts_are_small_but_cost_no_round_more_than_large_ones(tmp_path, monkeypatch):
    (_, target) = plan(FIGURES, Size(seeds=10), tmp_path)
    lanes = [27 * len(seeds) for seeds in to_do(target, tmp_path)]
    assert sum(map(parallel.rounds_for, lanes)) == parallel.rounds_for(270)
    assert sum(map(parallel.padded, lanes)) == parallel.padded(270)
    assert len(lanes) > 1


def test_only_what_lacks_the_same_seeds_is_run_together(tmp_path):
    run_sweep(FEW[1], replace(TINY, seeds=1), tmp_path, QUIET, resume=False)  # and a source agent
    bundles = plan(FEW, TINY, tmp_path)
    names = [[member.job.sweep.name for member in bundle.members] for bundle in bundles]
    assert names == [["fig5a"], ["source"], ["fig5b"], ["fig6", "fig7", "fig8", "fig9"]]
    assert [to_do(bundle, tmp_path) for bundle in bundles] == [[range(2)], [range(1, 2)], [range(1, 2)], [range(2)]]
    before = digests(tmp_path, ["source", "fig5b"])
    some = [FEW[1], FEW[3]]
    assert list(run_together(some, TINY, tmp_path, QUIET)) == some
    after = digests(tmp_path, ["source", "fig5b"])
    assert before.items() <= after.items()
    assert plan(some, TINY, tmp_path) == []
    assert list(run_together(some, TINY, tmp_path, QUIET)) == some


def test_source_agents_are_trained_before_those_who_take_them_over(tmp_path):
    assert names_of([SWEEPS["fig9"]], TINY, tmp_path) == [["source"], ["fig9"]]
    assert names_of([SWEEPS["fig9"], SWEEPS["fig5a"]], TINY, tmp_path) == [["source", "fig5a"], ["fig9"]]


def test_two_commands_at_once_share_source_agents(tmp_path, capfd):
    """The second waits for those that the first trains, and trains none."""
    first, trained = FEW[5], threading.Event()

    def train_slowly():
        with files.locked(tmp_path / SOURCE.name):
            trained.wait()

    with ThreadPoolExecutor(2) as pool:
        other = pool.submit(train_slowly)
        run = pool.submit(lambda: list(run_together([first], TINY, tmp_path, QUIET)))
        while "waiting for its agents" not in capfd.readouterr().err:
            assert not run.done()
        sources_of(Job(SOURCE, TINY), range(2), tmp_path / "elsewhere")
        (part,) = parts_of(tmp_path / "elsewhere" / SOURCE.name)
        shutil.copy(part.path, tmp_path / SOURCE.name)
        before = (tmp_path / SOURCE.name / part.path.name).stat().st_mtime_ns
        trained.set()
        other.result()
        assert run.result() == [first]
    assert (tmp_path / SOURCE.name / part.path.name).stat().st_mtime_ns == before


@pytest.mark.parametrize(
    "other",
    [
        replace(SWEEPS["fig6"], learners=("tlwd",)),
        replace(SWEEPS["fig6"], environment="source"),
        replace(SWEEPS["fig6"], fixed=(("hparams.margin", 2.0),)),
        replace(SWEEPS["fig6"], source=replace(SOURCE, name="another")),
        replace(SWEEPS["fig6"], source_points=(0,) * 9),
        replace(SWEEPS["fig6"], own=True),
    ],
)
def test_sweeps_of_other_programs_or_sources_are_run_apart(other, tmp_path):
    bundles = names_of([SWEEPS["fig5b"], replace(other, name="other")], TINY, tmp_path)
    assert ["fig5b"] in bundles
    assert ["other"] in bundles


def test_agents_of_a_bundle_are_those_of_each_sweep(tmp_path):
    bundle = bundled([Job(sweep, TINY) for sweep in FEW[1:4]])
    keys = jax.random.split(jax.random.key(0), (3, 2))
    agents = {"tlwd": (np.arange(6.0).reshape(3, 2), keys)}
    assert len(bundle.job.sweep.design) == 3
    for member, rows in zip(bundle.members, ([0], [0, 1], [2, 0]), strict=True):
        values, found = bundle.agents_of(member, agents)["tlwd"]
        np.testing.assert_array_equal(values, agents["tlwd"][0][rows])
        np.testing.assert_array_equal(jax.random.key_data(found), jax.random.key_data(keys)[np.array(rows)])


def test_settings_that_decide_code_stay_apart_within_a_bundle():
    optimisers = replace(SWEEPS["fig5b"], name="optimisers", design=along("o", "config.optimiser", (0.0, 1.0)))
    bundle = bundled([Job(SWEEPS["fig5b"], TINY), Job(optimisers, TINY)])
    assert [g.config.optimiser for g in bundle.job.groups] == ["adam", "sgd"]
    assert bundle.members[1].points[1] != bundle.members[1].points[0]


_TARGET = base_of("target", "paper").points
_PATHS = ("env.all.prior.low", "env.speed.event_probability.high", "hparams.learning_rate", "env.terminal_time_limit")
_VALUES = st.sampled_from((0.0, 0.1, 0.001, 0.4, 0.7, 0.3, 1.0, float("nan")))


@given(st.sampled_from(_PATHS), st.lists(_VALUES, min_size=1, max_size=4))
@settings(max_examples=30, deadline=None)
def test_a_value_changes_the_base_if_and_only_if_the_point_differs_from_it(path, values):
    column = Values(parameter_at(path, _TARGET), np.array(values))
    try:
        points = stacked(_TARGET, [column], len(values))
    except ValueError:  # no environment
        return
    base = jax.tree.leaves(jax.tree.map(np.asarray, _TARGET))
    for i, changed in enumerate(changes(_TARGET, column)):
        point = [np.asarray(leaf)[i] for leaf in jax.tree.leaves(points)]
        assert changed == any((a != b).any() for a, b in zip(point, base, strict=True))


def test_an_empty_row_is_the_base_whatever_the_columns(tmp_path):
    sweep = replace(SWEEPS["fig5b"], name="rows", design=table([{}, {"p": 0.4}, {"p": 0.5}], {"p": _P.path}))
    bundle = bundled([Job(SWEEPS["fig5b"], TINY), Job(sweep, TINY)])
    assert [member.points for member in bundle.members] == [(0,), (0, 0, 1)]
