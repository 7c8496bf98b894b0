"""Benchmarks: a case that ends with its process, or lacks a package, leaves the other cases measured."""

import os
import threading

import pytest

from benchmarks.__main__ import NAMES, _claim_of
from benchmarks.measure import Case, NotMeasured, Ready, Running, in_turns, print_table


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
