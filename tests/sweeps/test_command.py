"""Commands in notebooks, batch jobs and other people's locales."""

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console

from sweeps import progress

ROOT = Path(__file__).parents[2]
INLINE = "module://some_notebook.backend_inline"


def run_python(code: str, **environment: str) -> subprocess.CompletedProcess:
    command = [sys.executable, "-W", "error", "-c", code]
    return subprocess.run(command, cwd=ROOT, env=os.environ | environment, capture_output=True, text=True)


def test_sweeps_are_listed_without_jax_and_matplotlib():
    code = "import sys; sys.modules['matplotlib'] = None; from sweeps.__main__ import main; sys.exit(main(['list']))"
    done = run_python(code, MPLBACKEND=INLINE, JAX_PLATFORMS="nonsense")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("fig5a ")


def test_figures_go_to_files_whatever_backend_a_notebook_has_set():
    code = "from sweeps.command import begin; begin(); from matplotlib import pyplot; print(pyplot.get_backend())"
    done = run_python(code, MPLBACKEND=INLINE)
    assert (done.returncode, done.stdout.lower()) == (0, "agg\n"), done.stderr


def test_a_platform_that_is_not_there_is_one_line():
    code = "import sys; from sweeps.__main__ import main; sys.exit(main(['run', 'fig5a']))"
    done = run_python(code, JAX_PLATFORMS="nonsense")
    assert done.returncode == 2
    assert done.stderr.startswith("error: JAX_PLATFORMS: 'nonsense'; allowed: cpu, or a platform that works here")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("locale", [{"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}])
def test_any_character_is_shown_in_any_locale(locale):
    code = "from sweeps.command import undisturbed; undisturbed(); print('\\u03c9 = 27')"
    done = run_python(code, **locale)
    assert (done.returncode, done.stdout) == (0, "\\u03c9 = 27\n"), done.stderr


def test_without_a_terminal_progress_is_a_line_at_intervals():
    said, clock = io.StringIO(), iter([0.0, 10.0, 31.0, 40.0, 62.0, 80.0])
    lines = progress.Lines(Console(file=said), "fig6", 100.0, clock=lambda: next(clock))
    for done in (10, 10, 20, 20, 40):  # at 10, 31, 40, 62 and 80 s
        lines.advance(done)
    assert said.getvalue().splitlines() == [
        "fig6: 20% done in 31 s, 38.71% per minute, about 2 min left",
        "fig6: 60% done in 62 s, 58.06% per minute, about 41 s left",
        "fig6: 100% done in 80 s",
    ]


def test_what_is_left_is_told_when_more_than_compiling_is_done():
    said, clock = io.StringIO(), iter([0.0, 40.0, 80.0])
    lines = progress.Lines(Console(file=said), "fig6", 1000.0, clock=lambda: next(clock))
    for done in (1, 19):
        lines.advance(done)
    assert said.getvalue().splitlines() == [
        "fig6: 0% done in 40 s",
        "fig6: 2% done in 80 s, 1.50% per minute, about 65 min left",
    ]


def test_on_a_terminal_progress_is_a_bar():
    said = io.StringIO()
    with progress.shown(Console(file=said, force_terminal=True), "fig6", 2.0) as advance:
        advance(1.0)
    assert "fig6" in said.getvalue()
    assert "50%" in said.getvalue()
