"""The model once more, in plain NumPy with 64-bit floats, loops and dense algebra.

Written from the equations, to be read beside them; slow, and shares no code with the package.
"""

from itertools import combinations, product

import numpy as np

C0 = 299_792_458.0
FACTORS = ("channel", "road", "weather", "speed", "nearby")


def random_description(seed):
    """Numbers of a valid environment, as a dictionary of dictionaries."""
    rng = np.random.default_rng(seed)
    described = {"reward_weights": rng.uniform(0.5, 60.0, 4), "event_model": seed % 3}
    for name in FACTORS:
        levels = int(rng.integers(2, 4))
        prior = rng.dirichlet(np.full(levels, 3.0))
        kappa = 0.0 if seed == 0 else float(rng.uniform(0.2, 0.8))
        described[name] = {"prior": prior, "persistence": kappa}
        if name == "channel":
            # SINRs near 100, 3 and 1 against thresholds 0.5, 2 and 20: each level decodes fewer rates.
            described[name] |= {
                "received_power": 1.0,
                "interference": np.array([0.0, 0.32, 0.9])[:levels],
                "noise": 0.01,
                "sinr_threshold": np.array([0.5, 2.0, 20.0]),
                "packets": np.sort(rng.uniform(1.0, 9.0, 3)),
            }
        else:
            described[name]["event_probability"] = rng.uniform(0.0, 0.3, levels)
    return described


class Model:
    """Tables of an environment, (1) to (11), as dense 64-bit arrays."""

    def __init__(self, params):
        f64 = lambda x: np.asarray(x, np.float64)  # noqa: E731
        self.factors = [getattr(params, name) for name in FACTORS]
        self.priors = [f64(f.prior) / f64(f.prior).sum() for f in self.factors]
        self.kappas = [float(f.persistence) for f in self.factors]
        self.shape = tuple(len(prior) for prior in self.priors)
        self.states = list(product(*map(range, self.shape)))  # the last factor counts fastest
        channel = params.channel
        self.weights = f64(params.reward_weights)
        self.miss_bank = f64(params.radar.miss_bank)
        self.num_rates = len(np.asarray(channel.packets))
        self.num_actions = self.num_rates + len(self.miss_bank)
        self.is_data = np.arange(self.num_actions) < self.num_rates
        self.event = np.array([self._event(levels, int(params.event_model)) for levels in self.states])
        self.packets = np.zeros((len(self.states), self.num_actions))
        for s, levels in enumerate(self.states):
            sinr = float(channel.received_power) / (float(channel.interference[levels[0]]) + float(channel.noise))
            for rate in range(self.num_rates):
                if sinr >= float(channel.sinr_threshold[rate]):
                    self.packets[s, rate] = float(channel.packets[rate])
        self.miss = np.array([1.0 if d else np.nan for d in self.is_data])
        self.miss[~self.is_data] = self.miss_bank.mean(axis=1)

    def _event(self, levels, reading):
        p = [np.asarray(f.event_probability, np.float64) for f in self.factors[1:]]
        now = [p_f[level] for p_f, level in zip(p, levels[1:], strict=True)]
        if reading == 0:
            return min(1.0, sum(now))
        if reading == 1:
            return min(1.0, sum(tau @ p_f for tau, p_f in zip(self.priors[1:], p, strict=True)))
        none = 1.0
        for p_f in now:
            none *= 1.0 - p_f
        return 1.0 - none

    def transition(self):
        """P(s' | s), [S, S], one entry after the other."""
        matrix = np.ones((len(self.states), len(self.states)))
        for (i, old), (j, new) in product(enumerate(self.states), repeat=2):
            for tau, kappa, a, b in zip(self.priors, self.kappas, old, new, strict=True):
                matrix[i, j] *= kappa * (a == b) + (1.0 - kappa) * tau[b]
        return matrix

    def reward(self, is_data, event, packets, miss):
        """Equation (11) for one slot."""
        rho_1, rho_2, rho_3, rho_4 = self.weights
        if is_data:
            return -rho_2 if event else rho_1 * packets
        return rho_4 * (1.0 - miss) if event else -rho_3

    def expected_reward(self):
        """E[rho | s, a], [S, A]."""
        table = np.zeros((len(self.states), self.num_actions))
        for s, a in product(range(len(self.states)), range(self.num_actions)):
            for event, p in ((True, self.event[s]), (False, 1.0 - self.event[s])):
                table[s, a] += p * self.reward(self.is_data[a], event, self.packets[s, a], self.miss[a])
        return table

    def reward_variance(self):
        """Var[rho | s, a] over events and placements, [S, A]."""
        second = np.zeros((len(self.states), self.num_actions))
        for s, a in product(range(len(self.states)), range(self.num_actions)):
            ratios = [1.0] if self.is_data[a] else self.miss_bank[a - self.num_rates]
            for event, p in ((True, self.event[s]), (False, 1.0 - self.event[s])):
                rewards = [self.reward(self.is_data[a], event, self.packets[s, a], ratio) for ratio in ratios]
                second[s, a] += p * np.mean(np.square(rewards))
        return second - self.expected_reward() ** 2


def stationary(matrix):
    """The law that `matrix` keeps, from its linear equations."""
    n = len(matrix)
    equations = np.vstack([matrix.T - np.eye(n), np.ones(n)])
    return np.linalg.lstsq(equations, np.append(np.zeros(n), 1.0), rcond=None)[0]


def policy_iteration(transition, rewards, gamma):
    """Q* [S, A] by policy iteration; `transition` is [S, A, S]."""
    n = len(rewards)
    actions = np.zeros(n, int)
    while True:
        own = np.arange(n)
        values = np.linalg.solve(np.eye(n) - gamma * transition[own, actions], rewards[own, actions])
        q = rewards + gamma * transition @ values
        if (q.max(axis=1) <= q[own, actions] + 1e-10).all():
            return q
        actions = q.argmax(axis=1)


def gaps(centre, size, distance):
    """Distance of each pair of objects, [N, N], in one of three measures; infinite from an object to itself."""
    centre, size = np.asarray(centre, np.float64), np.asarray(size, np.float64)
    if distance == "radial_range":
        radius = np.sqrt((centre**2).sum(axis=1))
        gap = np.abs(radius[:, None] - radius[None, :])
    else:
        between = np.abs(centre[:, None, :] - centre[None, :, :])
        if distance == "footprint_gap":
            between = np.maximum(between - (size[:, None, :] + size[None, :, :]) / 2.0, 0.0)
        gap = np.sqrt((between**2).sum(axis=2))
    np.fill_diagonal(gap, np.inf)
    return gap


def detected(gap, resolution, rule):
    """N_k: objects farther than the resolution from all others, or clusters of merged ones."""
    if rule == "resolved":
        return int((gap > resolution).all(axis=1).sum())
    parent = list(range(len(gap)))

    def root(i):
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    for i, j in zip(*np.nonzero(np.triu(gap <= resolution)), strict=True):
        parent[root(i)] = root(j)
    return len({root(i) for i in range(len(gap))})


def detected_by_loops(centre, size, resolution):
    """As `detected` with footprints and the resolved rule, without any array."""
    merged = set()
    for i, j in combinations(range(len(centre)), 2):
        gap = [max(abs(centre[i][d] - centre[j][d]) - (size[i][d] + size[j][d]) / 2, 0.0) for d in (0, 1)]
        if (gap[0] ** 2 + gap[1] ** 2) ** 0.5 <= resolution:
            merged |= {i, j}
    return len(centre) - len(merged)


def simulated_miss_ratios(rng, omega, reach, resolution, placements):
    """p_k of `placements` independent placements: 20 cars to 7 pedestrians, uniform in a square of side `reach`."""
    count = round(omega * (reach / 45.0) ** 2)
    cars = round(count * 20 / 27)
    ratios = []
    for _ in range(placements):
        centre = rng.uniform((0.0, -reach / 2), (reach, reach / 2), (count, 2))
        of_cars = rng.normal((4.62, 1.92), (0.18, 0.08), (cars, 2))
        of_pedestrians = rng.normal((0.73, 0.68), (0.085, 0.055), (count - cars, 2))
        size = np.concatenate([of_cars, of_pedestrians])
        ratios.append((count - detected(gaps(centre, size, "footprint_gap"), resolution, "resolved")) / count)
    return np.array(ratios)
