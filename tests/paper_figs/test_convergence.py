"""Where runs arrive and stay, runs that never do, and what a learner's last policy is worth."""

import numpy as np
import pytest
import worlds
from worlds import NEVER, Learner

from paper_figs.analysis import convergence, regret
from paper_figs.analysis.convergence import arrivals, convergence_episode, sample_complexity


def arrival_twin(gap, tolerance):
    """The definition word by word, one run at a time."""
    windows = [np.mean(gap[e : e + 20]) <= tolerance for e in range(len(gap) - 19)]
    for e, within in enumerate(windows):
        if within and len(windows) - e > 20 and np.mean(windows[e:]) >= 0.95:
            return e + 1.0
    return np.inf


def test_arrivals_are_those_of_the_definition():
    rng = np.random.default_rng(1)
    steps = np.cumsum(rng.normal(-0.0005, 0.01, (40, 300)), axis=1)
    gap = np.abs(0.1 + steps) + 0.02 * rng.standard_normal((40, 300))
    wanted = [arrival_twin(run, 0.05) for run in gap]
    assert 5 < np.isfinite(wanted).sum() < 35
    np.testing.assert_array_equal(arrivals(gap), wanted)


@pytest.mark.parametrize("episodes", [1, 19, 20, 39, 100])
def test_a_run_that_never_converges_has_no_episode(episodes):
    assert np.isinf(arrivals(np.full((3, episodes), 0.5))).all()
    assert np.isinf(arrivals(np.full((3, min(episodes, 39)), 0.0))).all()  # too short to show that it stays


def test_passing_by_is_not_arriving():
    gap = np.full((1, 1000), 0.6)
    gap[:, 100:200] = 0.0  # within for a while, then lost again
    assert np.isinf(arrivals(gap))
    gap[:, 300:] = 0.0
    assert arrivals(gap) == 300  # in the window from 300 on one episode of 20 has a gap of 0.6: 3 %
    gap[:, 400:402] = 0.6  # a short relapse, in less than 5 % of all later windows
    assert arrivals(gap) == 300


def test_policy_and_curve_converge_each_by_its_own_gap():
    data = worlds.study({"ddqn": Learner(300, 0.5), "tlwd": Learner(100, 0.5)}, 4.0, episodes=600)
    other = worlds.study({"ddqn": Learner(50, 0.5), "tlwd": Learner(NEVER, 0.5)}, 4.0, episodes=600)
    data = data.assign(reward=other["reward"])
    assert abs(np.median(convergence_episode(data, "ddqn")) - 300) < 2
    assert abs(np.median(convergence_episode(data, "ddqn", curve=True)) - 50) < 2
    assert np.isinf(convergence_episode(data, "tlwd", curve=True)).all()


def test_the_optimal_policys_own_curve_converges_at_once_however_it_scatters():
    data = worlds.study({"best": Learner(1, 0.0, 0.0), "bad": Learner(1, 0.4, 0.4)}, 4.0, noise=0.8)
    # A window's mean scatters by 0.8 / 4 / sqrt(20) = 4.5 % of the optimum: half of all runs would leave 5 % too often.
    assert (convergence_episode(data, "best", curve=True) <= 20).all()
    assert np.isinf(convergence_episode(data, "bad", curve=True)).all()
    np.testing.assert_allclose(
        convergence.chance_of_a_window(convergence.curve_gaps(data, "best")), 1.645 * 0.2 / np.sqrt(20), rtol=0.1
    )


def never_and_at(*converged, episodes=200):
    """Results of one learner whose seeds converge in these episodes (from 1), or never (None)."""
    data = worlds.study({"ddqn": Learner(1, 0.0)}, 4.0, seeds=len(converged), episodes=episodes)
    gap = np.array([np.where(np.arange(1, episodes + 1) >= (e or episodes + 1), 0.0, 10.0) for e in converged])
    return data.assign(policy_reward=(data["policy_reward"].dims, 4.0 * (1 - gap)[None, None]))


def test_sample_complexity_counts_runs_that_never_converge_and_does_not_call_them_late():
    sample = sample_complexity(never_and_at(10, 10, 30, None, None), "ddqn")
    # 19 of 20 episodes of a window are not enough: a gap of 10 in one of them averages 50 %.
    np.testing.assert_array_equal(sample.episodes, [10, 30])
    np.testing.assert_allclose(sample.share.value, [0.4, 0.6])
    assert (sample.median.value, sample.median.high) == (30, np.inf)
    assert sample.reached.value == 0.6
    none = sample_complexity(never_and_at(None, None, 190), "ddqn")
    assert none.reached.value == 0.0  # nobody sees whether the last one stays
    assert none.median.value == np.inf


def test_episodes_before_convergence_rank_runs_and_are_all_where_there_is_none():
    data = never_and_at(10, 30, None)
    np.testing.assert_array_equal(convergence.episodes_before(data, "ddqn"), [9, 29, 200])


@pytest.mark.parametrize("slots", [300, 50])
def test_regret_is_the_optimum_less_the_last_policys_reward(slots):
    data = never_and_at(10, 10, 30)
    data["policy_reward"][..., -1] = [3.0, 3.5, 4.0]
    data = data.assign(reward=data["reward"] * 0 + 1.0)
    row = regret.table(data, "5", slots).iloc[0]
    assert (row.regret, row.policy_reward, row.simulated_regret) == (0.5, 3.5, 3.0)
    np.testing.assert_allclose(row.simulated_throughput, 100 / slots, rtol=1e-4)
    assert (row.n_seeds, row.median_episodes, row.reached) == (3, 10, 1.0)
