"""The Q-network in plain NumPy, double precision, with backpropagation and optimisers by hand."""

import itertools

import numpy as np

Layers = list[tuple[np.ndarray, np.ndarray]]


def all_features(shape) -> np.ndarray:
    """[F, S], from the definition of the state ids: the first factor is the most significant digit."""
    levels = np.array(list(itertools.product(*(range(size) for size in shape))), float)
    return (levels / np.maximum(np.array(shape) - 1, 1)).T


def layers_of(weights) -> Layers:
    """(W, b) of each layer in double precision."""
    layers = weights["params"]
    ordered = sorted(layers, key=lambda name: int(name.rsplit("_", 1)[1]))
    return [(np.asarray(layers[n]["kernel"], float), np.asarray(layers[n]["bias"], float)) for n in ordered]


def forward(layers: Layers, x: np.ndarray) -> list[np.ndarray]:
    """Activations of all layers, the input first, for columns x."""
    activations = [x]
    for i, (kernel, bias) in enumerate(layers):
        z = kernel @ activations[-1] + bias[:, None]
        activations.append(z if i == len(layers) - 1 else np.maximum(z, 0))
    return activations


def backward(layers: Layers, activations: list[np.ndarray], delta: np.ndarray) -> Layers:
    """Gradient with respect to the layers, from the one with respect to the last activations."""
    gradient = []
    for i in reversed(range(len(layers))):
        gradient.append((delta @ activations[i].T, delta.sum(axis=1)))
        delta = (layers[i][0].T @ delta) * (activations[i] > 0)
    return gradient[::-1]


def assert_same_gradient(got, wanted: Layers, relative: float):
    """A gradient of weights against one of layers, each array up to a share of its largest entry."""
    for got_layer, wanted_layer in zip(layers_of(got), wanted, strict=True):
        for g, w in zip(got_layer, wanted_layer, strict=True):
            np.testing.assert_allclose(g, w, rtol=0, atol=relative * np.abs(w).max())


def plain():
    """The step of equation (21)."""
    return lambda g: g


class Adam:
    """Kingma and Ba, Algorithm 1, without the step size."""

    def __init__(self):
        self.first, self.second, self.count = 0.0, 0.0, 0

    def __call__(self, g: np.ndarray) -> np.ndarray:
        self.count += 1
        self.first = 0.9 * self.first + 0.1 * g
        self.second = 0.999 * self.second + 0.001 * g**2
        first, second = self.first / (1 - 0.9**self.count), self.second / (1 - 0.999**self.count)
        return first / (np.sqrt(second) + 1e-8)


class Momentum:
    """Heavy ball with factor 0.9."""

    def __init__(self):
        self.velocity = 0.0

    def __call__(self, g: np.ndarray) -> np.ndarray:
        self.velocity = 0.9 * self.velocity + g
        return self.velocity


class Descent:
    """Weights that take steps against their gradients, `rule` for each array."""

    def __init__(self, layers: Layers, rule, rate: float):
        self.layers, self.rate = layers, rate
        self.rules = [(rule(), rule()) for _ in layers]

    def step(self, gradient: Layers):
        self.layers = [
            tuple(w - self.rate * rule(g) for w, rule, g in zip(*layer, strict=True))
            for layer in zip(self.layers, self.rules, gradient, strict=True)
        ]
