"""Check that requirements.lock is hashed, free of URLs and in step with pyproject.toml."""

import re
import sys
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parent.parent
PYTHONS = ("3.11", "3.12", "3.13")
# Clients and peers, whose PyTorch differs between platforms and sources, the reader of one data set, and what the
# documentation needs, which come on top.
NOT_LOCKED = {"peers", "clients", "gymnasium", "nuscenes", "docs"}
HASH = re.compile(r"--hash=sha256:[0-9a-f]{64}(?=\s|$)")


def main() -> int:
    """Print what is wrong with the lock; return 1 if anything is."""
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    errors = []
    if "://" in text:
        errors.append("requirements.lock holds a URL")

    locked: dict[str, list[Requirement]] = {}
    for line in text.replace("\\\n", " ").splitlines():
        line = line.strip()
        if not line or line.startswith("#"):
            continue
        entry = HASH.sub("", line).strip()
        if entry == line:
            errors.append(f"no hash: {line}")
        try:
            requirement = Requirement(entry)
        except ValueError:
            errors.append(f"not a requirement: {entry}")
            continue
        pins = list(requirement.specifier)
        if len(pins) != 1 or pins[0].operator != "==" or pins[0].version.endswith("*"):
            errors.append(f"not pinned: {entry}")
            continue
        locked.setdefault(canonicalize_name(requirement.name), []).append(requirement)

    wanted, extras = list(project["dependencies"]), project.get("optional-dependencies", {})
    errors += [f"not an extra of pyproject.toml: {name}" for name in sorted(NOT_LOCKED - extras.keys())]
    for name, extra in extras.items():
        if name not in NOT_LOCKED:
            wanted += extra
    for requirement in map(Requirement, wanted):
        entries = locked.get(canonicalize_name(requirement.name), [])
        for entry in entries:
            version = next(iter(entry.specifier)).version
            if not requirement.specifier.contains(version, prereleases=True):
                errors.append(f"locked {entry.name} {version} is outside {requirement}")
        for python in PYTHONS:
            env = {"python_version": python, "python_full_version": f"{python}.0"}
            if requirement.marker is not None and not requirement.marker.evaluate(env):
                continue
            if sum(e.marker is None or e.marker.evaluate(env) for e in entries) != 1:
                errors.append(f"not locked exactly once for Python {python}: {requirement}")

    for error in errors:
        print(f"lock-check: {error}", file=sys.stderr)
    if not errors:
        print(f"lock-check: {len(locked)} packages locked, {len(wanted)} direct requirements met")
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
