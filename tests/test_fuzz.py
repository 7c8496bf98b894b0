"""More than a thousand mutated files: each is read as what it says or refused by name, in little memory and few words.

Nothing that was damaged is loaded, nothing hangs, and no other exception comes out.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    ("kind", "number", "refused"),
    [("toml", 500, 150), ("agents", 300, 240), ("parts", 300, 290)],
    ids=["toml", "agents", "parts"],
)
def test_mutated_files_are_read_or_refused(kind, number, refused, tmp_path):
    """Most are refused: the mutations do reach what is checked."""
    command = [sys.executable, str(ROOT / "tests" / "twins" / "fuzzing.py"), kind, str(tmp_path), str(number)]
    environment = os.environ | {"JAX_PLATFORMS": "cpu", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-3000:]
    assert int(done.stdout) >= refused
