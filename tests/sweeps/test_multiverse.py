"""The multiverse: readings are what they are whatever their number, and a tiny run judges all claims."""

import io
import json

import jax
import joblib
import numpy as np
import pandas as pd
import pytest

import jrcjax
from jrcjax.config.paths import number_at, parameter_at
from paper_figs.claims.table import CLAIMS
from paper_figs.studies import summaries
from paper_figs.studies.multiverse import estimates, finished, judged, together, undecided
from sweeps.__main__ import main
from sweeps.engine.job import Job
from sweeps.preset import base_of
from sweeps.results import store
from sweeps.studies.multiverse import POINTS, SIZE, Selection, require_nothing_lost, some_of, sweeps_of
from sweeps.studies.readings import (
    PER_BLOCK,
    READINGS,
    SOURCE,
    as_text,
    choices,
    default_unit,
    is_static,
    range_of,
    unit_of,
    values_at,
)
from sweeps.studies.registry import SWEEPS
from sweeps.sweep import SMOKE, Size


def frame(sweep):
    """What is set at a sweep's points, empty where it is as by default."""
    return pd.DataFrame({column.name: sweep.design.values(column.name) for column in sweep.design.columns})


def test_a_reading_is_the_same_whatever_the_number_of_readings():
    many = unit_of(40)
    np.testing.assert_array_equal(unit_of(9), many[:9])
    np.testing.assert_array_equal(unit_of(5, first=20), many[20:25])
    np.testing.assert_array_equal(unit_of(1, first=1), many[1:2])
    assert values_at(many[0]) == {}
    blocks = sweeps_of(2 * PER_BLOCK + 8)
    assert [sweep.name for sweep in blocks] == [
        f"multiverse/{a}" for a in ("000000-000063", "000064-000127", "000128-000135")
    ]
    assert sweeps_of(PER_BLOCK, first=PER_BLOCK) == blocks[1:2]
    for of_block, whole in zip(sweeps_of(2 * PER_BLOCK + 8, selection=Selection(3)), blocks, strict=True):
        here = frame(whole).reading.isin(of_block.design.values("reading"))
        assert here.sum() == 3 * len(POINTS)
        part = frame(of_block)
        pd.testing.assert_frame_equal(part, frame(whole).loc[here, part.columns].reset_index(drop=True))
    assert sweeps_of(PER_BLOCK + 1, selection=Selection(3))[1] == sweeps_of(1, first=PER_BLOCK)[0]


def test_some_readings_of_a_block_are_a_random_sample():
    blocks = [range(first, first + PER_BLOCK) for first in range(0, 32 * PER_BLOCK, PER_BLOCK)]
    few, more = ([some_of(block, number) for block in blocks] for number in (3, 6))
    assert all(set(a) < set(b) <= set(block) for a, b, block in zip(few, more, blocks, strict=True))
    assert all(some_of(block, PER_BLOCK) == list(block) for block in blocks)
    places = np.array(more).ravel() % PER_BLOCK
    assert len(np.unique(places)) > PER_BLOCK / 2  # at the same places all blocks would have the same leading digits
    of_source = [reading.path for reading in READINGS].index(SOURCE)
    units = unit_of(32 * PER_BLOCK)[np.ravel(more)]
    correlated = np.corrcoef(units.T)[of_source]
    assert np.abs(np.delete(correlated, of_source)).max() < 4 / np.sqrt(len(units))


def test_readings_lie_in_their_ranges_and_each_level_is_tried_equally_often():
    rows = pd.DataFrame([values_at(unit) for unit in unit_of(256, first=256)])
    for reading in [reading for reading in READINGS if not is_static(reading)]:
        values, where = rows[reading.path].to_numpy(), range_of(reading)
        if where.levels:
            counts = [np.sum(values == level) for level in where.levels]
            assert sum(counts) == len(values), reading.path
            # 256 points have one in each 256th of the range, so a level gains or loses at most one at either end.
            np.testing.assert_allclose(counts, len(values) / len(counts), atol=2, err_msg=reading.path)
        elif reading.path != "hparams.learning_rate":
            assert where.low <= values.min() < values.max() <= where.high, reading.path
    sgd = rows["config.optimiser"] == 1
    assert rows["hparams.learning_rate"][sgd].max() <= 1e-4
    assert rows["hparams.learning_rate"][~sgd].max() > 5e-3
    # What decides code is the same within a block, and equally often each over the blocks.
    static = [reading.path for reading in READINGS if is_static(reading)]
    assert set(static) == {f"config.{name}" for name in ("optimiser", "gradient_clipping", "target_update", "n_step")}
    many = pd.DataFrame([values_at(unit) for unit in unit_of(64 * PER_BLOCK)[1:]], index=range(1, 64 * PER_BLOCK))
    blocks = many.groupby(many.index // PER_BLOCK)[static]
    assert (blocks.nunique().to_numpy() == 1).all()
    for path, values in blocks.first().items():
        assert np.ptp(values.value_counts()) <= 2, path
    assert choices(next(reading for reading in READINGS if reading.path == SOURCE)) == ("same", "table1")


@pytest.fixture(scope="module")
def job():
    return Job(sweeps_of(1)[0], SMOKE)


def test_the_first_reading_is_the_papers_default_at_the_points_of_the_figures(job):
    params, hparams = job.points
    base = jrcjax.paper_params("target")
    np.testing.assert_array_equal(hparams.learning_rate, np.float32(1e-3))
    np.testing.assert_array_equal(params.event_model, 0)
    first = jax.tree.map(lambda leaf: leaf[0], params)
    jax.tree.map(np.testing.assert_array_equal, first, base)
    for name, path in (("fig6", 0.9), ("fig7", 0.6), ("fig8", 40.0)):
        sweep = SWEEPS[name]
        (column,) = sweep.design.columns
        here = job.sweep.design.values(column.name).tolist().index(path)
        there = sweep.design.values(column.name).tolist().index(path)
        of_figure = Job(sweep, SMOKE).points.params
        for a, b in zip(jax.tree.leaves(params), jax.tree.leaves(of_figure), strict=True):
            np.testing.assert_array_equal(a[here], b[there])
    uniform = next(i for i, point in enumerate(POINTS) if point.values.get("prioritised") == 0)
    np.testing.assert_array_equal(np.flatnonzero(hparams.priority_exponent == 0), [uniform])


@pytest.mark.slow
def test_a_tiny_multiverse_judges_all_claims_in_each_reading(tmp_path):
    # Readings whose settings are the default's, so that the program of the tiny figures runs them.
    run = ["run", "multiverse", "--first", "1280", "--readings", "1282", "--smoke", "--out", str(tmp_path)]
    assert main(run) == 0
    summary = tmp_path / "multiverse" / "summary"
    found = pd.read_csv(summary / "verdicts.csv")
    assert set(found.reading) == {1280, 1281}
    assert {claim.split()[0] for claim in found.claim} == {f"C{number}" for number in range(1, 16)}
    assert (pd.read_csv(summary / "claims.csv").readings == 2).all()
    assert main([*run, "--resume"]) == 0
    before = (summary / "verdicts.csv").read_bytes()
    assert main([*run, "--keep"]) == 0  # nothing left to run
    assert (summary / "verdicts.csv").read_bytes() == before
    assert main([*run, "--keep", "--undecided", "C4 (reward)", "--seeds", "3"]) == 0
    both = pd.read_csv(summary / "verdicts.csv")
    more = both[both.n_seeds == 3]
    assert set(more.claim) == {claim.claim for claim in CLAIMS if claim.sweep in ("fig5a", "fig5b")}
    pd.testing.assert_frame_equal(both[both.n_seeds == 2].reset_index(drop=True), found)


@pytest.fixture
def made_up(monkeypatch, tmp_path):
    """A world in which results are a function of the reading, without a run."""

    def of_block(sweep, size, out):
        numbers = [int(number) for number in sweep.source.design.values("reading")]
        rng = [np.random.default_rng(number) for number in numbers]
        rows = [
            {"reading": n, "claim": claim, "value": r.normal() + n / 100, "ci_low": -1.0, "ci_high": np.nan}
            | {"verdict": "undecided", "holds": bool(n % 2), "negligible": None, "n_seeds": size.seeds}
            for n, r in zip(numbers, rng, strict=True)
            for claim in ["C3 (TLwD)"]
        ]
        return pd.DataFrame(rows)

    def summarise(folder, number, first=0, seeds=1, keep=False, per_block=PER_BLOCK):
        sweeps = sweeps_of(number, first, Selection(per_block))
        for sweep in sweeps:
            for part in (sweep, sweep.source):
                path = tmp_path / folder / part.name / store.MANIFEST
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(json.dumps(part.name))
        out = tmp_path / folder
        with joblib.parallel_config(backend="sequential"):
            written = summaries.summarise_multiverse(sweeps, Size(seeds=seeds), out, keep)
        return {path.name: path.read_bytes() for path in written}

    monkeypatch.setattr(summaries, "_of_block", of_block)
    return summarise


def test_a_multiverse_is_made_longer_from_its_summary_alone(made_up):
    whole = made_up("whole", 2 * PER_BLOCK)
    made_up("parts", PER_BLOCK)
    assert made_up("parts", PER_BLOCK, first=PER_BLOCK, keep=True) == whole
    assert set(json.loads(whole["manifests.json"])) == {
        f"multiverse/{block}{part}" for block in ("000000-000063", "000064-000127") for part in ("", "-source")
    }
    # Readings that are run once more take the place of what they were.
    assert made_up("parts", PER_BLOCK, keep=True) == whole


def test_only_readings_with_seeds_enough_have_a_part_in_shares_of_verdicts(made_up):
    made_up("out", 2 * PER_BLOCK)
    files = made_up("out", PER_BLOCK, seeds=5, keep=True)
    shares = pd.read_csv(io.BytesIO(files["claims.csv"]))
    assert set(shares.readings) == {2 * PER_BLOCK - 1}  # the default is none of the sample
    assert set(shares.judged) == {PER_BLOCK - 1}
    np.testing.assert_allclose(shares.undecided, 1.0)
    assert (shares.undecided_low > 0.9).all()
    more = pd.read_csv(io.BytesIO(made_up("out", 2 * PER_BLOCK, seeds=9, keep=True, per_block=3)["verdicts.csv"]))
    assert more.reading[more.n_seeds == 1].tolist() == list(range(2 * PER_BLOCK))
    again = [n for block in (range(PER_BLOCK), range(PER_BLOCK, 2 * PER_BLOCK)) for n in some_of(block, 3)]
    assert more.reading[more.n_seeds == 9].tolist() == again
    assert more.n_seeds.value_counts().to_dict() == {1: 2 * PER_BLOCK, 5: PER_BLOCK, 9: 6}
    alone = pd.read_csv(io.BytesIO(made_up("other", PER_BLOCK)["claims.csv"]))
    assert (alone.judged == 0).all()
    assert alone.supported.isna().all()


def test_more_seeds_go_where_a_claim_is_undecided(made_up, tmp_path, capsys):
    made_up("out", 2 * PER_BLOCK)
    path = tmp_path / "out" / "multiverse" / "summary" / "verdicts.csv"
    claim, found = "C3 (TLwD)", pd.read_csv(path)
    decided = found.reading.isin([0, 2, 3, 64])
    of_five = {"verdict": np.where(decided, "supported", "undecided"), "n_seeds": 5}
    found.assign(**of_five, negligible=np.where(found.reading == 7, "True", "")).to_csv(path, index=False)
    asked, figure = undecided(tmp_path / "out", claim, 9)
    assert asked == [n for n in range(2 * PER_BLOCK) if n not in (0, 2, 3, 7, 64)]
    assert figure == "fig5b"
    assert undecided(tmp_path / "out", claim, 5)[0] == []
    sweeps = sweeps_of(2 * PER_BLOCK, selection=Selection(60, asked, figure=figure))
    sampled = [some_of(range(first, first + PER_BLOCK), 60) for first in (0, PER_BLOCK)]
    numbers = [sweep.design.values("reading").tolist() for sweep in sweeps]  # one point of each
    assert numbers == [[n for n in of if n in asked] for of in sampled]
    assert all(sweep.name.startswith("multiverse/fig5b/") for sweep in sweeps)
    with pytest.raises(ValueError, match=r"undecided: 'C99' is unknown; allowed: 'C3 \(TLwD\)'"):
        undecided(tmp_path / "out", "C99", 9)
    (tmp_path / "out" / "multiverse" / "summary" / "manifests.json").write_text(
        '{"a": {"configuration": {"episodes": 450}}}'
    )
    run = ["run", "multiverse", "--keep", "--undecided", claim, "--seeds", "5", "--out", str(tmp_path / "out")]
    assert main(run) == 2
    assert "a claim with undecided readings of fewer than 5 seeds among these" in capsys.readouterr().err


def test_what_a_summary_has_with_so_many_seeds_is_not_run_again(made_up, tmp_path):
    made_up("out", 2 * PER_BLOCK)
    made_up("out", 2 * PER_BLOCK, seeds=6, keep=True, per_block=3)
    blocks = range(PER_BLOCK), range(PER_BLOCK, 2 * PER_BLOCK)
    few, more = (([some_of(block, number) for block in blocks]) for number in (3, 5))
    done = finished(tmp_path / "out", 6)
    assert done == {n for of in few for n in of}
    assert finished(tmp_path / "out", 1) == set(range(2 * PER_BLOCK))
    assert finished(tmp_path / "out", 7) == set()
    sweeps = sweeps_of(2 * PER_BLOCK, selection=Selection(5, without=done))
    new = [sweep.source.design.values("reading") for sweep in sweeps]
    assert [set(of) for of in new] == [set(b) - set(a) for a, b in zip(few, more, strict=True)]
    # With nothing left to run the summary is made anew, of what it has.
    before = (tmp_path / "out" / "multiverse" / "summary" / "verdicts.csv").read_bytes()
    out = tmp_path / "out"
    with joblib.parallel_config(backend="sequential"):
        summaries.summarise_multiverse((), Size(seeds=6), out, keep=True)
    assert (out / "multiverse" / "summary" / "verdicts.csv").read_bytes() == before


def test_the_points_of_a_figure_are_those_of_the_whole_reading():
    (whole,), (part,) = sweeps_of(2), sweeps_of(2, selection=Selection(asked=[1], figure="fig6"))
    expected = frame(whole).query("reading == 1 and point_of_reading < 4").reset_index(drop=True)
    found = frame(part)
    assert len(found) == 4
    pd.testing.assert_frame_equal(found, expected[found.columns])
    left_out = expected.drop(columns=found.columns)
    assert (left_out.nunique(dropna=False) <= 1).all()  # of the other figures, or as in reading 0
    pd.testing.assert_frame_equal(frame(part.source), frame(whole.source).iloc[[1]].reset_index(drop=True))


def test_verdicts_of_different_numbers_of_seeds_stand_beside_each_other():
    def table(n_seeds, *readings, claims=("C1 (reached)", "C3 (TLwD)")):
        rows = [{"reading": n, "claim": c, "n_seeds": n_seeds, "value": n_seeds} for n in readings for c in claims]
        return pd.DataFrame(rows)

    known = pd.concat([table(2, 0, 1, 2), table(20, 2, claims=["C3 (TLwD)"])])
    both = together([known, table(10, 2, 1), table(2, 0).assign(value=0.5)])
    assert both.drop(columns="value").values.tolist() == [
        [0, "C1 (reached)", 2],
        [0, "C3 (TLwD)", 2],
        [1, "C1 (reached)", 2],
        [1, "C1 (reached)", 10],
        [1, "C3 (TLwD)", 2],
        [1, "C3 (TLwD)", 10],
        [2, "C1 (reached)", 2],
        [2, "C1 (reached)", 10],
        [2, "C3 (TLwD)", 2],
        [2, "C3 (TLwD)", 10],
        [2, "C3 (TLwD)", 20],
    ]
    assert both.value[:2].tolist() == [0.5, 0.5]  # found anew
    both = both.reset_index(drop=True)
    assert set(estimates(both).n_seeds) == {2}
    assert len(estimates(both)) == 6
    assert judged(both)[["reading", "claim", "n_seeds"]].values.tolist() == [
        [1, "C1 (reached)", 10],
        [1, "C3 (TLwD)", 10],
        [2, "C1 (reached)", 10],
        [2, "C3 (TLwD)", 20],
    ]


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["multiverse", "--readings", "128", "--first", "63"], "first: 63; allowed: a multiple of 64"),
        (["multiverse", "--readings", "128", "--first", "128"], "first: 128; allowed: a multiple of 64"),
        (["multiverse", "--readings", "128", "--keep"], "keep: True; allowed: where an earlier run left its summary"),
        (["multiverse", "--per-block", "65"], "per_block: 65; allowed: an int from 1 to 64"),
        (["multiverse", "--undecided", "C4"], "keep: False; allowed: True beside --undecided"),
        (
            ["multiverse", "--undecided", "C4", "--keep"],
            "undecided: 'C4'; allowed: where an earlier run left its summary",
        ),
        (["fig6", "--undecided", "C4"], "name: 'fig6'; allowed: multiverse, for which alone --undecided is"),
        (["fig6", "--per-block", "6"], "name: 'fig6'; allowed: multiverse, for which alone --per-block is"),
        (["fig6", "--first", "64"], "name: 'fig6'; allowed: multiverse, for which alone --first is"),
        (["reconstruction", "--keep"], "name: 'reconstruction'; allowed: multiverse, for which alone --keep is"),
    ],
)
def test_bad_options_are_refused(flags, message, tmp_path, capsys):
    assert main(["run", *flags, "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_readings_of_another_length_are_not_added(made_up, tmp_path, capsys):
    made_up("out", 2)
    path = tmp_path / "out" / "multiverse" / "summary" / "manifests.json"
    path.write_text(json.dumps({"multiverse/000000-000001": {"configuration": {"episodes": 450}}}))
    run = ["run", "multiverse", "--keep", "--readings", "2", "--episodes", "20", "--out", str(tmp_path / "out")]
    assert main(run) == 2
    assert "episodes: 20; allowed: 450, as in the summary that is kept" in capsys.readouterr().err


def test_a_summary_that_says_more_than_a_run_is_not_replaced(made_up, tmp_path, capsys):
    made_up("out", 2 * PER_BLOCK)
    summary = tmp_path / "out" / "multiverse" / "summary"
    manifest = {"configuration": {"episodes": SIZE.episodes}}
    (summary / "manifests.json").write_text(json.dumps({"multiverse/000000-000127": manifest}))
    before = {path.name: path.read_bytes() for path in summary.iterdir()}
    run = ["run", "multiverse", "--out", str(tmp_path / "out")]
    for options, lost in (
        (["--readings", "128", "--seeds", "2"], 128),
        (["--readings", "128", "--seeds", "1", "--per-block", "3"], 122),
        (["--readings", "128", "--seeds", "1", "--episodes", "20"], 128),
        (["--smoke"], 128),
    ):
        assert main([*run, *options]) == 2
        message = capsys.readouterr().err
        assert f"keep: False; allowed: True, which keeps what the summary in {summary} says of {lost} readin" in message
    assert {path.name: path.read_bytes() for path in summary.iterdir()} == before
    require_nothing_lost(tmp_path / "out", sweeps_of(2 * PER_BLOCK + 1), Size(seeds=1, episodes=SIZE.episodes))
    require_nothing_lost(tmp_path / "nowhere", sweeps_of(1), SIZE)


def test_no_table_of_more_readings_is_left_beside_new_verdicts(made_up, tmp_path):
    first = made_up("out", 2 * PER_BLOCK)
    assert {"sensitivity.csv", "interactions.csv", "sensitivity.png", "specification.pdf"} <= set(first)
    summary = tmp_path / "out" / "multiverse" / "summary"
    (summary / "known.csv").write_text("of an earlier run")
    (summary / "notes.txt").write_text("of a person")
    again = made_up("out", 2)
    assert {path.name for path in summary.iterdir()} == {*again, "notes.txt"}
    assert not {"sensitivity.csv", "specification.pdf", "known.csv"} & set(again)


def test_the_default_has_a_place_in_the_space():
    base = base_of("target", "paper")
    for path, value in values_at(default_unit()).items():
        if path == SOURCE:
            assert value == 0
        elif path.startswith("config."):
            default = getattr(base.config, path.removeprefix("config."))
            assert as_text(path, value) == default, path
        else:
            assert value == pytest.approx(number_at(parameter_at(path, base.points), base.points), rel=1e-5), path
