"""Pictures of single slots: the objects around the vehicle, what the radar resolves, the state, and what happened.

Needs matplotlib; no other module of the package imports this one, but an adapter does when it is asked for a picture.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Arc, Patch, Polygon, Rectangle

from jrcjax.checks import require
from jrcjax.model import slot, states
from jrcjax.model.environment import EnvState
from jrcjax.model.params import FACTORS, EnvParams
from jrcjax.radar.bank import slot_placement
from jrcjax.radar.detection import merged_objects
from jrcjax.radar.placement import Footprints
from jrcjax.readings import EventModel
from jrcjax.types import Int, Key, Words

# Okabe and Ito's colours, which stay apart for the colour-blind; fill and outline say the same without colour.
_RESOLVED: dict[str, Any] = {"facecolor": "#0072B2", "edgecolor": "#0072B2"}
_MERGED: dict[str, Any] = {"facecolor": "#FFFFFF", "edgecolor": "#D55E00"}
_UNSEEN: dict[str, Any] = {"facecolor": "#C8C8C8", "edgecolor": "#707070"}
_ALARM = "#D55E00"
_SIZE, _DPI = (9.0, 5.6), 100  # inches and pixels per inch: 900 x 560 pixels


class Scene(NamedTuple):
    """The objects in the square of one radar mode."""

    centre: np.ndarray
    """[N, 2] in m, the vehicle at the origin, looking along the first axis."""
    size: np.ndarray
    """[N, 2] length (first axis) and width in m."""
    merged: np.ndarray
    """[N] bool, unresolved from at least one other."""
    reach: float
    """Maximum range and side of the square in m."""
    resolution: float
    """Range resolution in m."""


def slot_figure(key: Key, state: EnvState | Int | int, action: Int | int, params: EnvParams) -> Figure:
    """A picture of the slot that `JRCEnv.step_env(key, state, action, params)` runs.

    Args:
      key: the slot's PRNG key.
      state: the environment's state, or its id.
      action: a data rate or a radar mode.
      params: the environment.

    Returns:
      A matplotlib figure: `figure.savefig(...)`.

    Raises:
      ValueError: naming the argument, the value and what is allowed.
    """
    state_id: Any = state.id if isinstance(state, EnvState) else state
    for name, value, count in (("state", state_id, params.num_states), ("action", action, params.num_actions)):
        allowed = f"an integer from 0 to {count - 1}"
        require(name, value, (), lambda x, count=count: (x >= 0) & (x < count), allowed, kinds="iu")
    words = jax.random.bits(key, (slot.NUM_WORDS,), jnp.uint32)
    first = int(state.first) if isinstance(state, EnvState) else None
    return figure_of_words(words, int(state_id), int(action), params, first)


def figure_of_words(
    words: Words | np.ndarray | None, state: int, action: int | None, params: EnvParams, first: int | None = None
) -> Figure:
    """A picture of one slot, given what `slot.run_slot` takes: random words [NUM_WORDS], ids, and the first state's id.

    Without words and action it shows the state alone, before the first slot of an episode.
    """
    figure = Figure(figsize=_SIZE, dpi=_DPI, layout=ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.1))
    left, right = figure.subplots(1, 2, width_ratios=(1.45, 1))
    outcome = scene = None
    if words is not None and action is not None:
        deciding = jnp.int32(state if first is None else first)
        outcome = _run_slot(jnp.asarray(words), jnp.int32(state), jnp.int32(action), params, deciding)
        mode = action - params.num_rates
        # A slot spent on data looks at nothing; the shortest range then shows what is near.
        scene = scene_of(words[-1], mode if mode >= 0 else _shortest(params), params)
    _draw_map(left, scene, bool(outcome is not None and not outcome.is_data))
    _draw_state(right, state, action, params)
    _write(right, _told(outcome, scene, params))
    return figure


def scene_of(word: Words | np.ndarray, mode: int, params: EnvParams) -> Scene:
    """The placement that a slot with this word for its placement draws for a radar mode."""
    present, footprints, merged = _placed(jnp.asarray(word, jnp.uint32), mode, params.radar)
    reach, resolution = params.radar.reach[mode], params.radar.resolution[mode]
    centre, size, merged = (np.asarray(a)[np.asarray(present)] for a in (footprints.centre, footprints.size, merged))
    return Scene(centre, size, merged, float(reach), float(resolution))


def rgb_array(figure: Figure) -> np.ndarray:
    """The pixels of a figure, [height, width, 3] uint8."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


_run_slot = jax.jit(slot.run_slot)


@jax.jit(static_argnums=1)
def _placed(word: Words, mode: int, radar: Any) -> tuple[jax.Array, Footprints, jax.Array]:
    count, footprints = slot_placement(word, mode, radar)
    present = jnp.arange(footprints.present.shape[0]) < count
    return present, footprints, merged_objects(footprints, radar.resolution[mode], radar.distance)


def _shortest(params: EnvParams) -> int:
    return int(np.argmin(params.radar.reach))


def _draw_map(axes: Axes, scene: Scene | None, radar_is_on: bool) -> None:
    axes.set_aspect("equal")
    axes.set_xlabel("ahead of the vehicle (m)")
    axes.set_ylabel("to the left (m)")
    side = scene.reach if scene else 45.0
    axes.set_xlim(-0.06 * side, 1.06 * side)
    axes.set_ylim(-0.56 * side, 0.56 * side)
    nose = side * np.array([[0.035, 0.0], [-0.03, 0.022], [-0.03, -0.022]])
    axes.add_patch(Polygon(nose, closed=True, facecolor="black", zorder=3))
    if scene is None:
        axes.text(0.5 * side, 0.0, "before the first slot", ha="center", va="center", color="0.35")
        return
    axes.add_patch(Rectangle((0, -side / 2), side, side, fill=False, edgecolor="0.35", linewidth=0.9))
    groups = [(~scene.merged, _RESOLVED, "resolved"), (scene.merged, _MERGED, "merged with a neighbour")]
    if radar_is_on:
        axes.add_patch(Arc((0, 0), 2 * side, 2 * side, theta1=-90, theta2=90, linestyle="--", edgecolor="0.35"))
    else:
        groups = [(np.ones(scene.merged.shape, bool), _UNSEEN, "not detected: the radar is off")]
    for chosen, look, _ in groups:
        corners = scene.centre[chosen] - scene.size[chosen] / 2
        boxes = [Rectangle((x, y), *size) for (x, y), size in zip(corners, scene.size[chosen], strict=True)]
        axes.add_collection(PatchCollection(boxes, linewidth=0.9, zorder=2, **look))
    entries = [Patch(label=f"{label} ({chosen.sum()})", **look) for chosen, look, label in groups]
    axes.legend(handles=entries, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, frameon=False)


def _draw_state(axes: Axes, state: int, action: int | None, params: EnvParams) -> None:
    """One strip per factor, its level filled, and one for the action."""
    levels = np.asarray(states.levels_of(jnp.int32(state), params.shape))
    strips = [(name, int(level), size) for name, level, size in zip(FACTORS, levels, params.shape, strict=True)]
    axes.set_axis_off()
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 14)
    axes.text(0, 13.5, f"state {state}: level of each factor", fontweight="bold", va="center")
    for row, (name, level, size) in enumerate(strips):
        _strip(axes, 12.3 - row, name, [str(i) for i in range(size)], level)
    labels = [f"d{i + 1}" for i in range(params.num_rates)] + [f"r{i + 1}" for i in range(params.radar.num_modes)]
    axes.text(0, 6.9, "action: data rates d, radar modes r", fontweight="bold", va="center")
    _strip(axes, 5.8, "", labels, action)


def _strip(axes: Axes, y: float, name: str, labels: list[str], chosen: int | None) -> None:
    start = 0.27 if name else 0.0
    axes.text(0, y, name, va="center")
    width = (1 - start) / len(labels)
    for i, label in enumerate(labels):
        is_chosen = i == chosen
        face = "#0072B2" if is_chosen else "white"
        axes.add_patch(Rectangle((start + i * width, y - 0.38), width, 0.76, facecolor=face, edgecolor="0.35"))
        if len(labels) <= 12 or is_chosen:
            colour = "white" if is_chosen else "0.35"
            axes.text(start + (i + 0.5) * width, y, label, ha="center", va="center", color=colour, fontsize=9)


def _told(outcome: slot.Outcome | None, scene: Scene | None, params: EnvParams) -> list[tuple[str, str]]:
    """Lines of text and their colours."""
    if outcome is None or scene is None:
        return [(f"events: {EventModel.names()[int(params.event_model)]}", "0.35")]
    event = bool(outcome.event)
    seen = f"{scene.reach:.0f} m, resolution {scene.resolution:.2g} m"
    what = f"radar: {seen}" if not outcome.is_data else f"data: {float(outcome.packets):g} packets delivered"
    return [
        (what, "black"),
        (f"missed: {float(outcome.miss_ratio):.0%} of the objects", "black"),
        ("an unexpected event" if event else "no event", _ALARM if event else "black"),
        (f"reward {float(outcome.reward):+.2f}", "black"),
    ]


def _write(axes: Axes, lines: list[tuple[str, str]]) -> None:
    for i, (line, colour) in enumerate(lines):
        weight = "bold" if colour == _ALARM else "normal"
        axes.text(0, 4.3 - i, line, va="center", color=colour, fontsize=11, fontweight=weight)
