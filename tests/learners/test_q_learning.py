"""Q-learning against a naive twin, and against the solver's optimum; Round Robin against the exact uniform policy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import linalg, stats
from significance import mean_differs

import jrcjax
from jrcjax import exact
from jrcjax.learners import Spec, q_learning, round_robin
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model import events
from jrcjax.model.params import EnvParams, Factor
from jrcjax.replay.uniform import Transition
from jrcjax.training import parallel, rollout

SPEC = Spec(shape=(3, 2, 2), num_actions=4, episode_slots=300)
NUM_STATES = 12


def hparams_of(**numbers: float) -> HParams:
    return HParams(**{name: jnp.float32(number) for name, number in numbers.items()})


# --- One update -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("exponent", "constant"), [(0.7, 0.0), (1.0, 0.0), (0.55, 0.0), (0.7, 0.1), (0.7, 1.0)])
def test_updates_against_equation_13(exponent, constant):
    learner, hparams = q_learning(SPEC, Config()), hparams_of(step_exponent=exponent, step_constant=constant)
    generator = np.random.default_rng(0)
    state = learner.init(jax.random.key(0), hparams)
    q, visits = np.zeros((NUM_STATES, 4)), np.zeros((NUM_STATES, 4), int)
    update = jax.jit(learner.update)
    for i in range(300):
        s, a, following = generator.integers(0, NUM_STATES, 3) % (NUM_STATES, 4, NUM_STATES)
        reward, terminal = float(np.float32(generator.normal(0, 10))), int(generator.uniform() < 0.2)
        transition = Transition(
            np.int32(s), np.int32(a), np.float32(reward), np.int32(following), np.float32(0.0 if terminal else 0.99)
        )
        state = update(state, transition, i, jnp.zeros(0, jnp.uint32), hparams)
        visits[s, a] += 1
        step = constant or visits[s, a] ** -exponent
        bootstrap = 0.0 if terminal else 0.99 * max(q[following])
        q[s, a] += step * (reward + bootstrap - q[s, a])
    np.testing.assert_array_equal(state.visits, visits)
    # Every update rounds a number below 100 a few times (6e-8 relative each) and forgets a part of what was there.
    np.testing.assert_allclose(state.q, q, rtol=0, atol=300 * 3 * 6e-8 * 100)
    assert np.abs(q).max() > 5


def test_starts_at_zero_whatever_the_key():
    learner = q_learning(SPEC, Config())
    for seed in range(3):
        state = learner.init(jax.random.key(seed), HParams())
        assert state.q.shape == state.visits.shape == (NUM_STATES, 4)
        assert not np.any(state.q)
        assert not np.any(state.visits)


def test_actions_are_greedy_but_for_a_share_of_epsilon():
    learner, hparams = q_learning(SPEC, Config()), hparams_of(epsilon_start=0.6, epsilon_end=0.6)
    state = learner.init(jax.random.key(0), hparams)
    state = state._replace(q=state.q.at[5].set(jnp.asarray([0.0, 3.0, 7.0, -1.0])))
    words = jax.random.bits(jax.random.key(1), (20_000, 2), jnp.uint32)
    actions = jax.vmap(learner.act, in_axes=(None, None, None, 0, None))(state, jnp.int32(5), 0, words, hparams)
    shares = np.array([0.15, 0.15, 0.55, 0.15])
    assert stats.chisquare(np.bincount(actions, minlength=4), shares * len(words)).pvalue > 1e-3
    np.testing.assert_array_equal(learner.policy(state)[5], [0, 0, 1, 0])


# --- Convergence to the solver's Q* -----------------------------------------------------------------------------------


def environment(levels: int, persistence: float) -> EnvParams:
    """Every factor at each of its levels equally often, so that all states are visited; milder rewards than Table I's.

    Args:
      levels: of road, weather and speed; channel and nearby vehicles have two.
      persistence: of channel, road and nearby vehicles.
    """
    params = jrcjax.paper_params("target")
    prior = [1.0 / levels] * levels
    return params.replace(
        channel=params.channel.replace(prior=jnp.full(2, 0.5), persistence=jnp.float32(persistence)),
        road=Factor(prior=prior, event_probability=[0.05, 0.2][:levels], persistence=persistence),
        weather=Factor(prior=prior, event_probability=[0.02, 0.1][:levels]),
        speed=Factor(prior=prior, event_probability=[0.01, 0.3][:levels]),
        nearby=Factor(prior=[0.5, 0.5], event_probability=[0.03, 0.25], persistence=persistence),
        reward_weights=jnp.asarray([1.0, 10.0, 1.0, 5.0]),
        max_steps_in_episode=1000,
    )


def reward_variance(params: EnvParams) -> np.ndarray:
    """Variance of the reward of one slot, [S, A], from event and placement."""
    p = np.asarray(events.event_probability(params), float)[:, None]
    packets, bank = np.asarray(exact.packet_table(params), float), np.asarray(params.radar.miss_bank, float)
    rho = np.asarray(params.reward_weights, float)
    on_radar = rho[3] * (1 - bank)
    rates = params.num_rates
    event_mean = np.concatenate([np.full(rates, -rho[1]), on_radar.mean(axis=1)])
    event_square = np.concatenate([np.full(rates, rho[1] ** 2), (on_radar**2).mean(axis=1)])
    quiet = rho[0] * packets + np.where(np.arange(params.num_actions) < rates, 0.0, -rho[2])
    return p * event_square + (1 - p) * quiet**2 - (p * event_mean + (1 - p) * quiet) ** 2


def standard_deviation(params: EnvParams, q: np.ndarray, gamma: float, step: float, slowing: float) -> np.ndarray:
    """Standard deviation of Q-learning around Q* once the start is forgotten, [S, A].

    Near Q* the greedy policy is fixed and an update is linear, e <- e + step (B e + noise) with B = gamma P - I; P
    leads from (s, a) to (s', best a'). For small steps the covariance C of e solves B C + C B' + step N = 0 with the
    noise's variances on the diagonal of N. Steps that fall as n^-x add slowing I to B, slowing = x / (2 n step).
    """
    states, actions = q.shape
    transition = np.asarray(exact.state_transition(params), float)
    value = q.max(axis=1)
    noise = reward_variance(params) + gamma**2 * (transition @ value**2 - (transition @ value) ** 2)[:, None]
    to_best = np.zeros((states, states * actions))
    to_best[np.arange(states), np.arange(states) * actions + q.argmax(axis=1)] = 1
    drift = gamma * np.repeat(transition @ to_best, actions, axis=0) - (1 - slowing) * np.eye(states * actions)
    covariance = linalg.solve_continuous_lyapunov(drift, -step * np.diag(noise.ravel()))
    return np.sqrt(np.diag(covariance)).reshape(q.shape)


CHUNK, CHUNKS, SEEDS = 2, 50, 16


def learn(params: EnvParams, hparams: HParams) -> np.ndarray:
    """Q after each chunk of CHUNK episodes of uniform exploration, [CHUNKS, SEEDS, S, A]."""
    rule = rollout.learner_for("q_learning", params, Config())

    def run(shared, key):
        def chunk(agent, i):
            agent, _ = rollout.run_episodes(agent, i * CHUNK, CHUNK, *shared, rule)
            return agent, agent.learner.q

        return jax.lax.scan(chunk, rollout.init_agent(key, shared[1], rule), jnp.arange(CHUNKS))[1]

    keys = jax.random.split(jax.random.key(0), parallel.padded(SEEDS))
    q = parallel.over_agents(run)((params, hparams), keys)
    return np.asarray(q, float)[:SEEDS].swapaxes(0, 1)


@pytest.mark.parametrize(
    ("levels", "persistence", "gamma", "exponent", "constant"),
    [
        (1, 0.0, 0.9, 0.6, 0.0),
        (1, 0.8, 0.8, 0.7, 0.0),
        (1, 0.8, 0.8, 0.7, 0.01),
        (2, 0.8, 0.5, 0.7, 0.0),
    ],
)
@pytest.mark.slow
def test_converges_to_the_solvers_values(levels, persistence, gamma, exponent, constant):
    params = environment(levels, persistence)
    hparams = hparams_of(discount=gamma, epsilon_end=1.0, step_exponent=exponent, step_constant=constant)
    best = np.asarray(exact.value_iteration(params, gamma), float)
    errors = learn(params, hparams) - best
    visits = CHUNK * CHUNKS * params.max_steps_in_episode / best.size  # of each entry, all being equally likely
    step = constant or visits**-exponent
    deviation = standard_deviation(params, best, gamma, step, 0.0 if constant else exponent / (2 * visits * step))
    z = errors[-1] / deviation
    # If normal, one of at most 2048 entries exceeds 5.5 with probability 8e-5. Errors of one seed may all be the same,
    # so the mean of squares has at least 16 degrees of freedom: outside the limits with probability 2e-3.
    assert np.abs(z).max() < 5.5
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.6
    # What is allowed is small beside the values, and it was approached.
    assert 5.5 * deviation.max() < np.ptp(best) / 2
    largest = np.abs(errors).max(axis=(2, 3)).mean(axis=1)
    assert largest[0] > largest[4] > largest[-1]


# --- Round Robin ------------------------------------------------------------------------------------------------------


def test_round_robin_takes_all_actions_in_turn():
    learner = round_robin(Spec(shape=(3, 2), num_actions=5, episode_slots=300), Config())
    actions = [int(learner.act((), jnp.int32(3), jnp.int32(t), jnp.zeros(0, jnp.uint32), HParams())) for t in range(12)]
    assert actions == [0, 1, 2, 3, 4, 0, 1, 2, 3, 4, 0, 1]
    np.testing.assert_array_equal(learner.policy(()), np.full((6, 5), np.float32(0.2)))


@pytest.mark.parametrize("name", ["source", "target"])
def test_round_robin_earns_what_the_uniform_policy_earns(name):
    """16 x 100 independent episodes; a t-test of each metric's mean at the level 1e-4."""
    params = jrcjax.paper_params(name)
    train = jax.vmap(lambda k: jrcjax.train(k, params, learner="round_robin", config=Config(episodes=100))[1])
    log = jax.jit(train)(jax.random.split(jax.random.key(3), 16))
    wanted = exact.evaluate_policy(params, jnp.full((32, 4), 0.25))
    slots = params.max_steps_in_episode
    for got, mean in [
        (log.reward, wanted.reward),
        (log.throughput / slots, wanted.throughput),
        (log.miss_detection, wanted.miss_detection),
    ]:
        assert mean_differs(np.asarray(got, float).ravel(), float(mean)) > 1e-4
    np.testing.assert_allclose(log.policy_reward, wanted.reward, rtol=1e-5)
