"""What is missing, in one picture: the law of every named effect as what it is a function of, before and after.

Orange is the model without, green the model with it and its 95 % band, grey what the measured motion asks for.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..explanation.explanation import Explanation
from ..explanation.where.law_curves import LawCurve, law_curves
from ..robots.effect import in_words
from .explanation_figures import AFTER, BEFORE
from .style import tidy
from .tables import number

Array = NDArray[np.float64]

_MEASURED = "0.55"
_BINS = 24
_ZOOM = 4.0
"""Times the range in which 95 % of an effect lies that is shown, where that is a small part of the whole."""
_ONE_SIDED = 0.02
_LEVEL, _GONE = 0.05, 0.5
_ROW = 3
_SEEN = 1e-3
"""Share of what is shown by which a variable varies at least where measured values are drawn over it."""
_SMALL = 0.15
"""Share of a curve's range below which a change is too small to be seen beside it, and is drawn alone."""


def curves_of(found: Explanation) -> dict[str, tuple[LawCurve, ...]]:
    """The curves of every named effect that has any, by its id."""
    forces = found.localisation.forces if found.localisation is not None else ()
    ids = [effect.id for effect in found.effects]
    every = law_curves(ids, found.baseline, found.final, found.held_out, forces, found.before.noise)
    return {name: own for name, own in every.items() if own}


# -- in words ------------------------------------------------------------------------------------------------------
def _worded(value: float, unit: str) -> str:
    return f"{number(abs(value), 3)} {unit}".strip()


def _at(value: float, unit: str) -> str:
    return f"{number(value, 3 if abs(value) >= 10 else 2)} {unit}".strip() if value else f"0 {unit}".strip()


def told(curve: LawCurve) -> str:
    """What the effect alone does to this curve, in a sentence without its full stop: "friction rises by 0.31 N at 0 m/s"."""
    change = curve.change
    top = int(np.argmax(np.abs(change)))
    size = float(change[top])
    name = curve.title
    if curve.place:
        low, high = (np.quantile(change, q) for q in (0.0, 1.0))
        x, y = curve.values[top]
        return (
            f"{name} changes by {number(low, 2)} to {number(high, 2)} {curve.unit} over the floor, most at "
            f"({number(x, 2)}, {number(y, 2)}) m"
        )
    x, of = curve.values, curve.of
    flip = np.sign(x) if _odd(curve) else np.ones_like(x)
    lifted = change * flip
    if np.ptp(lifted) < _LEVEL * np.abs(lifted).max() or np.ptp(lifted[x > 0]) < _LEVEL * np.abs(lifted).max():
        side = float(np.median(lifted[x > 0]))
        return f"{name} is {'higher' if side > 0 else 'lower'} by {_worded(side, curve.unit)} throughout"
    if np.ptp(change) > 1.5 * abs(size) and not _odd(curve):
        low, high = int(np.argmin(change)), int(np.argmax(change))
        return (
            f"{name} changes by {number(float(change[low]), 2)} {curve.unit} at {curve.variable} {_at(x[low], of)} and by "
            f"{number(float(change[high]), 2)} {curve.unit} at {_at(x[high], of)}"
        )
    right = x >= 0 if x[top] >= 0 or _odd(curve) else x < 0
    along, own = np.abs(x[right]), lifted[right]
    order = np.argsort(along)
    along, own = along[order], own[order]
    top = int(np.argmax(np.abs(own)))
    word = "rises" if own[top] > 0 else "falls"
    half = along[np.abs(own) >= _GONE * abs(own[top])]
    sign = "-" if not _odd(curve) and x[right].max() < 0 else ""
    text = f"{name} {word} by {_worded(own[top], curve.unit)}"
    if top < _ONE_SIDED * len(own) + 1:
        return f"{text} near {_at(0.0, of)}, by half of that at {curve.variable} {sign}{_at(float(half.max()), of)}"
    ends = (f"{sign}{_at(float(x), of)}" for x in (along[top], half.min()))
    return f"{text} at {curve.variable} {', by half of that at '.join(ends)}"


def _odd(curve: LawCurve) -> bool:
    """Whether the curve is about the same the other way round, as friction is: its sizes tell."""
    x = curve.values
    if curve.place or not (x[0] < 0 < x[-1]) or not np.allclose(x, -x[::-1]):
        return False
    top = np.abs(curve.change).max()
    return bool(np.abs(curve.change + curve.change[::-1]).max() < 0.1 * top and np.abs(curve.after[0]) > 0)


def caption(found: Explanation, curves: Mapping[str, Sequence[LawCurve]]) -> str:
    """The finding in words, for the caption and for who sees no picture."""
    parts = []
    for effect in found.effects:
        if effect.id in curves:
            words = "; ".join(told(curve) for curve in curves[effect.id])
            parts.append(f"{effect.title[0].upper()}{effect.title[1:]}: {words}.")
    return " ".join(parts)


# -- drawing -------------------------------------------------------------------------------------------------------
def _reach(curve: LawCurve) -> tuple[float, float]:
    """What of the variable is shown: all of it, or where the effect is, with its surroundings."""
    x, change = curve.values, np.abs(curve.change)
    low, high = float(x[0]), float(x[-1])
    if low < 0 < high:
        within = np.array([change[np.abs(x) <= at] @ np.gradient(x)[np.abs(x) <= at] for at in x[x > 0]])
        at = float(x[x > 0][int(np.argmax(within >= 0.95 * within[-1]))]) if within[-1] > 0 else high
        ends = min(change[0], change[-1])
        if ends >= 0.95 * change.max():  # it is complete soon, and stays
            at = min(at, float(np.abs(x[change < 0.95 * ends]).max(initial=0.0))) or high
        if _ZOOM * at < 0.5 * high:
            return -_ZOOM * at, _ZOOM * at
    return low, high


def _range(x: Array) -> float:
    return float(np.ptp(x[np.isfinite(x)])) if np.isfinite(x).any() else 0.0


def _binned(x: Array, y: Array) -> tuple[Array, Array]:
    """Means of `y` in bins of `x` with as many samples each, of those that were measured."""
    there = np.isfinite(x) & np.isfinite(y)
    x, y = x[there], y[there]
    edges = np.unique(np.quantile(x, np.linspace(0, 1, _BINS + 1))) if len(x) else x
    if len(edges) < 2:
        return edges, np.array([y.mean() for _ in edges])
    places = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    count = np.maximum(np.bincount(places, minlength=len(edges) - 1), 1)
    return np.bincount(places, x, len(edges) - 1) / count, np.bincount(places, y, len(edges) - 1) / count


def _alone(curve: LawCurve) -> bool:
    """Whether what the effect changes is drawn instead of the whole, beside which it would not be seen."""
    if curve.place or curve.samples is not None:
        return False
    return float(np.abs(curve.after - curve.before).max()) < _SMALL * float(np.ptp(curve.after))


def _draw(ax: Axes, curve: LawCurve) -> None:
    low, high = _reach(curve)
    shown = (curve.values >= low) & (curve.values <= high)
    x, after, before = curve.values[shown], curve.after[shown], curve.before[shown]
    if _alone(curve):
        after, before = after - before, np.zeros_like(before)
    half = 1.96 * curve.std[shown]
    if curve.samples is not None:
        inside = (curve.samples[0] >= low) & (curve.samples[0] <= high)
        sx, sy = (s[inside] for s in curve.samples)
        # Where the variable was not seen to change, what was measured says nothing of a law of it.
        if len(sx) > 2 * _BINS and _range(sx) > _SEEN * (high - low):
            every = max(len(sx) // 2500, 1)
            ax.plot(sx[::every], sy[::every], ".", ms=1.5, color=_MEASURED, alpha=0.25, rasterized=True, zorder=1)
            for side in (sx < 0, sx > 0) if low < 0 < high and curve.variable != "heading" else (sx == sx,):
                if side.sum() > _BINS:
                    ax.plot(*_binned(sx[side], sy[side]), "o", ms=3.5, color="0.25", zorder=5)
    ax.plot(x, before, color=BEFORE, lw=1.8, ls=(0, (5, 2)), zorder=3)
    if np.isfinite(half).all():
        ax.fill_between(x, after - half, after + half, color=AFTER, alpha=0.3, lw=0, zorder=2)
    ax.plot(x, after, color=AFTER, lw=2.2, zorder=4)
    ends = np.concatenate([after, before, *([after - half, after + half] if np.isfinite(half).all() else [])])
    margin = 0.12 * max(float(np.ptp(ends)), 1e-12)
    ax.set_ylim(float(ends.min()) - margin, float(ends.max()) + margin)
    ax.set_xlim(float(x[0]), float(x[-1]))
    if low < 0 < high:
        ax.axvline(0.0, color="0.3", lw=0.6, zorder=0)
    ax.axhline(0.0, color="0.3", lw=0.6, zorder=0)
    ax.set_xlabel(f"{curve.variable} [{curve.of}]" if curve.of else curve.variable)
    ax.locator_params(axis="x", nbins=6)
    tidy(ax)


def _map(figure: Figure, ax: Axes, curve: LawCurve) -> None:
    """The floor, coloured by what the effect changes there, and where the robot drove."""
    x, y = (np.unique(column) for column in curve.values.T)
    most = float(np.abs(curve.change).max())
    colours = ax.pcolormesh(x, y, curve.change.reshape(len(y), len(x)), cmap="PuOr_r", vmin=-most, vmax=most,
                            shading="nearest", rasterized=True)  # fmt: skip
    if curve.path is not None:
        ax.plot(*curve.path[:: max(len(curve.path) // 4000, 1)].T, ".", ms=0.8, color="0.2", alpha=0.5)
    figure.colorbar(colours, ax=ax, label=f"change [{curve.unit}]")
    ax.set_aspect("equal")
    ax.set_xlabel("x [m]")


def _once(drawn: list[tuple[str, LawCurve]]) -> list[tuple[str, LawCurve]]:
    """One panel where several effects change the same curve, with all their names."""
    kept: list[tuple[str, LawCurve]] = []
    for name, curve in drawn:
        for k, (other, own) in enumerate(kept):
            alike = own.title == curve.title and own.variable == curve.variable and not curve.place
            if alike and np.array_equal(own.after, curve.after):
                kept[k] = (f"{other} and {name}", own)
                break
        else:
            kept.append((name, curve))
    return kept


def law_figure(curves: Mapping[str, Sequence[LawCurve]]) -> Figure | None:
    """Every named effect as a function of what it depends on; None where no effect can be drawn."""
    drawn = _once([(in_words(name), curve) for name, own in curves.items() for curve in own])
    if not drawn:
        return None
    columns = min(len(drawn), _ROW)
    rows = -(-len(drawn) // columns)
    # A single panel is drawn as narrow as a phone, so that its words can be read there.
    figure = Figure(figsize=(3.8 * columns if columns > 1 else 4.8, 0.5 + 3.3 * rows), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for ax, (name, curve) in zip(axes, drawn, strict=False):
        if curve.place:
            _map(figure, ax, curve)
        else:
            _draw(ax, curve)
        label = f"{'change of ' if _alone(curve) else ''}{curve.quantity}" + (f" [{curve.unit}]" if curve.unit else "")
        ax.set_ylabel("y [m]" if curve.place else label)
        title = name
        ax.set_title(f"{title[0].upper()}{title[1:]}: {curve.title}", loc="left", fontsize="small",
                     fontweight="bold")  # fmt: skip
    for ax in axes[len(drawn) :]:
        ax.set_visible(False)
    handles: list[Artist] = [
        Line2D([], [], color=BEFORE, lw=1.8, ls=(0, (5, 2)), label="model without"),
        Line2D([], [], color=AFTER, lw=2.2, label="model with it"),
    ]
    if any(not c.place and np.isfinite(c.std).all() for _, c in drawn):
        handles.append(Patch(color=AFTER, alpha=0.3, label="95 %"))
    if any(not c.place and not np.isfinite(c.std).all() for _, c in drawn):
        handles.append(Line2D([], [], ls="", label="no band: its size is not identified"))
    if any(c.samples is not None for _, c in drawn):
        handles.append(
            Line2D([], [], color="0.25", marker="o", ms=3.5, ls="", label="measured motion, smoothed over time")
        )
    if any(not c.place for _, c in drawn):
        ncols = 4 if columns > 1 else 2
        figure.legend(handles=handles, loc="outside upper right", ncols=ncols, fontsize="small", frameon=False)
    return figure
