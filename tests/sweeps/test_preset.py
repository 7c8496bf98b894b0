"""Files in place of the paper's parameters: what they change in both environments, in figures and in sweeps."""

import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

import jrcjax
from jrcjax.config.toml import save_params
from paper_figs.__main__ import main as figures_main
from sweeps.__main__ import main as sweeps_main
from sweeps.engine.estimate import block_seconds
from sweeps.engine.job import Job
from sweeps.preset import NAMED, check_preset, environment_of, preset_of, slots_of
from sweeps.results.configuration import digest_of
from sweeps.studies.registry import SWEEPS
from sweeps.sweep import Size, Study, size_of

TRAFFIC = """\
# Objects as somebody counted them.
environment = "target"

[radar]
density = 30.5
class_share = [0.6, 0.4]
size_mean = [[4.5, 2.0], [0.75, 0.5]]
size_std = [[0.25, 0.125], [0.0625, 0.03125]]
bank_size = 64
"""


@pytest.fixture
def traffic(tmp_path):
    file = tmp_path / "traffic.toml"
    file.write_text(TRAFFIC)
    return file


def test_a_file_changes_both_environments_and_its_density_is_the_targets(traffic):
    preset = preset_of(str(traffic))
    by_itself = jrcjax.load_params(traffic)
    room = environment_of("target", preset).radar.max_objects  # for the source's objects, too
    assert all(np.asarray(room) >= by_itself.radar.max_objects)
    alone = by_itself.replace(radar=dataclasses.replace(by_itself.radar, max_objects=room))
    assert digest_of(environment_of("target", preset)) == digest_of(alone)
    target, source = (environment_of(name, preset) for name in ("target", "source"))
    assert (float(target.radar.density), float(source.radar.density)) == (30.5, 61.0)
    for name, params in {"target": target, "source": source}.items():
        np.testing.assert_array_equal(params.radar.size_mean, [[4.5, 2.0], [0.75, 0.5]])
        np.testing.assert_array_equal(params.speed.prior, jrcjax.paper_params(name).speed.prior)


def test_a_figures_own_parameter_replaces_the_files(traffic):
    preset = preset_of(str(traffic))
    radars = Job(SWEEPS["fig8"], Size(preset=preset)).points.params.radar
    np.testing.assert_array_equal(radars.density, SWEEPS["fig8"].design.values("density"))
    assert set(np.asarray(radars.size_mean[:, 0, 0])) == {4.5}
    assert set(np.asarray(Job(SWEEPS["fig7"], Size(preset=preset)).points.params.radar.density)) == {30.5}


def test_comments_order_and_the_name_of_the_target_do_not_matter(traffic, tmp_path):
    lines = TRAFFIC.splitlines()
    other = tmp_path / "other.toml"
    other.write_text("\n".join(["[radar]", *reversed(lines[4:])]))
    assert preset_of(str(other)) == preset_of(str(traffic))


def test_a_files_own_preset_is_the_table_that_it_changes(tmp_path):
    file = tmp_path / "table.toml"
    file.write_text('preset = "paper_table"')
    for name in ("source", "target"):
        of_file, of_paper = environment_of(name, preset_of(str(file))), jrcjax.paper_params(name, "paper_table")
        assert digest_of(of_file) == digest_of(of_paper)


def test_a_whole_environment_may_be_a_preset(tmp_path, target):
    file = tmp_path / "whole.toml"
    save_params(file, target)
    assert digest_of(environment_of("target", preset_of(str(file)))) == digest_of(target)


def test_slots_of_an_episode_are_those_of_the_file(traffic):
    traffic.write_text(f"max_steps_in_episode = 60\n{TRAFFIC}")
    preset = preset_of(str(traffic))
    assert (slots_of(preset), slots_of("paper")) == (60, 300)
    of_file, of_paper = (
        block_seconds(Job(SWEEPS["fig8"], Size(preset=p, pretraining=0)), 8) for p in (preset, "paper")
    )
    np.testing.assert_allclose(of_file, of_paper / 5)


def test_a_file_in_the_folder_of_presets_has_a_name(traffic, monkeypatch):
    monkeypatch.setitem(NAMED, "traffic", traffic)
    assert preset_of("traffic") == preset_of(str(traffic))
    with pytest.raises(ValueError, match=r"preset: 'trafic'; allowed: paper, paper_table, "):
        preset_of("trafic")


def test_all_named_presets_are_those_of_the_figures_environments():
    for name in NAMED:
        check_preset(preset_of(name))


def test_a_study_with_its_own_presets_takes_no_file(traffic):
    study = Study("study", "", (SWEEPS["fig8"],), presets=("paper",))
    for preset in ("paper_table", preset_of(str(traffic))):
        with pytest.raises(ValueError, match=r"preset: '(paper_table|file-)"):
            size_of(None, None, preset, smoke=False, study=study)
    assert size_of(None, None, "paper", smoke=False, study=study) == Size()


@pytest.mark.slow
def test_figures_and_sweeps_take_a_file(traffic, tmp_path, capsys):
    size = ["--seeds", "1", "--episodes", "2"]
    traffic.write_text(f"max_steps_in_episode = 40\n{TRAFFIC}")
    assert figures_main(["--only", "8", *size, "--preset", str(traffic), "--out", str(tmp_path / "figures")]) == 0
    (results,) = (tmp_path / "figures" / "results").iterdir()
    assert results.name.startswith("file-")
    tables = {name: pd.read_csv(tmp_path / "figures" / f"{name}.csv") for name in ("fig8", "regret")}
    per_episode = tables["fig8"].query("panel == 'b' and algorithm == 'optimum'")["mean"].to_numpy()
    per_slot = tables["regret"].query("algorithm == 'ddqn'").optimum_throughput.to_numpy()
    np.testing.assert_allclose(per_episode, 40 * per_slot, rtol=1e-4)
    page = (tmp_path / "figures" / "report.html").read_text()
    assert "--preset FILE.toml" in page
    assert "size_mean = [[4.5, 2.0], [0.75, 0.5]]" in page
    configuration = json.loads((results / "fig8" / "manifest.json").read_text())["configuration"]
    assert "density = 30.5" in configuration["preset"]
    # The results are those of the other command, for which the file need not be there any more.
    traffic.unlink()
    assert sweeps_main(["verify", str(results / "fig8")]) == 0
    capsys.readouterr()


@pytest.mark.parametrize("main", [["paper_figs"], ["sweeps", "run", "fig6"], ["sweeps", "run", "multiverse"]])
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[radar]\ndensitty = 3.0", "radar.densitty: 'an unknown key'"),
        ("[radar]\ndensity = 0", "radar.density: 0; allowed: a number of objects > 0"),
        ("[radar]\ndensity = [1.0, 2.0]", "radar.density: "),
        ("[radar]\nsize_mean = [[4.5, 2.0]]", "radar.size_mean: "),
        ("[radar", "preset: "),
        ('environment = "source"', "environment: 'source'; allowed: 'target'"),
        (
            "[road]\nprior = [0.2, 0.3, 0.5]\nevent_probability = [0.1, 0.2, 0.3]",
            "levels (2, 3, 2, 2, 2) and 4 actions'; allowed: the paper's",
        ),
    ],
)
def test_a_file_that_cannot_be_is_refused_before_anything_is_written(main, text, message, tmp_path, capsys):
    file, out = tmp_path / "bad.toml", tmp_path / "out"
    file.write_text(text)
    module, *arguments = main
    command = figures_main if module == "paper_figs" else sweeps_main
    assert command([*arguments, "--preset", str(file), "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert str(file) in error
    assert not out.exists()


def test_a_file_that_is_not_there_is_named(tmp_path, capsys):
    file, out = tmp_path / "none.toml", tmp_path / "out"
    assert figures_main(["--preset", str(file), "--out", str(out)]) == 2
    assert str(file) in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("preset", ["town", "", None, 3, ["paper"], "[radar]\ndensity = -1\n"])
def test_no_preset(preset):
    with pytest.raises(ValueError, match=r"preset: |radar\.density: "):
        check_preset(preset)
