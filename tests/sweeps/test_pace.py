"""The pace of a machine, as runs measure it and the next estimate uses it."""

import dataclasses
import io
import types
from typing import Any

import pytest
from rich.console import Console

import jrcjax
from sweeps.engine import estimate, pace
from sweeps.engine.job import Group
from sweeps.engine.run import run_sweep
from sweeps.studies.registry import SWEEPS
from sweeps.sweep import Size

SWEEP = dataclasses.replace(SWEEPS["fig5a"], learners=("q_learning",))


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """The file of a machine whose pace nobody measured."""
    monkeypatch.setattr(pace, "_file", lambda: tmp_path / "pace.json")  # the folder of compiled programs stays as it is
    pace.of_machine.cache_clear()
    yield tmp_path / "pace.json"
    pace.of_machine.cache_clear()


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def timed(laps):
    """A stopwatch after laps of (seconds that it took, expected seconds, whether it is a program's first)."""
    clock = Clock()
    watch = pace.Stopwatch(clock)
    for took, expected, is_first in laps:
        clock.now += 7.0  # what lies between two blocks does not count
        watch.start()
        clock.now += took
        watch.lap(expected, is_first)
    return watch


def test_a_machine_of_half_the_speed_doubles_the_next_estimate(kept):
    group, spec = Group((0,), jrcjax.Config()), types.SimpleNamespace(episode_slots=300)
    job: Any = types.SimpleNamespace(sweep=SWEEP, size=Size(seeds=10, episodes=100), groups=(group,), spec=spec)
    before = estimate.block_seconds(job, 10)
    timed([(42.0, 1.0, True), (2.0, 1.0, False), (6.0, 3.0, False)]).keep()
    assert estimate.block_seconds(job, 10) == before  # within a run estimates stay comparable
    pace.of_machine.cache_clear()
    assert pace.of_machine() == (2.0, 41.0)
    assert estimate.block_seconds(job, 10) == pytest.approx(2 * before)
    assert estimate.compiling_seconds(job) == 41.0
    # A second run at the same pace expects it, and leaves it.
    timed([(3.0, 2.0, True), (4.0, 4.0, False)]).keep()
    pace.of_machine.cache_clear()
    assert pace.of_machine() == (2.0, 41.0)  # its program was kept, which says nothing of compiling


def test_a_run_too_short_to_measure_changes_nothing(kept):
    assert timed([(1.0, 0.5, True), (0.4, 0.001, False)]).pace == pace.Pace()


NO_PACES = (
    "",
    "{",
    "[1]",
    '{"ratio": 2}',
    '{"ratio": "a", "compiling": 1}',
    '{"ratio": NaN, "compiling": 1}',
    '{"ratio": 0, "compiling": 1}',
    '{"ratio": 1e9, "compiling": 1}',
    '{"ratio": 1, "compiling": -1}',
)


@pytest.mark.parametrize("text", NO_PACES)
def test_what_cannot_be_a_pace_is_not_believed(kept, text):
    kept.write_text(text)
    assert pace.of_machine() == pace.Pace()


def test_a_run_keeps_its_pace_and_the_next_one_tells_it(kept, tmp_path):
    console = Console(record=True, width=300, file=io.StringIO())
    run_sweep(SWEEP, Size(seeds=1, episodes=40), tmp_path / "one", console, resume=False)
    assert "compiling, if no earlier run did: 30 s" in console.export_text()
    pace.of_machine.cache_clear()
    measured = pace.of_machine()
    assert kept.is_file()
    run_sweep(SWEEP, Size(seeds=1, episodes=20), tmp_path / "two", console, resume=False)
    assert f"compiling, if no earlier run did: {estimate.in_words(measured.compiling)}" in console.export_text()
