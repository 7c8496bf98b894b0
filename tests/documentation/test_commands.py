"""Commands that pages show have the options that the programs take; blocks that need other machines compile."""

import re
import shlex
from pathlib import Path

import pytest
import tyro

import benchmarks.__main__
import paper_figs.__main__
import sweeps.__main__
from sweeps.options import FLAGS

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted(ROOT.glob("[bp]*s/README.md"))]
OPTIONS = {
    "sweeps": sweeps.__main__.Command,
    "paper_figs": paper_figs.__main__.Options,
    "benchmarks": benchmarks.__main__.Options,
}
TARGETS = {"figures": "paper_figs", "sweeps": "sweeps", "bench": "benchmarks"}


def commands_of(text: str):
    """(program, arguments) of each command in a text that has any."""
    for program, arguments in re.findall(r"python -m (sweeps|paper_figs|benchmarks) ([^`\n#)]+)", text):
        yield program, shlex.split(arguments)
    for target, arguments in re.findall(r"make (figures|sweeps|bench) ARGS=\"([^\"]+)\"", text):
        yield TARGETS[target], shlex.split(arguments)


COMMANDS = sorted({(program, *arguments) for page in PAGES for program, arguments in commands_of(page.read_text())})


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_options_of_commands_exist(command):
    program, *arguments = command
    tyro.cli(OPTIONS[program], args=arguments, config=FLAGS)


def test_there_are_commands():
    assert {command[0] for command in COMMANDS} == set(OPTIONS)
    assert len(COMMANDS) >= 15


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_blocks_that_need_more_than_this_project_compile(page):
    for block in re.findall(r"^```py\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE):
        compile(block, str(page), "exec")
