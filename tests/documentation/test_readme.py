"""The README's code runs as written, and its table and paths are what the project holds."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


def test_the_code_runs_as_written_one_block_after_the_other(capsys, tmp_path, monkeypatch):
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert blocks
    names = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
    assert "LongRun(reward=" in capsys.readouterr().out


def test_the_first_page_is_one_page():
    assert len(README.splitlines()) <= 120


def test_every_path_exists():
    paths = re.findall(r"`((?:jrcjax|paper_figs|sweeps|benchmarks)/[\w./]+)`", README)
    paths += re.findall(r"\]\((?!http)([\w./-]+)\)", README)
    assert len(paths) > 10
    assert [path for path in paths if not (ROOT / path).exists()] == []
