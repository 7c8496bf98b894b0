"""The numbers that the README quotes, from the folder that `make figures` wrote.

Run as `python -m paper_figs.readme [OUT]`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import xarray as xr

from jrcjax.hparams import HParams
from jrcjax.presets import paper_params
from paper_figs.claims import TOLERANCE, gaps
from sweeps import store


def claims_table(claims: list[dict]) -> str:
    """Verdicts as a Markdown table."""
    head = ("claim", "the paper's statement", "holds if", "measured (95 % interval)", "seeds", "verdict")
    rows = [head, ("---",) * len(head)]
    for c in claims:
        criterion = f"{c['effect']} {c['relation']} {c['limit']:g}"
        measured = f"{c['value']:.3f} ({c['ci_low']:.3f} to {c['ci_high']:.3f})"
        rows.append((c["claim"], c["statement"], criterion, measured, str(c["n_seeds"]), c["verdict"]))
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def quoted(data: xr.Dataset) -> dict[str, float]:
    """The single numbers in the text."""
    from jrcjax import exact

    params = paper_params("source")
    best = exact.optimal_policy(params)
    epsilon = float(HParams().epsilon_end)
    explored = (1 - epsilon) * best + epsilon / params.num_actions
    late = gaps(data, "ddqn")[:, 400:]
    return {
        "optimal reward per slot": float(exact.evaluate_policy(params, best).reward),
        "optimal reward per slot with exploration": float(exact.evaluate_policy(params, explored).reward),
        f"share of DDQN snapshots after episode 400 with a gap above {TOLERANCE}": float((late > TOLERANCE).mean()),
        "mean gap of DDQN after episode 400": float(late.mean()),
    }


def main() -> int:
    """Prints the table and the numbers; returns the exit status."""
    out = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    try:
        claims = json.loads((out / "claims.json").read_text())
        seeds = claims[0]["n_seeds"] if claims else len(store.finished_seeds(out / "results" / "fig5a"))
        numbers = quoted(store.load(out / "results" / "fig5a", seeds))
    except OSError as error:
        print(f"error: {error}; run `make figures` first", file=sys.stderr)
        return 2
    print(claims_table(claims))
    for name, value in numbers.items():
        print(f"{name}: {value:.3g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
