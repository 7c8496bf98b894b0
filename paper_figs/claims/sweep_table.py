"""What the paper says of its parameter sweeps, Figs. 6 to 8: C5, C6 and C8 to C14.

Words with a size: what is "slightly" better leads by up to 10 % of the optimum, what is "much" better by more. What
"hardly moves" stays within 20 % of its own level and moves less than 20 % as far as what "jumps", which rises by more
than 20 %. "Up to 67 %" is what rounds to 67 % or more.
"""

from __future__ import annotations

from paper_figs.claims.effects import EveryLead, HardlyMoves, LargestReduction, MeanLead, RelativeLevel, Trend
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
    """A metric rises (sign 1) or falls (-1) from each point of a figure to the next, from the value `low` on."""
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


def _jumps(metric: str) -> Claim:
    """C12: DDQN's level rises from the last point below 0.7 to 0.9."""
    word = _WORDS[metric]
    return Claim(
        f"C12 ({word}, DDQN)",
        f"from tau_0 = 0.7 on DDQN's {word} jumps",
        f"7{_PANELS[metric]}",
        SWEEPS,
        f"{word} at tau_0 = {_END} over that at {_START}",
        RelativeLevel(metric, "ddqn", _END, _START),
        ">",
        1.0 + HARDLY,
        "ratio",
    )


def _hardly_moves(metric: str, name: str) -> Claim:
    """C12: the others' levels stay, by their own measure and by DDQN's rise."""
    word, label, share = _WORDS[metric], LABELS[name], f"{100 * HARDLY:g} %"
    return Claim(
        f"C12 ({word}, {label})",
        f"from tau_0 = 0.7 on {label}'s {word} hardly moves",
        f"7{_PANELS[metric]}",
        SWEEPS,
        f"room of its change from {_START} to {_END} below {share} of its level, and of DDQN's rise",
        HardlyMoves(metric, name, "ddqn", _END, _START, HARDLY),
        ">",
        0.0,
        "share of its level",
    )


_START, _END = 0.6, 0.9
_BELOW = 0.7
_BELOW_07 = (
    Claim(
        "C10 (DPR)", "TLwD's reward is slightly higher than DPR's below tau_0 = 0.7", "7a", SWEEPS,
        "mean lead over DPR below 0.7", MeanLead("tlwd", "dpr", _BELOW), "within", (0.0, SLIGHT),
        "share of the optimum",
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
    *(
        claim
        for metric in ("throughput", "miss_detection")
        for claim in (_jumps(metric), _hardly_moves(metric, "tlwd"), _hardly_moves(metric, "dpr"))
    ),
    *(_monotone("C13 (reward", "reward", name, -1.0, "8") for name in _RIVALS),
    *(_monotone("C13 (miss detection", "miss_detection", name, 1.0, "8") for name in _RIVALS),
    _highest("C13 (highest)", "8"),
    _up_to("C14 (DPR)", 22, "8", "dpr"),
    _up_to("C14 (DDQN)", 61, "8", "ddqn"),
)
