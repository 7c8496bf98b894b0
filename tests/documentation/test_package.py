"""What the package says of itself, and what an index shows of the README."""

import importlib.util
import re
import tomllib
from pathlib import Path

import pytest

import jrcjax
from jrcjax.__main__ import main

ROOT = Path(__file__).parents[2]


@pytest.fixture
def hook():
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_one_version_everywhere():
    assert f"\nversion: {jrcjax.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert f"## [{jrcjax.__version__}]" in (ROOT / "CHANGELOG.md").read_text()


def test_the_command_says_versions_and_devices(capsys):
    main([])
    said = capsys.readouterr().out
    assert said.startswith(f"jrcjax {jrcjax.__version__}\n")
    assert "jax 0." in said
    assert "devices: " in said
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert capsys.readouterr().out == f"jrcjax {jrcjax.__version__}\n"


def test_an_index_shows_no_picture_and_no_link_that_leads_nowhere(hook):
    readme = (ROOT / "README.md").read_text()
    shown = hook.readme_for_an_index(readme, None)
    assert "![" in readme
    assert "![" not in shown
    assert re.findall(r"\]\((?!https?:|#)[^)]+\)", shown) == []
    assert "# jrcjax" in shown


def test_links_are_absolute_where_the_repository_is_known(hook):
    text = "![a](b.png)\n[c](d/e.md) [f](https://g) [h](#i)"
    expected = "![a](https://r/raw/HEAD/b.png)\n[c](https://r/blob/HEAD/d/e.md) [f](https://g) [h](#i)"
    assert hook.readme_for_an_index(text, "https://r/") == expected


def test_extras_that_texts_name_exist():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    texts = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    named = {e for text in texts for group in re.findall(r"\.\[([\w,]+)\]", text.read_text()) for e in group.split(",")}
    assert named <= set(extras)
