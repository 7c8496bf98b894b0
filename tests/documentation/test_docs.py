"""The pages' code runs as written, what they name exists, and the site has a place for each of them."""

import pkgutil
import re
from pathlib import Path

import matplotlib as mpl
import pytest

from sweeps.studies.registry import STUDIES

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
READMES = [ROOT / "README.md", ROOT / "paper_figs" / "README.md", ROOT / "benchmarks" / "README.md"]
TEXTS = [*PAGES, *READMES, ROOT / "CONTRIBUTING.md"]
CODE = re.compile(r"^```.*?^```|`[^`\n]+`", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]+))?\)")
BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
NEEDS = {"other_libraries.md": "gymnasium"}
WITH_CODE = [page for page in PAGES if BLOCK.search(page.read_text())]


def name_of(page):
    return page.relative_to(DOCS).as_posix()


def path_of(text):
    return text.relative_to(ROOT).as_posix()


def targets():
    return set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))


def anchors_of(page):
    """Of each heading, as a reader of the repository and of the site finds it."""
    text = CODE.sub(lambda match: "" if match[0].startswith("```") else match[0], page.read_text())
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", WITH_CODE, ids=name_of)
def test_code_runs_as_written_one_block_after_the_other(page, tmp_path, monkeypatch):
    if page.name in NEEDS:
        pytest.importorskip(NEEDS[page.name])
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [*__import__("sys").path])
    names = {}
    with mpl.rc_context({"backend": "agg"}):
        for block in BLOCK.findall(page.read_text()):
            exec(compile(block, name_of(page), "exec"), names)


def test_there_is_code_to_run():
    assert len(WITH_CODE) >= 9


@pytest.mark.parametrize("text", TEXTS, ids=path_of)
def test_files_that_texts_name_exist(text):
    folders = "jrcjax|sweeps|paper_figs|explorer|benchmarks|examples|tests|docs|published"
    paths = re.findall(rf"`((?:{folders})/[\w./*-]+)`", text.read_text())
    if text in READMES:  # pages name files of their reader's, too
        paths += re.findall(r"`([\w/]+\.py)`", text.read_text())
    assert [path for path in paths if not list(ROOT.glob(path))] == []


@pytest.mark.parametrize("text", TEXTS, ids=path_of)
def test_names_in_the_package_exist(text):
    names = set(re.findall(r"\bjrcjax(?:\.[A-Za-z_]\w*)+", LINK.sub("", text.read_text())))
    assert sorted(name for name in names if not is_there(name)) == []


def is_there(name):
    """Whether a dotted name is a file of the package, a module, or something in one."""
    if name.endswith((".toml", ".py")):
        return True
    try:
        pkgutil.resolve_name(name)
    except ModuleNotFoundError as error:
        return not error.name.startswith("jrcjax")  # a client's adapter without its client
    except AttributeError:
        return False
    return True


@pytest.mark.parametrize("text", TEXTS, ids=path_of)
def test_links_lead_somewhere_in_the_repository(text):
    """The site rewrites them (docs/hooks.py), and building it fails where one leads nowhere there."""
    dead = []
    for path, anchor in LINK.findall(CODE.sub("", text.read_text())):
        target = (text.parent / path).resolve() if path else text
        if not target.exists() or (anchor and anchor not in anchors_of(target)):
            dead.append(f"{path}#{anchor}")
    assert dead == []


def test_every_page_has_its_place_in_the_site():
    placed = set(re.findall(r": ([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE))
    made = set(re.findall(r'^    "([\w/-]+\.md)":', (DOCS / "hooks.py").read_text(), re.MULTILINE))
    assert len(made) == 3
    assert placed == {name_of(page) for page in PAGES} | made


def test_deviations_are_numbered_and_their_fields_exist():
    text = (DOCS / "explanation" / "deviations.md").read_text()
    assert [int(n) for n in re.findall(r"^## A(\d+): ", text, re.MULTILINE)] == list(range(1, 32))
    fields = set((ROOT / "jrcjax" / "config" / "CONFIGURATION.md").read_text().split("`"))
    for container, field in re.findall(r"`(EnvParams|Radar|HParams|Config)\.(\w+)`", text):
        assert field in fields, f"{container}.{field} is not in the configuration"


def test_commands_that_pages_name_are_targets():
    for text in TEXTS:
        assert set(re.findall(r"`?make ([a-z][a-z-]+)", text.read_text())) <= targets() | {"it", "the", "up"}


def test_the_page_of_commands_has_them_all():
    page = (DOCS / "reference" / "commands.md").read_text()
    assert targets() == set(re.findall(r"`make ([a-z-]+)`", page))
    modules = {".".join(path.parent.relative_to(ROOT).parts) for path in ROOT.glob("[!.]*/**/__main__.py")}
    assert {"paper_figs.calibration", "sweeps"} < modules
    assert [module for module in modules if f"python -m {module}" not in page] == []
    figures = {name for name in STUDIES if name.startswith("fig")}
    assert [name for name in ({"fig5a", "fig9"} | set(STUDIES) - figures) if f"`{name}`" not in page] == []


def test_the_jax_for_a_gpu_is_the_locked_one():
    (locked,) = re.findall(r"^jax==(\S+)", (ROOT / "requirements.lock").read_text(), re.MULTILINE)
    named = re.findall(r"jax\[\w+\](?:==)?([\d.]*)", (DOCS / "how-to" / "install.md").read_text())
    assert named == [locked]
