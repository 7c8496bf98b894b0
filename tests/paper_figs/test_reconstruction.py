"""The search for a reading, in made-up worlds in which the right one is known."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import worlds

import jrcjax
from jrcjax import exact
from jrcjax.config.paths import parameter_at
from jrcjax.readings import Loss
from paper_figs.claims.table import CLAIMS as TABLE
from paper_figs.claims.table import number_of
from paper_figs.studies import multiverse, reconstruction
from sweeps.__main__ import main
from sweeps.preset import SOURCES, base_of, preset_of, set_in
from sweeps.studies.multiverse import points_of
from sweeps.studies.readings import PER_BLOCK, READINGS, SOURCE, default_unit, is_static, unit_of, values_at
from sweeps.studies.reconstruction import Effort, confirmation_sweep, effort_of
from sweeps.sweep import Size

RATE = [reading.path for reading in READINGS].index("hparams.learning_rate")
CLAIMS = [f"C{number} ({part})" for number in range(1, 16) for part in "ab"]
SIZE = Size(seeds=2, episodes=5)


def verdicts_of(holds):
    number = len(CLAIMS)
    return pd.DataFrame(
        {
            "claim": CLAIMS,
            "value": np.arange(number, dtype=float),
            "ci_low": np.zeros(number),
            "ci_high": np.ones(number),
            "verdict": "undecided",
            "holds": holds,
            "negligible": None,
            "n_seeds": 3,
        }
    )


@pytest.fixture
def small_steps_only(monkeypatch):
    """A world where the more statements hold the smaller the steps are; later seeds take back the first claim."""
    units, seen = {}, []

    def remember(make):
        def kept(*args):
            sweep = make(*args)
            of_sweep = next(arg for arg in args if isinstance(arg, list | np.ndarray))
            units[sweep.name] = of_sweep if isinstance(of_sweep, list) else [of_sweep]
            return sweep

        return kept

    def verdicts(sweep, size, out, first_seed):
        seen.append((sweep.name, size.seeds, first_seed))
        numbers, found = sweep.source.design.values("reading"), []
        for number, unit in zip(numbers, units[sweep.name], strict=True):
            holds = np.arange(len(CLAIMS)) >= len(CLAIMS) * unit[RATE]
            holds[:2] &= first_seed == 0
            found.append(verdicts_of(holds).assign(reading=int(number)))
        return pd.concat(found)

    for name in ("generation_sweep", "confirmation_sweep"):
        monkeypatch.setattr(reconstruction, name, remember(getattr(reconstruction, name)))
    monkeypatch.setattr(reconstruction, "_verdicts", verdicts)
    monkeypatch.setattr(reconstruction, "lost_by_one_action", lambda units: np.array([u[RATE] for u in units]))
    return seen


def test_the_search_finds_the_reading_and_confirms_it_with_other_seeds(small_steps_only, tmp_path):
    ran = []
    effort = Effort(readings=160, confirm=7, starts=1, per_generation=16)
    reconstruction.search(effort, SIZE, tmp_path, lambda sweep, size=SIZE: ran.append(size.seeds))
    summary = tmp_path / "reconstruction" / "summary"
    tried = pd.read_csv(summary / "tried.csv")
    assert len(tried) == 160
    rates = tried["hparams.learning_rate"].to_numpy()
    assert np.median(rates[-16:]) < 1e-5 < 1e-4 < np.median(rates[:16])
    chosen = pd.read_csv(summary / "confirmed.csv").reading.nunique()
    assert ran == [2] * 10 + [9] * chosen  # 7 fresh seeds beyond the 2 of the search
    assert small_steps_only[-1][1:] == (9, 2)
    confirmed = pd.read_csv(summary / "confirmed.csv")
    best = confirmed[confirmed.best_for.str.contains("all")]
    worth = tried[tried.lost_by_one_action >= reconstruction.LEAST_LOSS]  # here the larger the steps the more
    of_them = confirmed[confirmed.best_for.str.contains("trade-off")]
    assert set(of_them.reading) == {worth.reading[worth.agreement.idxmax()]}
    assert len(of_them) == len(best)
    assert best.promised[1:2].all()
    assert not best.holds[:2].any()  # what the search promised and fresh seeds did not give
    preset = preset_of(str(summary / reconstruction.PRESET_FILE))
    rate = float(base_of("target", preset).points.hparams.learning_rate)
    assert rate == pytest.approx(tried["hparams.learning_rate"][tried.agreement.argmax()], rel=1e-5)


def test_a_search_starts_from_the_best_readings_with_different_code():
    def known(number, held):
        return reconstruction.Tried(f"multiverse {number}", unit_of(1, number)[0], verdicts_of(np.arange(30) < held))

    # Of each block one code: the best reading of the first has another of its block that agrees least of all.
    tried = [known(1, 28), known(2, 2), known(PER_BLOCK, 20), known(2 * PER_BLOCK, 24), known(2 * PER_BLOCK + 1, 26)]
    starts = reconstruction._starts(tried, Effort(starts=2))
    np.testing.assert_array_equal(starts, [tried[0].unit, tried[4].unit])


def test_a_search_is_the_same_each_time(small_steps_only, tmp_path):
    tables = []
    for name in ("first", "second"):
        effort = Effort(readings=8, confirm=1, starts=2, per_generation=4)
        reconstruction.search(effort, SIZE, tmp_path / name, lambda sweep, size=SIZE: None)
        tables.append((tmp_path / name / "reconstruction" / "summary" / "tried.csv").read_bytes())
    assert tables[0] == tables[1]


def test_a_search_goes_on_from_the_verdicts_that_it_kept(small_steps_only, tmp_path):
    def search(readings, seeds=2):
        ran = []
        effort, size = Effort(readings=readings, confirm=1, starts=2, per_generation=4), Size(seeds=seeds, episodes=5)
        reconstruction.search(effort, size, tmp_path, lambda sweep, size=SIZE: ran.append(sweep.name))
        return ran

    summary = tmp_path / "reconstruction" / "summary"
    tried, confirmed = search(8), {path.name for path in (summary / "confirmed").glob("*/*.csv")}
    assert tried[:2] == ["reconstruction/tried/000000-000003", "reconstruction/tried/000004-000007"]
    assert len(tried) == 2 + len(confirmed) > 2
    before = (summary / "tried.csv").read_bytes()
    assert search(8) == []
    assert (summary / "tried.csv").read_bytes() == before
    assert search(12)[0] == "reconstruction/tried/000008-000011"
    assert (summary / "tried.csv").read_bytes().startswith(before)
    # Verdicts of other readings or of another size are no one's.
    assert [name for name in search(12, seeds=3) if "tried" in name] == [
        f"reconstruction/tried/{block}" for block in ("000000-000003", "000004-000007", "000008-000011")
    ]


def test_a_summary_is_not_replaced_by_that_of_a_shorter_search(small_steps_only, tmp_path):
    def search(readings):
        ran = []
        effort = Effort(readings=readings, confirm=1, starts=1, per_generation=4)
        reconstruction.search(effort, SIZE, tmp_path, lambda sweep, size=SIZE: ran.append(sweep.name))
        return ran

    search(10)
    summary = tmp_path / "reconstruction" / "summary"
    before = {path: path.read_bytes() for path in summary.rglob("*.*")}
    with pytest.raises(ValueError, match=f"readings: 8; allowed: at least 12, as in the summary in {summary}; or ano"):
        search(8)
    assert {path: path.read_bytes() for path in summary.rglob("*.*")} == before
    assert search(9) == []  # as many generations


def test_a_search_that_is_stopped_says_what_is_confirmed_so_far(small_steps_only, tmp_path, monkeypatch):
    def two_of(tried, lost):
        return [reconstruction.Choice(tried[0], (reconstruction.ALL,)), reconstruction.Choice(tried[1], ("C5",))]

    def run(sweep, size=SIZE):
        ran.append(size.seeds)
        if ran.count(9) == 2:
            raise KeyboardInterrupt

    ran = []
    monkeypatch.setattr(reconstruction, "choice_of", two_of)
    with pytest.raises(KeyboardInterrupt):
        reconstruction.search(Effort(readings=16, confirm=7, starts=1, per_generation=16), SIZE, tmp_path, run)
    summary = tmp_path / "reconstruction" / "summary"
    assert set(pd.read_csv(summary / "confirmed.csv").best_for) == {"all"}
    assert len(pd.read_csv(summary / "tried.csv")) == 16
    assert (summary / reconstruction.PRESET_FILE).is_file()


def test_what_decides_code_stays_as_it_is_at_the_start():
    optimiser = reconstruction._Optimiser(unit_of(1, PER_BLOCK)[0], 8, seed=0)
    start = values_at(unit_of(1, PER_BLOCK)[0])
    for _ in range(3):
        units = optimiser.ask()
        for values in map(values_at, units):
            assert {r.path: values[r.path] == start[r.path] for r in READINGS if is_static(r)} == {
                r.path: True for r in READINGS if is_static(r)
            }
            for path, value in values.items():
                if path != SOURCE:
                    names = parameter_at(path, base_of("target", "paper").points).readings
                    assert not names or 0 <= value < len(names)
            assert 0 <= values[SOURCE] < len(SOURCES)
        optimiser.tell([float(unit[RATE]) for unit in units])


def test_the_best_of_a_multiverse_are_starts_and_may_be_chosen(tmp_path):
    folder = tmp_path / "multiverse" / "summary"
    folder.mkdir(parents=True)
    best = PER_BLOCK + 1
    rows = [
        verdicts_of(np.arange(len(CLAIMS)) < held).assign(reading=number)
        for number, held in {0: 5, best: 20, best + 1: 19, 2 * PER_BLOCK: 3}.items()
    ]
    pd.concat(rows).to_csv(folder / "verdicts.csv", index=False)
    known = reconstruction._of_multiverse(tmp_path)
    assert [one.name for one in known] == [
        "default",
        *(f"multiverse {number}" for number in (best, best + 1, 2 * PER_BLOCK)),
    ]
    starts = reconstruction._starts(known, Effort(starts=2))
    np.testing.assert_array_equal(starts[0], unit_of(1, best)[0])  # and not the next, of the same block
    np.testing.assert_array_equal(starts[1], default_unit())
    first, *_ = reconstruction.choice_of(known, np.zeros(len(known)))
    assert first.reading.name == f"multiverse {best}"
    assert first.best_for[0] == reconstruction.ALL
    assert first.reading.agreement == pytest.approx(10 / 15)


def tried_with(name, holds, values):
    of = pd.DataFrame({"claim": [c.claim for c in TABLE], "value": values, "holds": holds})
    of = of.assign(ci_low=0.0, ci_high=0.0, verdict="undecided", negligible=None, n_seeds=1)
    return reconstruction.Tried(name, default_unit(), of)


def test_one_action_loses_what_the_exact_solver_says_and_nothing_where_events_ignore_the_state():
    params = jrcjax.paper_params("target")
    best, constant = (
        float(exact.evaluate_policy(params, policy(params)).reward)
        for policy in (exact.optimal_policy, exact.best_constant_action)
    )
    without = default_unit()
    without[[reading.path for reading in READINGS].index("env.event_model")] = 0.5  # marginal
    lost = reconstruction.lost_by_one_action([default_unit(), without])
    np.testing.assert_allclose(lost, [1 - constant / best, 0.0], rtol=1e-4, atol=1e-6)
    assert lost[0] > reconstruction.LEAST_LOSS


def test_the_best_reading_with_a_trade_off_is_confirmed_for_all_claims():
    number = np.array([number_of(c.claim) for c in TABLE])
    most, less = tried_with("most", number != "C15", 1.0), tried_with("less", number == "C14", 1.0)
    least = tried_with("least", number == "none", 1.0)
    choices = reconstruction.choice_of([most, least, less], np.array([0.0, 0.3, 0.02]))
    (chosen,) = [choice for choice in choices if reconstruction.TRADE_OFF in choice.best_for]
    assert chosen.reading.name == "less"
    assert chosen.speaks_of(less.verdicts.claim).all()
    assert choices[0].reading.name == "most"


def test_a_reading_is_confirmed_where_it_is_the_best():
    number = np.array([number_of(c.claim) for c in TABLE])
    most = tried_with("most", number != "C15", 1.0)
    other = tried_with("other", number == "C15", 1.0)
    for_all, for_one = choices = reconstruction.choice_of([most, other], np.zeros(2))
    assert for_all.reading.name == "most"
    assert for_all.speaks_of(most.verdicts.claim).all()
    assert for_all.figures == {"fig5a", "fig5b", "fig6", "fig7", "fig8", "fig9"}
    assert for_one.best_for == ("C15",)
    assert for_one.figures == {"fig9"}
    sweeps = [confirmation_sweep(choice.reading.unit, choice.figures) for choice in choices]
    assert [len(sweep.design.values("reading")) for sweep in sweeps] == [10, 2]
    assert sweeps[0].name != sweeps[1].name  # one reading, other points
    table = reconstruction.confirmed_table(choices, [most.verdicts, other.verdicts])
    of_other = table[table.reading == "other"]
    assert set(of_other.claim.map(number_of)) == {"C15"}
    assert of_other.holds.all()
    assert of_other.promised.all()


def test_claims_are_judged_at_the_points_of_their_figures_alone():
    world = worlds.as_the_paper_says()
    target = world["fig9"].assign_coords(point_of_reading=("point", list(points_of({"fig9"}))))
    judged = {j.claim: j for j in multiverse.claims_in(world["fig5a"], target)}
    assert {j.verdict for j in judged.values() if number_of(j.claim) in ("C1", "C15")} == {"supported"}
    assert {j.verdict for j in judged.values() if number_of(j.claim) in ("C5", "C10", "C13")} == {"undecided"}


def test_the_closest_reading_is_told_with_what_it_lacks():
    first, second = (tried_with(name, False, value) for name, value in (("first", -2.0), ("second", 3.0)))
    first.verdicts.loc[first.verdicts.claim == "C11", "value"] = np.nan
    table = reconstruction.closest_table([first, second]).set_index("claim")
    for claim in TABLE:
        row = table.loc[claim.claim]
        if claim.claim == "C11":
            assert (row.known, row.closest) == (1, "second")
        elif isinstance(claim.limit, float | int):
            above = claim.relation == ">"
            assert row.closest == ("second" if above else "first")
            assert row.shortfall == pytest.approx(claim.limit - 3.0 if above else -2.0 - claim.limit)
        else:
            least, most = claim.limit
            assert row.shortfall == pytest.approx(min(max(least - v, v - most) for v in (-2.0, 3.0)))
    assert (table.holds == 0).all()
    assert (table.tried == 2).all()


def test_agreement_weighs_claims_and_not_statements():
    of = verdicts_of(np.zeros(len(CLAIMS), bool))
    of.loc[:3, "holds"] = True  # C1 and C2 whole
    of = pd.concat([of, of.iloc[[0]].assign(claim="C1 (c)", holds=False)])
    assert multiverse.agreement(of).mean() == pytest.approx((2 / 3 + 1) / 15)


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (["reconstruction", "--readings", "3"], "readings: 3; allowed"),
        (["reconstruction", "--confirm", "0"], "confirm: 0; allowed"),
        (["multiverse", "--confirm", "5"], "name: 'multiverse'; allowed: reconstruction, for which alone --confirm"),
        (["fig6", "--readings", "5"], "name: 'fig6'; allowed: multiverse or reconstruction"),
    ],
)
def test_bad_efforts_are_refused(flags, message, tmp_path, capsys):
    assert main(["run", *flags, "--smoke", "--episodes", "1", "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_the_usual_effort():
    assert effort_of(None, None, smoke=False) == Effort(304, 100, 3, 16)


def test_the_preset_best_is_the_published_best_reading():
    published = Path(__file__).parents[2] / "published" / "reconstruction"
    tried, confirmed = (pd.read_csv(published / f"{name}.csv") for name in ("tried", "confirmed"))
    (name,) = confirmed.reading[["all" in best_for.split() for best_for in confirmed.best_for]].unique()
    by_name = tried.set_index("reading")
    values = by_name.loc[name]
    assert by_name.agreement[confirmed.reading.unique()].max() == values.agreement
    own = set_in(preset_of("best"))
    manifests = list((published.parent / "best").glob("*.manifest.json"))
    assert manifests
    for manifest in manifests:
        assert json.loads(manifest.read_text())["configuration"]["preset"] == preset_of("best"), manifest
    assert set(own) == {reading.path for reading in READINGS}
    for path, value in own.items():
        assert float(values[path]) == value if isinstance(value, float) else values[path] == value
    source, target = (base_of(name, preset_of("best")) for name in ("source", "target"))
    assert target.points.hparams.loss == Loss.HUBER
    assert source.points.hparams.loss == Loss.SQUARED  # Table I's


@pytest.mark.slow
def test_a_tiny_search_runs_from_the_command_to_a_preset(tmp_path):
    run = ["run", "reconstruction", "--smoke", "--episodes", "1", "--out", str(tmp_path)]
    assert main(run) == 0
    preset_of(str(tmp_path / "reconstruction" / "summary" / reconstruction.PRESET_FILE))
    assert main([*run, "--resume"]) == 0
