"""What the paper says of its parameter sweeps, Figs. 6 to 8: C5, C6 and C8 to C14.

Words with a size: what is "slightly" better leads by up to 10 % of the optimum, what is "much" better by more. What
"hardly moves" stays within 20 % of its own level and moves less than 20 % as far as what "jumps", which rises by more
than 20 %. "Up to 67 %" is what rounds to 67 % or more.
"""

from __future__ import annotations

from paper_figs.claims.effects import EveryLead, LargestReduction, MeanLead, MovesLess, RelativeLevel, Trend
from paper_figs.claims.judge import Claim
from paper_figs.claims.learning_table import LABELS, SWEEPS
from paper_figs.claims.results import AXES

SLIGHT = 0.1
"""Largest lead, as a share of the optimum, that is slight; a larger one is much."""
HARDLY = 0.2
"""Largest movement, as a share of the own level and of the other's movement, that is hardly one."""
HALF_A_PERCENT = 0.005
_RIVALS = tuple(LABELS)[:3]
_UNITS = {"reward": "reward per slot", "throughput": "packets per episode", "miss_detection": "probability"}
_WORDS = {"reward": "reward", "throughput": "throughput", "miss_detection": "miss detection"}
_PANELS = {"reward": "a", "throughput": "b", "miss_detection": "c"}


def _highest(claim: str, figure: str) -> Claim:
    statement = "TLwD's reward is higher than DPR's and DDQN's at every point"
    effect = f"smallest lead over either, over {AXES[f'fig{figure}'].symbol}"
    measure = EveryLead("reward", "tlwd", ("dpr", "ddqn"))
    return Claim(claim, statement, f"{figure}a", SWEEPS, effect, measure, ">", 0.0, _UNITS["reward"])


def _extreme(metric: str, name: str) -> Claim:
    """C8: DDQN has the highest, TLwD the lowest."""
    label, word, sign = LABELS[name], "highest" if name == "ddqn" else "lowest", 1.0 if name == "ddqn" else -1.0
    others = tuple(other for other in _RIVALS if other != name)
    return Claim(
        f"C8 ({_WORDS[metric]}, {label})",
        f"{label} has the {word} {_WORDS[metric]}",
        f"6{_PANELS[metric]}",
        SWEEPS,
        "smallest distance to the nearer of the others, over p_1^v",
        EveryLead(metric, name, others, sign),
        ">",
        0.0,
        _UNITS[metric],
    )


def _monotone(part: str, metric: str, name: str, sign: float, figure: str, low: float = -1.0) -> Claim:
    """A metric rises (sign 1) or falls (-1) along a figure's axis, from one point to the next, from the value `low` on."""
    verb, symbol = "rises" if sign > 0 else "falls", AXES[f"fig{figure}"].symbol
    return Claim(
        f"{part}, {LABELS[name]})",
        f"{LABELS[name]}'s {_WORDS[metric]} {verb} with {symbol}" + (f" from {low:g} on" if low > 0 else ""),
        f"{figure}{_PANELS[metric]}",
        SWEEPS,
        f"smallest {verb.removesuffix('s')} from one point to the next",
        Trend(metric, name, sign, low),
        ">",
        0.0,
        _UNITS[metric],
    )


def _up_to(claim: str, percent: int, figure: str, other: str) -> Claim:
    statement = f"TLwD lowers miss detection by up to {percent} % against {LABELS[other]}"
    effect = f"largest relative reduction over {AXES[f'fig{figure}'].symbol}"
    limit = percent / 100 - HALF_A_PERCENT
    measure = LargestReduction("tlwd", other)
    return Claim(claim, statement, f"{figure}c", SWEEPS, effect, measure, ">", limit, "share")


def _from_07_on(metric: str) -> list[Claim]:
    """C12: DDQN's level jumps from 0.6 to 0.9, that of the others hardly moves."""
    word, figure, end, start = _WORDS[metric], f"7{_PANELS[metric]}", 0.9, 0.6
    over = f"{word} at tau_0 = {end} over that at {start}"
    still = (1.0 - HARDLY, 1.0 + HARDLY)
    jump = Claim(
        f"C12 ({word}, DDQN)", f"from tau_0 = 0.7 on DDQN's {word} jumps", figure, SWEEPS, over,
        RelativeLevel(metric, "ddqn", end, start), ">", 1.0 + HARDLY, "ratio",
    )  # fmt: skip
    others = [
        claim
        for name in ("tlwd", "dpr")
        for claim in (
            Claim(
                f"C12 ({word}, {LABELS[name]})", f"from tau_0 = 0.7 on {LABELS[name]}'s {word} hardly moves", figure,
                SWEEPS, over, RelativeLevel(metric, name, end, start), "within", still, "ratio",
            ),
            Claim(
                f"C12 ({word}, {LABELS[name]} to DDQN)", f"{LABELS[name]}'s {word} hardly moves compared with DDQN's",
                figure, SWEEPS, f"{HARDLY:.0%} of DDQN's rise less its change".replace("%", " %"),
                MovesLess(metric, name, "ddqn", end, start, HARDLY), ">", 0.0, _UNITS[metric],
            ),
        )
    ]  # fmt: skip
    return [jump, *others]


_BELOW = 0.7
_BELOW_07 = (
    Claim(
        "C10 (DPR)", "TLwD's reward is slightly higher than DPR's below tau_0 = 0.7", "7a", SWEEPS,
        "mean lead over DPR below 0.7", MeanLead("tlwd", "dpr", _BELOW), "within", (0.0, SLIGHT), "share of the optimum",
    ),
    Claim(
        "C10 (DDQN)", "TLwD's reward is much higher than DDQN's below tau_0 = 0.7", "7a", SWEEPS,
        "mean lead over DDQN below 0.7", MeanLead("tlwd", "ddqn", _BELOW), ">", SLIGHT, "share of the optimum",
    ),
)  # fmt: skip
_BEST_AT_09 = Claim(
    "C11", "at tau_0 = 0.9 DDQN's reward is the best of the three", "7a", SWEEPS, "smaller lead over TLwD and DPR",
    EveryLead("reward", "ddqn", ("tlwd", "dpr"), at=0.9), ">", 0.0, _UNITS["reward"],
)  # fmt: skip

SWEEP_CLAIMS = (
    _highest("C5 (highest)", "6"),
    *(_monotone("C5 (rise", "reward", name, 1.0, "6") for name in ("tlwd", "dpr")),
    _monotone("C6 (fall", "reward", "ddqn", -1.0, "6", low=0.6),
    *(_extreme(metric, name) for metric in ("throughput", "miss_detection") for name in ("ddqn", "tlwd")),
    _up_to("C9", 67, "6", "ddqn"),
    *(_monotone("C10 (fall", "reward", name, -1.0, "7") for name in _RIVALS),
    *_BELOW_07,
    _BEST_AT_09,
    *(claim for metric in ("throughput", "miss_detection") for claim in _from_07_on(metric)),
    *(_monotone("C13 (reward", "reward", name, -1.0, "8") for name in _RIVALS),
    *(_monotone("C13 (miss detection", "miss_detection", name, 1.0, "8") for name in _RIVALS),
    _highest("C13 (highest)", "8"),
    _up_to("C14 (DPR)", 22, "8", "dpr"),
    _up_to("C14 (DDQN)", 61, "8", "ddqn"),
)
