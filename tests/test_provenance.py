"""Where results come from, in checkouts of one's own and of others."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "jrcjax"
_TELLS = "from jrcjax import provenance; print(provenance.provenance()['git_commit'])"


def git(folder: Path, *arguments: str) -> str:
    who = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "init.defaultBranch=main"]
    return subprocess.run(["git", "-C", folder, *who, *arguments], capture_output=True, text=True, check=True).stdout


def commit_told(package: Path, environment: dict[str, str] | None = None) -> str:
    """What the modules in a folder say, without importing the rest of the library."""
    done = subprocess.run(
        [sys.executable, "-c", _TELLS], cwd=package.parent, env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def installed(folder: Path) -> Path:
    """The package in a folder, as far as it takes part."""
    package = folder / "jrcjax"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("")
    for name in ("provenance.py", "machine.py"):
        shutil.copy(PACKAGE / name, package)
    return package


@pytest.fixture
def repository(tmp_path):
    """Somebody's repository, with a commit."""
    git(tmp_path, "init")
    (tmp_path / "thesis.txt").write_text("mine")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-m", "mine")
    return tmp_path


@pytest.mark.parametrize("place", [".venv/lib/python3.11/site-packages", "."])
def test_a_repository_around_the_package_is_not_its_own(place, repository):
    assert commit_told(installed(repository / place)) == "None"


def test_the_commit_of_its_own_checkout_counts_whatever_a_hook_has_set(repository, tmp_path_factory):
    package = installed(repository)
    git(repository, "add", ".")
    git(repository, "commit", "-m", "package")
    other = tmp_path_factory.mktemp("other")
    git(other, "init")
    assert commit_told(package, {"GIT_DIR": str(other / ".git")}) == git(repository, "rev-parse", "HEAD").strip()
