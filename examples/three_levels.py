"""An environment of your own, from a file: trains Double DQN on it and draws its learning beside the exact optimum.

    .venv/bin/python examples/three_levels.py --out three_levels.png

`--params` takes any other file; see `three_levels.toml` beside this one.
"""

from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np
import tyro
from matplotlib.figure import Figure

import jrcjax
import jrcjax.training.parallel

FILE = Path(__file__).with_suffix(".toml")


@dataclass(frozen=True)
class Arguments:
    """Double DQN on the environment of a file, against the exact optimum."""

    params: Path = FILE
    """The environment."""
    episodes: int = 300
    """Episodes per seed."""
    seeds: int = 8
    """Agents."""
    out: Path = Path("three_levels.png")
    """The picture."""


@jax.jit
def best_of(params: jrcjax.EnvParams) -> jrcjax.exact.LongRun:
    """Long-run means per slot of the optimal policy."""
    return jrcjax.exact.evaluate_policy(params, jrcjax.exact.optimal_policy(params))


def main(args: list[str] | None = None) -> None:
    """Trains, solves, draws."""
    given = tyro.cli(Arguments, args=args)
    params = jrcjax.load_params(given.params)
    config = jrcjax.Config(episodes=given.episodes)
    form = "the table of all states" if config.uses_table(params.num_states) else "the rows of a mini-batch"
    print(f"{params.num_states} states, {params.num_actions} actions; the loss is computed on {form}")

    optimum = best_of(params)
    keys = jax.random.split(jax.random.key(0), given.seeds)
    _, log = jrcjax.train_agents(keys, params, learner="ddqn", config=config)
    learned = np.asarray(log.policy_reward)  # [seeds, episodes], exact and without exploration
    print(
        f"optimum {float(optimum.reward):.3f} per slot; learned {learned[:, -20:].mean():.3f} in the last 20 episodes"
    )

    figure = Figure(figsize=(6, 3.6), layout="constrained")
    axes = figure.subplots()
    episode = 1 + np.arange(given.episodes)
    axes.plot(episode, learned.T, color="#0072B2", linewidth=0.5, alpha=0.35)
    axes.plot(episode, learned.mean(axis=0), color="#0072B2", label=f"DDQN's policy, mean of {given.seeds} seeds")
    axes.axhline(float(optimum.reward), color="black", linestyle="--", label="optimum (exact)")
    axes.set(xlabel="episode", ylabel="long-run reward per slot")
    axes.legend(loc="lower right")
    figure.savefig(given.out, dpi=150)


if __name__ == "__main__":
    jrcjax.training.parallel.use_all_cores()
    main()
