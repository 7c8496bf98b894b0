"""Benchmarks: a case that ends with its process, or lacks a package, leaves the other cases measured."""

import json
import os
import threading

import pytest

from benchmarks import scaling
from benchmarks.__main__ import NAMES, _claim_of, main
from benchmarks.measure import Case, NotMeasured, Ready, Result, Running, in_turns, print_table


def sound(agents, steps):
    return Ready(lambda: None, 0.5)


def ends_while_compiling(agents, steps):
    os._exit(3)


def ends_in_second_repetition(agents, steps):
    calls = iter((None, None))  # the first is the warm-up
    return Ready(lambda: next(calls, 0) is None or os._exit(4), 0.5)


def ends_between_repetitions(agents, steps):
    threading.Timer(1.0, os._exit, (5,)).start()
    return Ready(lambda: None, 0.5)


def without_package(agents, steps):
    raise ModuleNotFoundError("no", name="rejax")


def test_a_process_that_ends_while_nobody_asks():
    running = Running(Case("idle", ends_between_repetitions, 2, 10))
    running._processes[0].join()
    with pytest.raises(NotMeasured, match="ended with status 5"):
        running.repeat()


def test_the_other_cases_are_measured(capsys):
    cases = [
        Case("compiling", ends_while_compiling, 2, 10, processes=2),
        Case("sound", sound, 2, 10),
        Case("repeating", ends_in_second_repetition, 2, 10),
        Case("lacking", without_package, 2, 10),
    ]
    results, failed = in_turns(cases, 3)
    assert [(r.case, len(r.us_each), r.compile_s) for r in results] == [("sound", 3, 0.5)]
    assert list(failed) == ["compiling", "lacking", "repeating"]
    assert "status 3" in failed["compiling"]
    assert "status 4" in failed["repeating"]
    assert "rejax" in failed["lacking"]
    print_table(results, failed)
    printed = capsys.readouterr().out
    assert all(case.name in printed for case in cases)
    assert printed.count("not measured") == 3


@pytest.mark.parametrize("name", NAMES)
def test_each_file_opens_with_the_claim_that_it_tests(name):
    assert _claim_of(name).startswith("Claim: ")


def result_of(case, agents):
    return Result(case, agents, 1.0, 1.0, 1.0, 0.5, 10.0 * agents, 300, (1.0,))


def test_a_benchmark_that_fails_leaves_the_results_of_the_others(tmp_path, monkeypatch, capsys):
    file = tmp_path / "results.json"

    def fails(quick):
        assert [row["case"] for row in json.loads(file.read_text())["results"]] == ["first"]
        raise NotMeasured("its process ended with status -9")

    runs = {"start": lambda quick: [result_of("first", 1)], "limit": fails, "canary": lambda _: [result_of("last", 1)]}
    for name, run in runs.items():
        monkeypatch.setattr(f"benchmarks.{name}.run", run)
    assert main([*runs, "--json", str(file)]) == 1
    assert [row["case"] for row in json.loads(file.read_text())["results"]] == ["first", "last"]
    assert "limit: not measured: its process ended with status -9" in capsys.readouterr().err


def test_a_number_of_agents_that_does_not_fit_leaves_the_others_measured(monkeypatch, capsys):
    def alone(case, repetitions):
        if case.agents == 256:
            raise NotMeasured("its process ended with status -9")
        return result_of(case.name, case.agents)

    monkeypatch.setattr(scaling, "alone", alone)
    found = scaling.run(quick=True)
    assert [(r.case, r.agents) for r in found if "ddqn" in r.case] == [
        (case, agents) for case in ("ddqn, 1 device", "ddqn, all") for agents in (1, 64)
    ]
    printed = capsys.readouterr().out
    assert printed.count("256 not measured: its process ended") == 4
    assert "tlwd: 10.00 MB per agent" in printed
