"""The tables and numbers that the README quotes, from the folder that `make figures` wrote.

Run as `python -m paper_figs.readme [OUT]`.
"""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import pandas as pd
import xarray as xr

from jrcjax import exact
from jrcjax.learners.hparams import Config, HParams
from jrcjax.model.presets import paper_params
from jrcjax.training import parallel
from jrcjax.training.transfer import transfer
from paper_figs.__main__ import results_folder
from paper_figs.analysis.convergence import TOLERANCE, convergence_episode, gaps
from paper_figs.analysis.statistics import CONFIDENCE
from paper_figs.claims.judge import first
from paper_figs.claims.learning_claims import source_claims
from paper_figs.figures import FIGURES
from sweeps.results import store
from sweeps.studies.ablation import VARIANTS
from sweeps.sweep import Size

MULTIVERSE = Path(__file__).parent / "multiverse"
"""Summary of a multiverse that the README rests on."""


def claims_table(claims: list[dict], figure: str) -> str:
    """Verdicts that rest on one figure, "5a" or "6" with all its panels, as a Markdown table."""
    head = ("claim", "the paper's statement", "holds if", "measured (95 % interval)", "verdict")
    rows = [head, ("---",) * len(head)]
    for c in claims:
        if not c["figure"].startswith(figure):
            continue
        criterion = f"{c['effect']} {c['relation']} {c['limit']:g}"
        measured = f"{c['value']:.3g} ({c['ci_low']:.3g} to {c['ci_high']:.3g})"
        rows.append((c["claim"], c["statement"], criterion, measured, c["verdict"]))
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def standing(verdict: str, supported: float) -> str:
    """Where a claim holds: by its verdict under the default readings, and the share of universes that support it.

    By chance alone a false claim is supported in up to 2.5 % of universes, so a share of up to 5 % is nowhere.
    """
    if verdict == "supported":
        return "by default"
    return "only under other readings" if supported > 1 - CONFIDENCE else "nowhere"


def readings_table(claims: list[dict], shares: pd.DataFrame) -> str:
    """Where each claim holds, as a Markdown table: the default verdicts, and those in the universes of a multiverse."""
    head = ("claim", "by default", "supported", "contradicted", "undecided", "estimate holds", "decided by", "holds")
    rows = [head, ("---",) * len(head)]
    by_claim = shares.set_index("claim")
    for c in claims:
        share = by_claim.loc[c["claim"]]
        of_each = [f"{share[part]:.0%}" for part in ("supported", "contradicted", "undecided", "holds")]
        deciding = "" if pd.isna(share["decided_by"]) else "; ".join(share["decided_by"].split("; ")[:2])
        about = (deciding.replace("_", " "), standing(c["verdict"], share["supported"]))
        rows.append((c["claim"], c["verdict"], *of_each, *about))
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def quoted_of_source(data: xr.Dataset) -> dict[str, str]:
    """The single numbers in the text about Fig. 5(a)."""
    params = paper_params("source")
    best = exact.optimal_policy(params)
    epsilon = float(HParams().epsilon_end)
    explored = (1 - epsilon) * best + epsilon / params.num_actions
    optimum, constant = (float(data[f"{name}_reward"].isel(point=0)) for name in ("optimum", "constant"))
    ddqn = gaps(data, "ddqn")
    late = ddqn[:, 400:]
    numbers = {
        "optimal reward per slot": optimum,
        "optimal reward per slot with exploration": float(exact.evaluate_policy(params, explored).reward),
        "reward per slot of the best constant action": constant,
        "its gap": 1 - constant / optimum,
        "states in which the optimum transmits": float(best[:, : params.num_rates].sum()),
        "mean optimal value of a state at discount 0.99": float(exact.value_iteration(params).max(axis=1).mean()),
        "mean gap of DDQN, episodes 51 to 100": float(ddqn[:, 50:100].mean()),
        "mean gap of DDQN after episode 400": float(late.mean()),
        f"share of DDQN's snapshots after episode 400 with a gap above {TOLERANCE}": float((late > TOLERANCE).mean()),
    }
    words = {name: f"{value:.3g}" for name, value in numbers.items()}
    for tolerance in (0.01, 0.03, 0.05):
        verdicts = [f"{c.claim} {c.verdict}" for c in source_claims(data, tolerance)[:3]]
        words[f"verdicts if within {tolerance:.0%} is optimal"] = ", ".join(verdicts)
    for seed in range(5):
        radar = params.radar.replace(bank_seed=jnp.int32(seed))  # pyright: ignore[reportAttributeAccessIssue]
        other = dataclasses.replace(params, radar=radar)
        reward = exact.evaluate_policy(other, exact.optimal_policy(other)).reward
        words[f"optimal reward with bank seed {seed}"] = f"{float(reward):.3f}"
    return words


def quoted_of_target(data: xr.Dataset) -> dict[str, str]:
    """The single numbers in the text about Fig. 5(b)."""
    optimum, constant = (float(data[f"{name}_reward"].isel(point=0)) for name in ("optimum", "constant"))
    numbers = {"optimal reward per slot": optimum, "gap of the best constant action": 1 - constant / optimum}
    for name in ("tlwd", "dpr", "ddqn", "q_learning"):
        gap = gaps(data, name)
        numbers |= {
            f"mean gap of {name} after its first episode": float(gap[:, 0].mean()),
            f"mean gap of {name}, episodes 51 to 100": float(gap[:, 50:100].mean()),
            f"mean gap of {name} after episode 400": float(gap[:, 400:].mean()),
            f"packets per episode of {name}": float(first(data, "throughput", name).mean()),
            f"miss detection of {name}": float(first(data, "miss_detection", name).mean()),
        }
    words = {name: f"{value:.3g}" for name, value in numbers.items()}
    for name in ("tlwd", "dpr", "ddqn"):
        words[f"convergence episodes of {name}"] = ", ".join(
            f"{e:.0f}" for e in sorted(convergence_episode(data, name))
        )
    return words


def quoted_of_ablation(data: xr.Dataset) -> dict[str, str]:
    """What TLwD reaches with parts left out."""
    return {
        name: f"mean gap after its first episode {gaps(data, 'tlwd', point)[:, 0].mean():.3g}, "
        f"after episode 400 {gaps(data, 'tlwd', point)[:, 400:].mean():.3g}"
        for point, name in enumerate(VARIANTS)
    }


def quoted_of_demonstrations(seeds: int = 16, episodes: int = 300) -> dict[str, str]:
    """How good TLwD gets in the target with demonstrations from the source, and with demonstrations from the target."""
    target, config = paper_params("target"), Config(episodes=episodes)
    optimum = exact.evaluate_policy(target, exact.optimal_policy(target)).reward

    def policy_reward(environments, key):
        done = transfer(key, *environments, config=config, learners=("tlwd",))
        return done.logs["tlwd"].policy_reward[episodes // 2 :].mean()

    run = parallel.over_agents(policy_reward)
    keys = jax.random.split(jax.random.key(0), parallel.padded(seeds))
    gap = {
        f"demonstrations from the {name}": 1 - float(run((source, target), keys)[:seeds].mean() / optimum)
        for name, source in (("source", paper_params("source")), ("target", target))
    }
    return {name: f"mean gap in episodes {episodes // 2 + 1} to {episodes} {value:.3g}" for name, value in gap.items()}


def main() -> int:
    """Prints the tables and the numbers; returns the exit status."""
    parallel.use_all_cores()
    parallel.keep_compiled()
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    try:
        claims = json.loads((out / "claims.json").read_text())
        folder = results_folder(out, Size())
        source, target = (store.load(folder / name, claims[0]["n_seeds"]) for name in ("fig5a", "fig5b"))
    except OSError as error:
        print(f"error: {error}; run `make figures` first", file=sys.stderr)
        return 2
    for figure in FIGURES:
        print(f"\n{figure.title}\n\n{claims_table(claims, figure.name.removeprefix('fig'))}")
    if (MULTIVERSE / "claims.csv").exists():
        print(f"\nunder other readings\n\n{readings_table(claims, pd.read_csv(MULTIVERSE / 'claims.csv'))}")
    sections = {"in the source": quoted_of_source(source), "in the target": quoted_of_target(target)}
    if (folder / "ablation").exists():
        sections["TLwD with parts left out"] = quoted_of_ablation(store.load(folder / "ablation", Size().seeds))
    sections["TLwD, 16 seeds x 300 episodes"] = quoted_of_demonstrations()
    for title, numbers in sections.items():
        print(f"\n{title}")
        for name, value in numbers.items():
            print(f"{name}: {value}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
