"""The README's code runs as written, and its table and paths are what the project holds."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from paper_figs.figures import FIGURES
from paper_figs.readme import MULTIVERSE, claims_table, readings_table, standing

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
RESULTS = (ROOT / "paper_figs" / "README.md").read_text()


def test_the_code_runs_as_written_one_block_after_the_other(capsys, tmp_path, monkeypatch):
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len(blocks) > 3
    names = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
    assert "(9, 5) (9, 5)" in capsys.readouterr().out


def test_claims_table_is_that_of_the_committed_results():
    claims = json.loads((ROOT / "paper_figs" / "reference" / "claims.json").read_text())
    for figure in FIGURES:
        assert claims_table(claims, figure.name.removeprefix("fig")) in RESULTS


def test_every_claim_is_in_one_of_the_tables():
    claims = json.loads((ROOT / "paper_figs" / "reference" / "claims.json").read_text())
    tables = [claims_table(claims, figure.name.removeprefix("fig")) for figure in FIGURES]
    assert sum(table.count("\n") - 1 for table in tables) == len(claims)


def test_table_of_readings_is_that_of_the_committed_multiverse():
    claims = json.loads((ROOT / "paper_figs" / "reference" / "claims.json").read_text())
    shares = pd.read_csv(MULTIVERSE / "claims.csv")
    assert readings_table(claims, shares) in RESULTS
    np.testing.assert_allclose(shares[["supported", "undecided", "contradicted"]].sum(axis=1), 1, atol=1e-5)


@pytest.mark.parametrize(
    ("verdict", "supported", "where"),
    [
        ("supported", 0.0, "by default"),
        ("undecided", 0.5, "only under other readings"),
        ("contradicted", 0.06, "only under other readings"),
        ("undecided", 0.04, "nowhere"),
    ],
)
def test_where_a_claim_holds(verdict, supported, where):
    assert standing(verdict, supported) == where


def test_every_path_exists():
    paths = re.findall(r"`((?:jrcjax|paper_figs|sweeps|benchmarks)/[\w./]+)`", README)
    paths += re.findall(r"\]\((?!http)([\w./]+)\)", README)
    assert len(paths) > 10
    assert [path for path in paths if not (ROOT / path).exists()] == []
