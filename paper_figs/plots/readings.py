"""Figures about many readings of the paper: where claims hold, what decides, and what a search found."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paper_figs.markdown import from_to
from paper_figs.plots import style

_DEFAULT = "default"
_BLUE, _ORANGE, _GREEN, _GREY = "#0072B2", "#D55E00", "#009E73", "0.6"
_DECIDING = 5  # readings whose choices stand under a specification curve


@style.styled
def draw_shares(claims: pd.DataFrame) -> Figure:
    """The share of readings in which each statement holds by its estimate; of those with verdicts, the share of each.

    Args:
      claims: a row per statement, as `paper_figs.studies.multiverse.shares` gives them.
    """
    figure = Figure(figsize=(style.TWO_COLUMNS[0], 0.125 * len(claims) + 1.0))
    axes, rows = figure.subplots(), np.arange(len(claims))[::-1]
    for name, colour, marker, shift in (
        ("holds", "black", "o", 0.0),
        ("supported", _GREEN, "^", 0.25),
        ("contradicted", _ORANGE, "v", -0.2),
        ("negligible", _BLUE, "s", -0.4),
    ):
        value = claims[name].to_numpy()
        if name != "holds" and not (value > 0).any():
            continue
        bars = np.clip([value - claims[f"{name}_low"], claims[f"{name}_high"] - value], 0.0, None)
        label = "holds by its estimate" if name == "holds" else name
        look = {"markersize": 2.5, "elinewidth": 0.6, "linestyle": ""}
        axes.errorbar(100 * value, rows + shift, xerr=100 * bars, marker=marker, color=colour, label=label, **look)
    axes.set_yticks(rows, claims.claim, fontsize=5)
    axes.set_ylim(-1, len(claims))
    axes.set_xlim(-2, 102)
    axes.grid(axis="y", linewidth=0.2)
    axes.set_xlabel("share of readings (%)")
    judged = {int(number) for number in claims.judged if number}
    of_verdicts = f", verdicts of {from_to(judged)} of them" if judged else ""
    figure.suptitle(f"Where the claims hold: {int(claims.readings.max())} readings{of_verdicts} (bars: 95 % intervals)")
    figure.legend(loc="outside lower center", ncols=4)
    return figure


@style.styled
def draw_decisive(sensitivity: pd.DataFrame) -> Figure:
    """What decides each statement's effect: total-order indices as a map, statements by readings.

    Args:
      sensitivity: as `paper_figs.studies.multiverse.decisive` gives it.
    """
    total = sensitivity.pivot_table(index="claim", columns="input", values="total", sort=False)
    error = sensitivity.drop_duplicates("claim").set_index("claim").surrogate_error
    figure = Figure(figsize=(style.TWO_COLUMNS[0], 0.115 * len(total) + 2.0))
    axes = figure.subplots()
    picture = axes.imshow(total, cmap="viridis", vmin=0, vmax=1, aspect="auto")
    axes.set_facecolor("0.9")  # where a question cannot act on a statement, there is no index
    axes.set_xticks(range(total.shape[1]), list(total.columns), rotation=90, fontsize=5)
    axes.set_yticks(range(len(total)), [f"{claim}, error {error[claim]:.2f}" for claim in total.index], fontsize=5)
    axes.tick_params(length=0)
    axes.grid(visible=False)
    figure.colorbar(picture, ax=axes, label="total-order index", shrink=0.5)
    figure.suptitle(
        "What decides each effect (grey: cannot act on it; error: of the surrogate, cross-validated, over the variance)"
    )
    return figure


@style.styled
def draw_specification(
    found: pd.DataFrame, readings: pd.DataFrame, decisive: dict[str, list[str]], limits: dict[str, float]
) -> Figure:
    """Specification curves: a statement's effect in all readings that have one, in ascending order, and what these are.

    Args:
      found: as `paper_figs.studies.multiverse.verdicts` gives it.
      readings: a row per reading, a column per question with its place in the range, in [0, 1].
      decisive: by statement, names of the questions that decide most.
      limits: by statement, what its effect is held against.
    """
    figure = Figure(figsize=(style.TWO_COLUMNS[0], 4.2))
    rows = figure.subplots(2, len(limits), height_ratios=(2, 1), squeeze=False, sharex="col")
    for (curve, choices), (claim, limit) in zip(rows.T, limits.items(), strict=True):
        everywhere = found.loc[found.claim == claim]
        here = everywhere.loc[np.isfinite(everywhere.value)]
        here = here.iloc[np.argsort(here.value.to_numpy(float))]
        order = np.arange(len(here))
        curve.vlines(order, here.ci_low, here.ci_high, color=_GREY, linewidth=0.3)
        curve.scatter(order, here.value, s=2, c=np.where(here.holds.astype(bool), _GREEN, _ORANGE), zorder=2)
        curve.axhline(limit, color="black", linewidth=0.5)
        curve.set_ylim(*_room(here.value.to_numpy(float), limit))
        unknown = 100 * (1 - len(here) / len(everywhere))
        of_unknown = f", unknown in {unknown:.0f} %" if unknown else ""
        share = 100 * everywhere.holds.astype(bool).mean()
        curve.set_title(f"{claim}\nholds in {share:.0f} %{of_unknown}", fontsize=7)
        _draw_choices(choices, readings.loc[here.reading.astype(int)], decisive[claim][:_DECIDING])
    rows[0, 0].set_ylabel("effect")
    figure.supxlabel("readings in order of the effect", fontsize=7)
    figure.suptitle("Specification curves (green: on the claim's side), and the readings that decide most")
    return figure


def _room(values: np.ndarray, limit: float) -> tuple[float, float]:
    """Limits of an axis that shows most values and the limit."""
    shown = [*np.quantile(values, (0.02, 0.98)), limit] if len(values) else [limit]
    room = 0.2 * max(max(shown) - min(shown), 1e-6)
    return min(shown) - room, max(shown) + room


def _draw_choices(axes: Axes, readings: pd.DataFrame, names: list[str]) -> None:
    for row, name in enumerate(names):
        axes.scatter(np.arange(len(readings)), row + 0.8 * readings[name] - 0.4, s=0.5, color="black")
    axes.set_yticks(range(len(names)), names, fontsize=5)
    axes.grid(axis="y", linewidth=0.2)


@style.styled
def draw_search(tried: pd.DataFrame, confirmed: pd.DataFrame, least_loss: float) -> Figure:
    """How the search went, and what it promised beside what fresh seeds gave.

    Args:
      tried: a row per reading, in order, with its `agreement` and the share `lost_by_one_action`.
      confirmed: a row per confirmed reading and statement.
      least_loss: that of a reading with a trade-off.
    """
    figure = Figure(figsize=(style.TWO_COLUMNS[0], 2.9))
    way, claims = figure.subplots(1, 2, width_ratios=(2, 3))
    order = np.arange(len(tried))
    searched = tried.reading.str.startswith("search").to_numpy()
    for mask, colour, label in ((~searched, _GREY, "design"), (searched, _BLUE, "search")):
        if mask.any():
            way.plot(order[mask], 100 * tried.agreement[mask], ".", color=colour, markersize=2, label=label)
    if (worth := tried.lost_by_one_action.to_numpy() >= least_loss).any():
        label = "with a trade-off"
        way.plot(
            order[worth],
            100 * tried.agreement[worth],
            "o",
            color=_GREEN,
            markersize=2.5,
            fillstyle="none",
            markeredgewidth=0.6,
            label=label,
        )
    way.plot(order, 100 * tried.agreement.cummax(), color="black", linewidth=0.8, label="best so far")
    if (default := tried[tried.reading == _DEFAULT]).size:
        way.axhline(100 * default.agreement.iloc[0], color=_ORANGE, linestyle=":", label="default")
    way.set_xlabel("readings tried")
    way.set_ylabel("agreement with the text (%)")
    way.legend(fontsize=6, ncol=2, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    best = confirmed.loc[[("all" in what.split()) for what in confirmed.best_for]]
    number = np.array([claim.split(" ")[0] for claim in best.claim])
    seeds, before = int(best.n_seeds.max()), int(best.promised_seeds.max())
    places = {name: place for place, name in enumerate(dict.fromkeys(number))}
    for column, colour, shift, label in (
        ("promised", _GREY, -0.2, "promised by one seed" if before == 1 else f"promised by {before} seeds"),
        ("holds", _BLUE, 0.2, f"{seeds} fresh seeds"),
    ):
        held = best[column].to_numpy(bool)
        share = [100.0 * held[number == name].mean() for name in places]
        claims.bar(np.arange(len(places)) + shift, share, width=0.38, color=colour, label=label)
    claims.set_xticks(list(places.values()), list(places), fontsize=6)
    claims.set_ylabel("statements that hold (%)")
    claims.set_axisbelow(True)
    claims.set_ylim(0, 120)  # room for the legend
    claims.set_yticks(range(0, 101, 20))
    claims.set_title(f"the best reading ({best.reading.iloc[0]}), claim by claim", fontsize=8)
    claims.legend(fontsize=6, ncol=2, loc="upper center")
    return figure
