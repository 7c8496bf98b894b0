"""Imports run one way: equations, environment, learners, training, sweeps, figures."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FLOORS = (
    (
        "types",
        "checks",
        "compiled",
        "keys",
        "readings",
        "containers",
        "named",
        "files",
        "kept",
        "machine",
        "numerics",
        "rng",
        "policies",
        "provenance",
    ),
    ("radar",),
    ("model", "events"),
    ("exact", "render"),
    ("front",),
    ("replay",),
    ("learners",),
    ("training",),
    ("agents", "config", "adapters"),
    ("__init__", "__main__"),
    ("sweeps",),
    ("paper_figs",),
)
"""Folders and modules of the library, then the packages above it; nothing imports from a floor above its own."""
COMMANDS: set[str] = set()


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def level(module: str) -> int:
    if module in COMMANDS:
        return len(FLOORS)
    parts = module.split(".")
    room = parts[0] if parts[0] != "jrcjax" else (*parts, "__init__")[1]
    (found,) = (floor for floor, rooms in enumerate(FLOORS) if room in rooms)
    return found


def is_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def import_nodes(tree: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """Import statements that run, also inside functions."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node
        elif not is_type_checking(node):
            yield from import_nodes(node)


def imports_of(path: Path) -> set[str]:
    """Dotted names of imported modules; of `from a import b` both a.b and, if b is no module, a."""
    found = set()
    for node in import_nodes(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
            continue
        assert node.level == 0, f"{path}: relative import"
        base = ROOT.joinpath(*node.module.split("."))
        for alias in node.names:
            is_module = (base / f"{alias.name}.py").exists() or (base / alias.name / "__init__.py").exists()
            found.add(f"{node.module}.{alias.name}" if is_module else node.module)
    return found


def files(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


LAYERED = [path for package in ("jrcjax", "sweeps", "paper_figs") for path in files(package)]
LIBRARY = files("jrcjax")


def test_the_files_were_found():
    assert {"jrcjax.model.slot", "jrcjax.training.train", "jrcjax.learners.ddqn"} <= {
        module_of(path) for path in LIBRARY
    }
    assert "jrcjax.learners" in imports_of(ROOT / "jrcjax" / "training" / "train.py")


@pytest.mark.parametrize("path", LAYERED, ids=module_of)
def test_no_import_points_upwards(path):
    own = level(module_of(path))
    upwards = {
        imported
        for imported in imports_of(path)
        if imported.split(".")[0] in ("jrcjax", "sweeps", "paper_figs") and level(imported) > own
    }
    assert not upwards, f"{module_of(path)} imports {upwards}, which stand above it"


@pytest.mark.parametrize("path", files("jrcjax/learners"), ids=module_of)
def test_learners_do_not_know_the_environment(path):
    assert not imports_of(path) & {
        "jrcjax.model.environment",
        "jrcjax.model.slot",
        "jrcjax.model.params",
        "jrcjax.model.presets",
    }


@pytest.mark.parametrize("path", LIBRARY, ids=module_of)
def test_the_library_needs_neither_its_users_nor_other_frameworks(path):
    forbidden = {"sweeps", "paper_figs", "explorer", "benchmarks", "torch"}
    if "adapters" not in module_of(path):  # whose purpose is to look like gymnasium
        forbidden |= {"gymnax", "gymnasium"}
    if module_of(path) != "jrcjax.render":  # which draws
        forbidden |= {"matplotlib"}
    assert not {name.split(".")[0] for name in imports_of(path)} & forbidden


def test_importing_the_package_leaves_heavy_modules_alone():
    heavy = ("distrax", "tensorflow_probability", "matplotlib", "torch", "gymnasium", "gymnax", "xarray")
    code = f"import sys, jrcjax; print([m for m in {heavy!r} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
