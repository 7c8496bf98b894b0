"""Figures: the numbers first, then the files; drawing is a function of results and never trains."""

import itertools
import json
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
import worlds
from matplotlib.colors import to_rgb
from matplotlib.text import Text
from worlds import Learner

from paper_figs import NUMBERS, pipeline, report
from paper_figs.__main__ import main
from paper_figs.analysis import divergence, statistics
from paper_figs.analysis.intervals import mean_effect
from paper_figs.figures import FIGURES
from paper_figs.plots import curves, maps, points, style
from sweeps.results import store
from sweeps.sweep import Size

SLOTS = 300


def results(seeds=6, episodes=800):
    """Results with known numbers: rewards near 3.8, 3 and -8, an exact optimum of 4."""
    learners = {
        "ddqn": Learner(1, 0.05, 0.05),
        "q_learning": Learner(1, 0.25, 0.25),
        "round_robin": Learner(1, 3.0, 3.0),
    }
    return worlds.study(learners, 4.0, seeds=seeds, episodes=episodes)


def speed_world():
    return worlds.as_the_paper_says(seeds=6, episodes=40)["fig6"]


@pytest.mark.parametrize(("episodes", "width"), [(1000, 10), (20, 1), (100, 1), (150, 2), (101, 2), (997, 10)])
def test_bins_are_the_smallest_that_give_at_most_a_hundred_points(episodes, width):
    assert statistics.bins_of(episodes) == width
    values = np.random.default_rng(0).normal(size=(3, episodes)).astype(np.float32)
    means = statistics.bin_means(values, width)
    assert means.shape == (3, -(-episodes // width))
    whole = episodes // width
    # Bit for bit, whether or not there are more episodes than whole bins have.
    np.testing.assert_array_equal(means[:, :whole], values[:, : whole * width].reshape(3, -1, width).mean(axis=2))
    if rest := episodes % width:
        np.testing.assert_allclose(means[:, -1], values[:, -rest:].mean(axis=1), rtol=1e-6)


def test_a_prime_number_of_episodes_is_drawn_as_a_curve():
    table = curves.table(results(episodes=997), "5", "a")
    assert set(table.groupby("algorithm").x.agg(tuple)) == {(*range(10, 991, 10), 997)}


def test_table_holds_bin_means_over_seeds_and_the_exact_optimum():
    data = results()
    table = curves.table(data, "5", "a")
    assert list(table.columns) == curves.COLUMNS
    assert set(table.n_diverged) == {0}
    ddqn = table[table.algorithm == "ddqn"]
    reward = data["reward"].sel(algorithm="ddqn").isel(point=0).values
    np.testing.assert_array_equal(ddqn.x, np.arange(8, 801, 8))
    np.testing.assert_allclose(np.asarray(ddqn["mean"])[3], reward[:, 24:32].mean())
    assert (ddqn.ci_low < ddqn["mean"]).all()
    assert set(ddqn.n_seeds) == {6}
    optimum = table[table.algorithm == "optimum"]
    assert set(optimum["mean"]) == {4.0}
    assert set(optimum.n_seeds) == {0}


def test_drawn_curves_are_the_table():
    table = curves.table(results(), "5", "a")
    axes = curves.draw(table, "title").axes[0]
    lines = {line.get_label(): line for line in axes.get_lines()}
    exact = {look.label for look in style.EXACT.values()}
    assert set(lines) == exact | {"DDQN", "Q-learning", "Round Robin"}
    np.testing.assert_allclose(lines["DDQN"].get_ydata(), table[table.algorithm == "ddqn"]["mean"])
    np.testing.assert_allclose(lines["optimum (exact)"].get_ydata(), 4.0)
    assert "6 seeds" in axes.get_title()
    assert "slot" in axes.get_ylabel()


@pytest.mark.parametrize(("other", "insets"), [(-10.0, 1), (-1.0, 0)])
def test_an_inset_enlarges_what_is_near_the_optimum_and_hides_no_curve(other, insets):
    levels = {"optimum": 10.0, "tlwd": 9.5, "round_robin": -10.0, "ddqn": other}
    rows = [("5", "b", name, x, mean, mean, mean, 2, 0) for name, mean in levels.items() for x in range(10, 1001, 10)]
    axes = curves.draw(pd.DataFrame(rows, columns=curves.COLUMNS), "title").axes[0]
    assert len(axes.child_axes) == insets


def test_one_seed_is_drawn_without_a_band():
    axes = curves.draw(curves.table(results(seeds=1), "5", "a"), "title").axes[0]
    assert "no interval" in axes.get_title()


def test_saved_pictures_are_the_same_bytes(tmp_path):
    table = curves.table(results(), "5", "a")
    first = style.save(curves.draw(table, "title"), tmp_path / "first")
    second = style.save(curves.draw(table, "title"), tmp_path / "second")
    assert [path.suffix for path in first] == [".pdf", ".png"]
    assert [path.read_bytes() for path in first] == [path.read_bytes() for path in second]


def test_fonts_are_embedded_as_type_42(tmp_path):
    pdf, _ = style.save(curves.draw(curves.table(results(), "5", "a"), "title"), tmp_path / "figure")
    assert b"/Subtype /Type3" not in pdf.read_bytes()
    assert b"/FontFile2" in pdf.read_bytes()


@pytest.mark.slow
def test_one_command_writes_everything(tmp_path, capsys):
    out = tmp_path / "figures"
    options = ["--only", "5", "--smoke", "--seeds", "3", "--out", str(out)]
    done = subprocess.run([sys.executable, "-m", "paper_figs", *options], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for figure in [figure for figure in FIGURES if figure.number == 5]:
        for suffix in (".pdf", ".png", ".csv"):
            assert (out / f"{figure.name}{suffix}").stat().st_size > 0
    table = pd.read_csv(out / "fig5a.csv")
    assert {"figure", "panel", "algorithm", "x", "mean", "ci_low", "ci_high", "n_seeds"} <= set(table.columns)
    assert set(table.n_seeds) == {0, 3}
    assert {row["claim"] for row in json.loads((out / "claims.json").read_text())} > {"C1 (reached)"}
    made = json.loads((out / "made.json").read_text())
    assert (made["preset"], made["episodes"], made["seeds"]) == ("paper", 20, 3)
    assert made["figures"] == ["fig5a", "fig5b"]
    page = (out / "report.html").read_text()
    assert "data:image/png;base64," in page
    assert "http" not in page.replace(
        "https://arxiv.org/abs/", ""
    )  # self-contained, but for the paper that it is about
    assert main(options) == 0  # again
    assert "all 3 seeds are there" in capsys.readouterr().err


def test_numbers_are_those_of_the_figures():
    assert {figure.number for figure in FIGURES} == set(NUMBERS)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--only", "4"], "only: [4]; allowed: 5, 6, 7, 8, 9"),
        (["--seeds", "-1"], "seeds: -1; allowed: an int from 1"),
        (["--delta.reward", "0"], "delta.reward: 0.0; allowed: a number > 0"),
        (["--delta.episodes", "nan"], "delta.episodes: nan; allowed: a number > 0"),
        (["--preset", "x"], "preset: 'x'; allowed: paper, paper_table, best, or a file"),
    ],
)
def test_command_line_errors_write_and_compute_nothing(arguments, message, capsys, tmp_path, monkeypatch):
    out = tmp_path / "figures"
    monkeypatch.setattr("paper_figs.__main__.base_of", lambda *_: pytest.fail("placements were drawn"))
    assert main([*arguments, "--out", str(out)]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()


def test_points_table_holds_means_over_episodes_and_seeds_and_the_exact_lines():
    data = speed_world()
    table = points.table(data, "6", "high_speed_event_probability", SLOTS)
    assert list(table.columns) == curves.COLUMNS
    assert set(table.panel) == {"a", "b", "c"}
    row = table.query("panel == 'c' and algorithm == 'ddqn' and x == 0.3").iloc[0]
    values = data["miss_detection"].sel(algorithm="ddqn").isel(point=2).mean("episode").values
    np.testing.assert_allclose([row["mean"], row.ci_low, row.ci_high], mean_effect(values))
    assert row.n_seeds == 6
    # The long-run throughput is 0.5 per slot, the figure's is per episode, of 300 slots or of another number.
    for slots in (300, 120):
        of_slots = points.table(data, "6", "high_speed_event_probability", slots)
        assert set(of_slots.query("panel == 'b' and algorithm == 'optimum'")["mean"]) == {0.5 * slots}
    explored = table.query("panel == 'a' and algorithm == 'explored'")["mean"]
    np.testing.assert_allclose(explored, data["explored_reward"].mean("episode"))


def test_drawn_points_are_the_table():
    table = points.table(speed_world(), "6", "high_speed_event_probability", SLOTS)
    panels = points.draw(table, "title", "x").axes
    assert [axes.get_title() for axes in panels] == ["(a)", "(b)", "(c)"]
    assert ["reward" in panels[0].get_ylabel(), "packets" in panels[1].get_ylabel()] == [True, True]
    for axes, panel in zip(panels, "abc", strict=True):
        lines = {line.get_label(): line for line in axes.get_lines()}
        for name, look in style.EXACT.items() | {n: style.LOOKS[n] for n in ("tlwd", "dpr", "ddqn")}.items():
            wanted = table.query(f"panel == {panel!r} and algorithm == {name!r}")
            np.testing.assert_allclose(lines[look.label].get_ydata(), wanted["mean"])


def test_claims_are_judged_from_all_learners_that_were_run_and_pictures_show_their_own(tmp_path, monkeypatch):
    never = dict.fromkeys(("tlwd", "dpr", "ddqn", "round_robin"), Learner(worlds.NEVER, 0.5))
    learners = never | {"q_learning": Learner(50, 0.5)}  # converges, and is in neither picture
    axes = {"fig6": ("high_speed_event_probability", worlds.TENTHS), "fig9": ("prioritised", (1.0, 0.0))}
    judged = {}
    for figure in (figure for figure in FIGURES if figure.name in axes):
        data = worlds.study(learners, 4.0, *axes[figure.name], seeds=6)
        monkeypatch.setattr(store, "load", lambda folder, seeds, data=data: data)
        (tmp_path / figure.name).mkdir()
        (tmp_path / figure.name / store.MANIFEST).write_text("{}")
        drawn = pipeline._draw(figure, tmp_path, Size(seeds=6), tmp_path)
        judged |= {j.claim: j for j in pipeline.judgements_of({figure.name: drawn.results})}
        expected = {"tlwd", "tlwd_uniform"} if figure.name == "fig9" else {"tlwd", "dpr", "ddqn"}
        assert set(pd.read_csv(tmp_path / f"{figure.name}.csv").algorithm) == expected | set(style.EXACT)
    # As in a study of many readings: somebody converges, so that the others never do is known.
    assert judged["C7 (DDQN)"].verdict == "contradicted"
    assert judged["C15 (episodes)"].reason == "the interval of 6 seeds holds the limit"


def test_one_algorithm_at_two_points_gives_two_curves():
    data = worlds.as_the_paper_says(seeds=6, episodes=400)["fig9"]
    table = curves.table(data, "9", "", points={"tlwd": 0, "tlwd_uniform": 1})
    means = table.groupby("algorithm")["mean"].mean()
    np.testing.assert_allclose(means[["tlwd", "tlwd_uniform"]], data["reward"].mean(["seed", "episode"])[0])


def test_diverged_agents_are_counted_in_table_and_title_and_named_in_the_report():
    data = results()
    data["first_diverged"].loc[{"algorithm": "ddqn", "seed": [2, 5]}] = [3, 700]
    table = curves.table(data, figure="5", panel="a")
    assert set(table.query("algorithm == 'ddqn'").n_diverged) == {2}
    assert set(table.query("algorithm != 'ddqn'").n_diverged) == {0}
    assert style.band_of(table).endswith("of the mean; up to 2 diverged agents at a point")
    of_maps = table.assign(panel="a", point=table.x, p=table.x, q=0.0)
    figure = maps.draw(of_maps, pd.DataFrame(), "a", ("p", "q"), {})
    assert figure.get_suptitle().endswith("seeds; up to 2 diverged agents at a point)")
    rows = divergence.rows("fig5a", data)
    agent = {"sweep": "fig5a", "algorithm": "ddqn", "point": 0}
    assert rows == [agent | {"seed": 2, "episode": 3}, agent | {"seed": 5, "episode": 700}]
    page = report.render(Size(), {}, [], [], rows, {})
    assert "<td>ddqn</td>" in page
    assert '<td class="number">700</td>' in page
    assert "<p>None.</p>" in report.render(Size(), {}, [], [], [], {})


def test_diverged_agents_are_counted_at_each_point():
    data = worlds.study({"tlwd": Learner(1, 0.1), "dpr": Learner(1, 0.1)}, 4.0, "density", (8.0, 16.0), 6, 20)
    data["first_diverged"].loc[{"algorithm": "tlwd", "point": 1, "seed": 0}] = 1
    table = points.table(data, "8", "density", SLOTS)
    assert table.query("n_diverged > 0")[["algorithm", "x"]].drop_duplicates().values.tolist() == [["tlwd", 16.0]]


# --- Legibility -------------------------------------------------------------------------------------------------------

# Linear RGB as it appears without the medium-wave cones: Machado, Oliveira and Fernandes (2009), severity 1.
DEUTERANOPIA = np.array(
    [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]]
)
LUMINANCE = np.tile([0.2126, 0.7152, 0.0722], (3, 1))


def lab(color, seen_through):
    """CIE L*a*b* (D65) of a colour after a linear map of its RGB."""
    rgb = np.array(to_rgb(color))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    xyz = to_xyz @ np.clip(seen_through @ linear, 0, 1) / to_xyz.sum(axis=1)
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def distance(a, b, seen_through):
    return np.linalg.norm(lab(a.color, seen_through) - lab(b.color, seen_through))


PAIRS = list(itertools.combinations(style.LOOKS.values(), 2))


def test_the_colours_of_algorithms_stay_apart_for_the_colour_blind():
    # 10 is a difference that nobody overlooks; a red and a green show that the measure tells what others see.
    assert min(distance(a, b, DEUTERANOPIA) for a, b in PAIRS) > 10
    red, green = style.Look("", "#B5651D"), style.Look("", "#7D7D1D")
    assert distance(red, green, DEUTERANOPIA) < 10 < distance(red, green, np.eye(3))


def test_in_grey_every_algorithm_has_its_marker_and_those_as_dark_another_line():
    assert len({look.marker for look in style.LOOKS.values()}) == len(style.LOOKS)
    alike = [(a, b) for a, b in PAIRS if distance(a, b, LUMINANCE) < 4]
    assert all(a.line != b.line or a.hollow != b.hollow for a, b in alike)
    exact = [look.line for look in style.EXACT.values()]
    assert len(set(exact)) == len(exact)
    assert all(look.marker == "" for look in style.EXACT.values())


def test_markers_of_curves_are_beside_each_other():
    axes = curves.draw(curves.table(results(), "5", "a"), "title").axes[0]
    first = [line.get_markevery()[0] for line in axes.get_lines() if line.get_marker()]
    assert len(set(first)) == len(first) == 3


def test_one_column_is_as_wide_as_a_papers_and_no_text_is_smaller_than_six_points():
    for figure, width in (
        (curves.draw(curves.table(results(), "5", "a"), "title"), 3.5),
        (points.draw(points.table(speed_world(), "6", "high_speed_event_probability", SLOTS), "title", "x"), 7.16),
    ):
        assert figure.get_figwidth() == width
        assert min(float(text.get_fontsize()) for text in figure.findobj(Text)) >= 6
