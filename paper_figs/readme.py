"""The numbers that the README quotes, from the folder that `make figures` wrote.

Run as `python -m paper_figs.readme [OUT]`.
"""

from __future__ import annotations

import dataclasses
import json
import sys
from pathlib import Path

import jax.numpy as jnp
import xarray as xr

from jrcjax import exact
from jrcjax.hparams import HParams
from jrcjax.presets import paper_params
from paper_figs.__main__ import results_folder
from paper_figs.claims import TOLERANCE, gaps, source_claims
from sweeps import store
from sweeps.sweep import Size


def claims_table(claims: list[dict]) -> str:
    """Verdicts as a Markdown table."""
    head = ("claim", "the paper's statement", "holds if", "measured (95 % interval)", "seeds", "verdict")
    rows = [head, ("---",) * len(head)]
    for c in claims:
        criterion = f"{c['effect']} {c['relation']} {c['limit']:g}"
        measured = f"{c['value']:.3f} ({c['ci_low']:.3f} to {c['ci_high']:.3f})"
        rows.append((c["claim"], c["statement"], criterion, measured, str(c["n_seeds"]), c["verdict"]))
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def quoted(data: xr.Dataset) -> dict[str, str]:
    """The single numbers in the text."""
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


def main() -> int:
    """Prints the table and the numbers; returns the exit status."""
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    try:
        claims = json.loads((out / "claims.json").read_text())
        folder = results_folder(out, Size()) / "fig5a"
        numbers = quoted(store.load(folder, claims[0]["n_seeds"]))
    except OSError as error:
        print(f"error: {error}; run `make figures` first", file=sys.stderr)
        return 2
    print(claims_table(claims))
    for name, value in numbers.items():
        print(f"{name}: {value}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
