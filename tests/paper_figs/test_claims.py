"""The claims in worlds whose truth is known: strict words, censoring, every point, sizes, few seeds."""

import dataclasses
import functools
import itertools
import json
import math

import numpy as np
import pytest
import worlds
from worlds import NEVER, Learner, study

from paper_figs.claims import effects, judge, table, words
from paper_figs.claims.delta import Delta
from paper_figs.claims.effects import EveryLead, HardlyMoves, MeanLead, Movement, RelativeLevel, Trend, TypicalEpisode
from paper_figs.claims.results import AXES, Agent, Results, Rules
from paper_figs.claims.table import CLAIMS, claims_of, claims_of_figure

COMPARED = (
    effects.EveryLead, effects.MeanLead, effects.LargestReduction, effects.EarlyLead, effects.Roughness,
    effects.EarlierConvergence, effects.HardlyMoves,
)  # fmt: skip
ABOUT_CONVERGENCE = (effects.LateGap, effects.TypicalEpisode, effects.EarlierConvergence)


def verdicts(judgements):
    return {judgement.claim: judgement.verdict for judgement in judgements}


def those(kinds):
    return {claim.claim for claim in CLAIMS if isinstance(claim.measure, kinds)}


def measured(effect, data, figure="fig6", rules=None):
    return effect(Results(data, AXES.get(figure), rules or Rules()))


def verdict_of(effect, data, relation=">", limit=0.0, figure="fig6"):
    _, low, high = measured(effect, data, figure).interval
    return str(judge.verdicts(low, high, relation, limit))


@functools.cache
def all_true():
    return claims_of(worlds.as_the_paper_says())


@functools.cache
def all_false():
    return claims_of(worlds.opposite())


# --- whole worlds -----------------------------------------------------------------------------------------------------


def test_in_a_world_as_the_paper_says_every_claim_is_supported():
    found = verdicts(all_true())
    assert {claim: verdict for claim, verdict in found.items() if verdict != "supported"} == {}
    assert {table.number_of(claim) for claim in found} == {f"C{number}" for number in range(1, 16)}


def test_in_the_opposite_world_every_claim_is_contradicted():
    found = verdicts(all_false())
    assert {claim: verdict for claim, verdict in found.items() if verdict != "contradicted"} == {}


@pytest.mark.parametrize("converges", [100, NEVER])
def test_learners_that_are_the_same_get_no_comparison_supported_and_are_negligibly_apart(converges):
    found = {j.claim: j for j in claims_of(worlds.indistinguishable(converges))}
    compared = those(COMPARED)
    assert len(compared) > 30
    assert [claim for claim in compared if found[claim].verdict == "supported"] == []
    apart = {claim: j.negligible for claim, j in found.items() if j.delta is not None}
    assert len(apart) > 15
    assert set(apart.values()) == {True}


def test_seeds_that_are_divided_leave_claims_undecided():
    true, false = (make(episodes=600) for make in (worlds.as_the_paper_says, worlds.opposite))
    found = {}
    for figure in ("fig5b", "fig9"):
        of_seeds = [name for name, values in true[figure].data_vars.items() if "seed" in values.dims]
        even = true[figure]["seed"] % 2 == 0
        mixed = {name: true[figure][name].where(even, false[figure][name]) for name in of_seeds}
        found |= verdicts(claims_of_figure(figure, true[figure].assign(mixed)))
    divided = ("C3 (TLwD)", "C3 (DPR)", "C4 (reward)", "C4 (steadiness)", "C15 (episodes)", "C15 (reward)")
    assert {claim: found[claim] for claim in divided} == dict.fromkeys(divided, "undecided")


# --- ties -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("relation", [">", "<"])
def test_a_tie_in_every_seed_supports_nothing_and_contradicts_nothing(relation):
    assert judge.verdicts(0.0, 0.0, relation, 0.0) == "undecided"


def test_one_seed_that_is_no_tie_does_not_make_ten_a_lead():
    data = study({"tlwd": Learner(1, 0.0, 0.0), "dpr": Learner(1, 0.0, 0.0)}, 4.0, "density", (1, 2), noise=0.0)
    data["reward"].loc[{"algorithm": "tlwd", "seed": 0}] += 1.0
    assert verdict_of(EveryLead("reward", "tlwd", ("dpr",)), data, figure="fig8") == "undecided"


def test_verdicts_of_arrays_are_those_of_numbers_and_bad_rules_are_refused():
    low, high = np.array([0.1, -2.0, -1.0, 0.0]), np.array([1.0, -1.0, 1.0, 1.0])
    wanted = ["supported", "contradicted", "undecided", "undecided"]
    assert judge.verdicts(low, high, ">", 0.0).tolist() == wanted
    assert judge.verdicts(-high, -low, "<", 0.0).tolist() == wanted
    assert judge.verdicts(low, high, "within", (0.0, 2.0)).tolist() == wanted
    with pytest.raises(ValueError, match="relation: '>='"):
        judge.verdicts(low, high, ">=", 0.0)
    with pytest.raises(ValueError, match=r"limit: 1\.0"):
        judge.verdicts(low, high, "within", 1.0)


# --- convergence ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("episodes", [20, 100, 450])
def test_where_nobody_converges_nothing_about_convergence_is_supported_or_contradicted(episodes):
    found = verdicts(claims_of(worlds.indistinguishable(NEVER, episodes=episodes)))
    assert {found[claim] for claim in those(ABOUT_CONVERGENCE)} == {"undecided"}


@pytest.mark.parametrize(
    ("episode", "about", "verdict"),
    [
        (3, 150, "contradicted"), (100, 150, "supported"), (210, 150, "supported"), (260, 150, "contradicted"),
        (150, 400, "contradicted"), (420, 400, "supported"), (NEVER, 400, "contradicted"),
    ],
)  # fmt: skip
def test_about_an_episode_is_a_band_that_never_does_not_lie_in(episode, about, verdict):
    data = study({"ddqn": Learner(episode, 0.5), "dpr": Learner(50, 0.5)}, 4.0)
    band = (0.5 * about, 1.5 * about)
    assert verdict_of(TypicalEpisode(Agent("ddqn")), data, "within", band, "fig5b") == verdict


def test_runs_that_end_before_the_band_leave_it_open():
    data = study({"ddqn": Learner(NEVER, 0.5), "dpr": Learner(50, 0.5)}, 4.0, episodes=300)
    value, low, high = measured(TypicalEpisode(Agent("ddqn")), data, "fig5b").interval
    assert (value, low, high) == (np.inf, 300, np.inf)
    assert judge.verdicts(low, high, "within", (200.0, 600.0)) == "undecided"


def test_faster_needs_runs_that_converge_and_much_faster_half_the_episodes():
    learners = {"tlwd": Learner(150, 0.5), "dpr": Learner(250, 0.5), "ddqn": Learner(400, 0.5)}
    found = verdicts(claims_of_figure("fig5b", study(learners, 4.0)))
    assert [found[f"C3 ({name}{part})"] for part in ("", ", much") for name in ("TLwD", "DPR")] == [
        "supported", "supported", "supported", "contradicted",
    ]  # fmt: skip


def test_the_curve_is_judged_beside_the_policy():
    data = study({"tlwd": Learner(100, 0.5), "ddqn": Learner(400, 0.5)}, 4.0)
    late = study({"tlwd": Learner(400, 0.5), "ddqn": Learner(100, 0.5)}, 4.0)
    found = verdicts(claims_of_figure("fig5b", data.assign(reward=late["reward"])))
    assert (found["C3 (TLwD)"], found["C3 (TLwD, curve)"]) == ("supported", "contradicted")
    assert (found["C3 (TLwD, about 100)"], found["C3 (TLwD, about 100, curve)"]) == ("supported", "contradicted")


# --- every point, trends, sizes ---------------------------------------------------------------------------------------


def test_a_rise_with_one_late_fall_is_no_rise():
    optimum = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 7.5])
    data = study({"tlwd": Learner(1, 0.0, 0.0)}, optimum, "high_speed_event_probability", worlds.TENTHS)
    assert data["reward"].mean("episode").values[0, -1, 0] > data["reward"].mean("episode").values[0, 0, 0]
    assert verdict_of(Trend("reward", "tlwd", 1.0), data) == "contradicted"
    assert verdict_of(Trend("reward", "tlwd", 1.0, high=0.8), data) == "supported"
    assert measured(Trend("reward", "tlwd", 1.0), data).held == "7 of 8 steps"


def test_highest_on_average_is_not_highest_and_says_at_how_many_points():
    ahead = np.array([0.0] * 8 + [0.3])
    learners = {"tlwd": Learner(1, ahead, ahead), "dpr": Learner(1, 0.1, 0.1), "ddqn": Learner(1, 0.2, 0.2)}
    data = study(learners, 4.0, "high_speed_event_probability", worlds.TENTHS)
    judgement = claims_of_figure("fig6", data)[0]
    assert (judgement.claim, judgement.verdict, judgement.held) == ("C5 (highest)", "contradicted", "8 of 9")


def test_every_point_needs_no_correction_to_be_supported():
    rng = np.random.default_rng(0)
    symmetric = np.linspace(-1.0, 1.0, 10) / np.linspace(-1.0, 1.0, 10).std(ddof=1)
    lead = 0.75 + np.stack([rng.permutation(symmetric) for _ in range(9)], axis=1)[:, :, None]
    data = study({n: Learner(1, 0.0, 0.0) for n in ("tlwd", "dpr")}, 4.0, "density", worlds.DENSITIES, noise=0.0,
                 episodes=4)  # fmt: skip
    data["reward"].loc[{"algorithm": "tlwd"}] += lead.transpose(1, 0, 2)
    # The mean is 2.4 standard errors: beyond Student's 2.26 at each point, within the limit for nine at once.
    assert verdict_of(EveryLead("reward", "tlwd", ("dpr",)), data, figure="fig8") == "supported"
    assert verdict_of(EveryLead("reward", "dpr", ("tlwd",)), data, figure="fig8") == "undecided"


@pytest.mark.parametrize(("gap", "slightly", "much"), [(0.05, True, False), (0.15, False, True)])
def test_slightly_has_an_upper_limit_and_much_a_lower_one(gap, slightly, much):
    learners = {"tlwd": Learner(1, 0.0, 0.0), "dpr": Learner(1, gap, gap), "ddqn": Learner(1, gap, gap)}
    data = study(learners, 4.0, "favourable_probability", worlds.TENTHS)
    found = verdicts(claims_of_figure("fig7", data))
    words_of = {True: "supported", False: "contradicted"}
    assert (found["C10 (DPR)"], found["C10 (DDQN)"]) == (words_of[slightly], words_of[much])


@pytest.mark.parametrize(
    ("own", "ddqns", "verdict"),
    [(1.03, 4.0, "supported"), (0.97, 4.0, "supported"), (8.0, 8.0, "contradicted"), (1.5, 9.0, "contradicted"),
     (1.1, 1.1, "contradicted"), (1.1, 1.0, "contradicted"), (1.0, 1.0, "undecided")],
)  # fmt: skip
def test_hardly_moving_is_about_the_own_movement(own, ddqns, verdict):
    learners = {
        "tlwd": Learner(1, 0.0, 0.0, throughput=worlds.late(85.0, 85.0 * own)),
        "ddqn": Learner(1, 0.0, 0.0, throughput=worlds.late(114.0, 114.0 * ddqns)),
    }
    data = study(learners, 4.0, "favourable_probability", worlds.TENTHS, noise=0.0, episodes=4)
    assert verdict_of(HardlyMoves("throughput", "tlwd", "ddqn", 0.9, 0.6, 0.2), data, figure="fig7") == verdict
    jump = RelativeLevel("throughput", "ddqn", 0.9, 0.6)
    np.testing.assert_allclose(measured(jump, data, "fig7").interval, ddqns)


def test_stable_is_about_movement_and_not_about_the_level():
    def movement(**how):
        return verdict_of(Movement(Agent("ddqn"), 400), study({"ddqn": Learner(1, **how)}, 4.0), "<", 0.05, "fig5a")

    assert movement(before=0.5, after=0.5) == "supported"
    assert movement(before=0.0, after=0.0, swing=0.2) == "contradicted"


@pytest.mark.parametrize(
    ("tolerance", "reached", "not_reached"),
    [(0.02, "contradicted", "supported"), (0.05, "supported", "supported"), (0.4, "supported", "contradicted")],
)
def test_what_counts_as_optimal_decides_who_reaches_the_optimum(tolerance, reached, not_reached):
    learners = {"ddqn": Learner(200, 0.5, after=0.033), "q_learning": Learner(200, 0.5, after=0.2)}
    quick = {"round_robin": Learner(1, 0.0, after=0.0)}  # so that somebody converges
    found = claims_of_figure("fig5a", study(learners | quick, 4.0, seeds=5), Rules(tolerance=tolerance))
    of = {j.claim: (j.verdict, j.limit) for j in found}
    assert of["C1 (reached)"] == (reached, tolerance)
    assert of["C2 (Q-learning, source)"] == (not_reached, tolerance)
    assert of["C1 (stable)"] == ("supported", 0.05)


def test_a_number_of_percent_is_what_rounds_to_it():
    found = {j.claim: j for j in all_true()}
    np.testing.assert_allclose([found["C14 (DPR)"].value, found["C14 (DDQN)"].value], [0.22, 0.61], atol=1e-3)
    assert found["C9"].limit == 0.665


# --- negligible, few seeds, missing points ----------------------------------------------------------------------------


@pytest.mark.parametrize(("lead", "wanted"), [(0.005, True), (0.02, False)])
def test_differences_within_delta_are_negligible_whatever_the_verdict(lead, wanted):
    data = study({"tlwd": Learner(1, 0.0, 0.0), "dpr": Learner(1, lead, lead)}, 4.0)
    judgement = next(j for j in claims_of_figure("fig5b", data) if j.claim == "C4 (reward)")
    assert (judgement.verdict, judgement.negligible, judgement.delta) == ("supported", wanted, 0.01)
    wide = claims_of_figure("fig5b", data, Rules(delta=Delta(reward=0.05)))
    assert next(j for j in wide if j.claim == "C4 (reward)").negligible


def test_convergence_ten_episodes_apart_is_negligible_and_censored_runs_are_not():
    of = lambda ddqn: study({"tlwd": Learner(100, 0.5), "ddqn": Learner(ddqn, 0.5)}, 4.0)  # noqa: E731
    found = [{j.claim: j for j in claims_of_figure("fig5b", of(e))}["C3 (TLwD)"] for e in (106, 120, NEVER)]
    assert [j.negligible for j in found] == [True, False, False]
    assert [j.verdict for j in found] == ["supported"] * 3


@pytest.mark.parametrize("seeds", [1, 4])
def test_with_fewer_than_five_seeds_there_are_estimates_and_no_verdicts(seeds):
    found = claims_of(worlds.as_the_paper_says(seeds=seeds, episodes=650))
    assert {j.verdict for j in found} == {"undecided"}
    assert {j.reason for j in found} == {f"{seeds} seeds, 5 needed for a verdict"}
    assert all(np.isnan([j.ci_low, j.ci_high]).all() for j in found)
    on_its_side = [judge.is_on_its_side(j.value, j.relation, j.limit) for j in found]
    assert all(on_its_side)


def test_points_that_are_missing_leave_the_claims_that_need_them_undecided():
    whole = worlds.as_the_paper_says()
    some = whole["fig7"].isel(point=[8, 2, 1])  # 0.9, 0.3, 0.2, in any order
    found = {j.claim: j for j in claims_of_figure("fig7", some)}
    assert found["C12 (throughput, DDQN)"].reason == "no point at tau_0 = 0.6"
    assert [found[claim].verdict for claim in ("C11", "C10 (fall, DPR)", "C10 (DPR)")] == ["supported"] * 3
    one = {j.claim: j for j in claims_of_figure("fig6", whole["fig6"].isel(point=[3]))}
    assert one["C5 (highest)"].reason == "1 points of p_1^v, 2 needed"
    none = claims_of({"fig9": whole["fig9"]})
    assert [j.reason for j in none if j.figure != "9"] == [
        f"no results of {claim.sweep}" for claim in CLAIMS if claim.figure != "9"
    ]


@pytest.mark.parametrize("episodes", [1000, 50])
def test_diverged_agents_of_a_figure_are_counted(episodes):
    data = worlds.as_the_paper_says(episodes=episodes)["fig9"]
    data["first_diverged"].loc[{"point": 1, "seed": [2, 5]}] = 3
    found = claims_of_figure("fig9", data)
    assert {j.n_diverged for j in found} == {2}
    assert any(math.isnan(j.value) for j in found) == (episodes == 50)  # of claims without a number, too


# --- the claims as data -----------------------------------------------------------------------------------------------


def test_every_claim_has_a_name_of_its_own_a_figure_and_a_title():
    names = [claim.claim for claim in CLAIMS]
    assert len(set(names)) == len(names)
    assert {claim.sweep for claim in CLAIMS} == {"fig5a", "fig5b", "fig6", "fig7", "fig8", "fig9"}
    assert list(table.TITLES) == list(dict.fromkeys(map(table.number_of, names)))
    for claim in CLAIMS:
        assert (claim.relation == "within") == isinstance(claim.limit, tuple)
        assert hasattr(claim.measure, "curve") == (", curve" in claim.claim or f"{claim.claim[:-1]}, curve)" in names)


def test_judgements_survive_json_and_never_is_no_number():
    few = worlds.as_the_paper_says(seeds=3, episodes=450)["fig5a"]
    found = [*claims_of_figure("fig5a", few), *all_false()]
    rows = json.loads(json.dumps(judge.as_json(found), allow_nan=False))
    assert {"claim", "statement", "verdict", "value", "ci_low", "ci_high", "n_seeds", "negligible"} <= set(rows[0])
    for before, after in zip(found, judge.from_json(rows), strict=True):
        np.testing.assert_equal(dataclasses.asdict(after), dataclasses.asdict(before))
    never = next(j for j in found if j.claim == "C1 (about 200)" and j.n_seeds == 10)
    assert words.measured(never) == "never (1000 to never)"
    assert words.criterion(never).endswith("converge between 100 and 300")


def test_what_is_not_known_of_any_pair_is_no_number_after_json():
    learners = {"tlwd": Learner(100, 0.5), "dpr": Learner(NEVER, 0.5), "ddqn": Learner(NEVER, 0.5)}
    found = {j.claim: j for j in claims_of_figure("fig5b", study(learners, 5.0, episodes=450))}
    before = found["C3 (DPR)"]
    assert math.isnan(before.value)
    assert (before.ci_low, before.ci_high) == (0.0, 1.0)
    (after,) = judge.from_json(json.loads(json.dumps(judge.as_json([before]), allow_nan=False)))
    np.testing.assert_equal(dataclasses.asdict(after), dataclasses.asdict(before))
    assert words.measured(after) == "–"


def test_an_interval_without_bounds_is_one_after_json():
    data = worlds.as_the_paper_says(seeds=5, episodes=450)["fig7"]
    data["throughput"].loc[{"algorithm": "ddqn"}] = np.array([0.0] * 4 + [500.0])[None, :, None]  # its mean may be 0
    before = {j.claim: j for j in claims_of_figure("fig7", data)}["C12 (throughput, DDQN)"]
    assert (before.value, before.ci_low, before.ci_high) == (1.0, -math.inf, math.inf)
    (after,) = judge.from_json(json.loads(json.dumps(judge.as_json([before]), allow_nan=False)))
    assert after == before
    assert words.measured(after) == "1 (no bound to no bound)"


def test_no_effect_depends_on_the_order_of_learners_points_or_seeds():
    for figure, data in worlds.as_the_paper_says(episodes=450).items():
        turned = data.isel(algorithm=slice(None, None, -1), point=slice(None, None, -1), seed=slice(None, None, -1))
        for a, b in zip(claims_of_figure(figure, data), claims_of_figure(figure, turned), strict=True):
            np.testing.assert_allclose([a.value, a.ci_low, a.ci_high], [b.value, b.ci_low, b.ci_high], rtol=1e-6)


def test_mean_leads_are_shares_of_the_optimum_of_their_points():
    learners = {"tlwd": Learner(1, 0.0, 0.0), "dpr": Learner(1, 0.04, 0.04)}
    data = study(learners, worlds.ramp(2.0, 10.0), "favourable_probability", worlds.TENTHS)
    np.testing.assert_allclose(measured(MeanLead("tlwd", "dpr", 0.7), data, "fig7").interval, 0.04, atol=1e-3)
    assert list(itertools.chain(Results(data, AXES["fig7"]).points(high=0.69))) == list(range(6))
