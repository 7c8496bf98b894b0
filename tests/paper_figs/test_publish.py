"""Texts say what the published results say, and one command renews both."""

import json
import shutil

import numpy as np
import pytest
import worlds

import jrcjax
from jrcjax import exact
from paper_figs import pipeline, publish, readme, record
from paper_figs.claims.delta import Delta
from paper_figs.claims.judge import as_json
from paper_figs.claims.table import CLAIMS, claims_of
from paper_figs.figures import FIGURES
from paper_figs.numbers import numbers_of
from sweeps.results import store
from sweeps.sweep import Size

PUBLISHED = publish.ROOT / "published"
QUOTING = [path for path in publish.texts(publish.ROOT) if "made by python -m paper_figs.publish" in path.read_text()]


@pytest.mark.parametrize("path", QUOTING, ids=lambda path: path.relative_to(publish.ROOT).as_posix())
def test_texts_and_published_results_agree(path):
    text = path.read_text()
    assert readme.renewed(text, PUBLISHED) == text


def test_every_claim_is_in_a_table_and_the_first_page_has_its_table():
    texts = [path.read_text() for path in QUOTING]
    for claim in CLAIMS:
        assert any(f"| {claim.claim} | {claim.statement} | " in text for text in texts)
    assert "made by python -m paper_figs.publish: verdicts" in (publish.ROOT / "README.md").read_text()


def test_a_changed_result_changes_the_text_and_only_between_the_marks(tmp_path):
    shutil.copytree(PUBLISHED, tmp_path / "published")
    claims = tmp_path / "published" / "figures" / "claims.json"
    claims.write_text(claims.read_text().replace('"contradicted"', '"supported"'))
    before = (
        "before <b>\n<!-- made by python -m paper_figs.publish: verdicts -->\nold\n<!-- end of verdicts -->\nafter\n"
    )
    (tmp_path / "README.md").write_text(before)
    assert publish.renew_texts(tmp_path) == [tmp_path / "README.md"]
    after = (tmp_path / "README.md").read_text()
    assert after.startswith("before <b>\n<!-- made by")
    assert after.endswith("<!-- end of verdicts -->\nafter\n")
    assert "contradicted" not in after
    assert "old" not in after
    assert publish.renew_texts(tmp_path) == []


def test_one_statement_is_and_others_are(tmp_path):
    shutil.copytree(PUBLISHED, tmp_path / "published")
    claims = tmp_path / "published" / "figures" / "claims.json"
    rows = json.loads(claims.read_text())
    one = [row | {"verdict": "supported" if i == 0 else "contradicted"} for i, row in enumerate(rows)]
    claims.write_text(json.dumps(one))
    text = " ".join(readme.headline(tmp_path / "published").split())
    assert f"come down to, 1 is supported, {len(rows) - 1} are contradicted, 0 are undecided under" in text


def test_an_unknown_block_is_refused():
    text = "<!-- made by python -m paper_figs.publish: nothing -->\n<!-- end of nothing -->"
    with pytest.raises(ValueError, match=r"block: 'nothing'; allowed: headline, verdicts"):
        readme.renewed(text, PUBLISHED)


def test_missing_results_are_an_error_that_names_them(tmp_path, capsys):
    assert publish.main(["--figures", str(tmp_path), "--root", str(tmp_path)]) == 2
    assert "claims.json" in capsys.readouterr().err


@pytest.fixture
def drawn(tmp_path, monkeypatch):
    """A folder as `make figures` leaves it, with published files; its results are a made-up world's."""
    out = tmp_path / "out"
    shutil.copytree(PUBLISHED / "figures", out)
    for path in out.glob("*.manifest.json"):
        folder = pipeline.results_folder(out, Size()) / path.name.removesuffix(".manifest.json")
        folder.mkdir(parents=True)
        path.rename(folder / store.MANIFEST)
    world = worlds.as_the_paper_says(seeds=5, episodes=450)
    monkeypatch.setattr(store, "load", lambda folder, seeds: world[folder.name])
    figures = [figure.name for figure in FIGURES]
    record.write(out, record.record_of(Size(seeds=10), figures, Delta()))
    return out


def test_figures_are_published_with_the_manifests_of_their_run(drawn, tmp_path):
    written = publish.figures_from(drawn, tmp_path / "figures").write()
    assert {path.name for path in written} == {path.name for path in (PUBLISHED / "figures").iterdir()}
    for path in written:
        assert path.name == "numbers.json" or path.read_bytes() == (PUBLISHED / "figures" / path.name).read_bytes()


@pytest.mark.parametrize(
    ("size", "figures", "delta", "message"),
    [
        (Size(preset="paper_table"), FIGURES, Delta(), r"made.json: preset: 'paper_table'; allowed: paper"),
        (Size(episodes=450), FIGURES, Delta(), r"made.json: episodes: '450'; allowed: 1000"),
        (
            Size(seeds=9),
            FIGURES,
            Delta(),
            r"seeds: 9; allowed: figures of all that .*fig5a.* tells of, 0 to 9",
        ),
        (Size(), FIGURES[:2], Delta(), r"made.json: figures: .*; allowed: \['fig5a', 'fig5b', 'fig6'"),
        (Size(), FIGURES, Delta(reward=0.02), r"made.json: delta: .*; allowed: {'reward': 0.01"),
    ],
)
def test_figures_of_another_run_than_the_manifests_are_not_published(drawn, tmp_path, size, figures, delta, message):
    record.write(drawn, record.record_of(size, [figure.name for figure in figures], delta))
    with pytest.raises(ValueError, match=message):
        publish.figures_from(drawn, tmp_path / "figures")
    assert not (tmp_path / "figures").exists()


@pytest.mark.parametrize("name", ["fig9.png", record.FILE, "results/paper-1000-episodes/source/manifest.json"])
def test_with_a_file_missing_nothing_is_published(drawn, tmp_path, name):
    (drawn / name).unlink()
    with pytest.raises(ValueError, match=f"folder: '{drawn}'; allowed: one to which .* all figures: {name}$"):
        publish.figures_from(drawn, tmp_path / "figures")
    assert not (tmp_path / "figures").exists()


def test_a_summary_is_published_whole_and_without_files_of_the_one_before(tmp_path):
    summary, folder = tmp_path / "summary", tmp_path / "published" / "multiverse"
    for path in (summary / "manifests.json", summary / "tried" / "new.csv", folder / "known.csv"):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x")
    written = publish.study_from(summary, folder).write()
    assert [path.relative_to(folder).as_posix() for path in written] == ["manifests.json", "tried/new.csv"]
    assert sorted(path for path in folder.rglob("*") if path.is_file()) == written
    assert [path.name for path in folder.parent.iterdir()] == ["multiverse"]


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("--best={nowhere}", "allowed: one to which `make figures` has written all figures"),
        ("--reconstruction={nowhere}", "reconstruction: '{nowhere}'; allowed: the folder of a summary, with best.toml"),
        ("--multiverse={nowhere}", "multiverse: '{nowhere}'; allowed: the folder of a summary, with manifests.json"),
        ("--custom={nowhere}", "nowhere/manifest.json"),
    ],
)
def test_where_one_of_several_is_missing_none_is_published(tmp_path, capsys, option, message):
    root, nowhere = tmp_path / "project", tmp_path / "nowhere"
    preset = root / "sweeps" / "presets" / "best.toml"
    preset.parent.mkdir(parents=True)
    preset.write_text('[set]\n"hparams.learning_rate" = 3e-5\n')
    before = {path: path.read_bytes() for path in root.rglob("*.*")}
    options = [f"--robustness={PUBLISHED / 'robustness'}", f"--custom={PUBLISHED / 'huber'}"]
    assert publish.main([*options, option.format(nowhere=nowhere), f"--root={root}"]) == 2
    assert message.format(nowhere=nowhere) in capsys.readouterr().err
    assert {path: path.read_bytes() for path in root.rglob("*.*")} == before


def test_quoted_numbers_are_those_of_the_results():
    data = worlds.as_the_paper_says(seeds=5, episodes=450)
    numbers = numbers_of(data)
    assert set(numbers) == {"fig5a", "fig5b"}
    np.testing.assert_allclose(numbers["fig5a"]["late_gap_q_learning"], 0.3, atol=1e-3)
    np.testing.assert_allclose(numbers["fig5b"]["first_gap_dpr"], 0.5, atol=1e-3)
    assert numbers["fig5a"]["c1_at_0.05"] == "supported"
    json.dumps(numbers, allow_nan=False)


def test_quoted_numbers_of_a_preset_are_those_of_its_environment():
    data = {"fig5a": worlds.as_the_paper_says(seeds=5, episodes=450)["fig5a"]}
    numbers = {preset: numbers_of(data, preset)["fig5a"] for preset in ("paper", "paper_table")}
    for preset, found in numbers.items():
        params = jrcjax.paper_params("source", preset)
        best = exact.optimal_policy(params)
        assert found["states_that_transmit"] == float(best[:, : params.num_rates].sum())
    assert numbers["paper"]["mean_value"] != numbers["paper_table"]["mean_value"]


def test_figures_that_were_not_made_have_no_verdicts_in_the_file():
    data = worlds.as_the_paper_says(seeds=5, episodes=450)
    found = pipeline.judgements_of({"fig9": data["fig9"]})
    assert {j.figure for j in found} == {"9"}
    assert len(as_json(found)) < len(claims_of({"fig9": data["fig9"]}))


def test_no_published_manifest_says_where_results_lay():
    manifests = sorted(PUBLISHED.rglob("*manifest*.json"))
    assert len(manifests) > 10
    for path in manifests:
        assert " --out " not in path.read_text(encoding="utf-8"), path
