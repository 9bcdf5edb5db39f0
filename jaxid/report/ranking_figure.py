"""Which candidates were looked at: what each promised, and what was left of the error once it was refitted."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..explanation.explanation import Explanation
from ..explanation.search.steps import Step
from ..robots.effect import in_words
from .explanation_figures import AFTER, BEFORE
from .style import tidy

ALIKE, OTHER = "#8fd3bd", "0.75"
"""Colours of candidates that the data cannot tell from the chosen one, and of all others."""
_MOST_ROWS = 10


def _bars(ax: Axes, shares: Sequence[float], colours: Sequence[str]) -> None:
    for row, (share, colour) in enumerate(zip(shares, colours, strict=True)):
        percent = 100.0 * min(max(share, 0.0), 1.0)
        ax.barh(row, percent, height=0.66, color=colour, zorder=2)
        ax.text(percent + 1.5, row, f"{percent:.0f} %", va="center", fontsize="x-small")
    ax.set_xlim(0.0, 115.0)
    ax.set_xlabel("promised share of the gap [%]", fontsize="small")
    ax.set_title("first look at all candidates", loc="left", fontsize="small", fontweight="bold")


def _refits(ax: Axes, errors: Sequence[float | None], colours: Sequence[str], before: float) -> None:
    """Lines from the error before to the error with each candidate; 1 is the floor."""
    known = [error for error in errors if error is not None]
    # A refit that is worse than no effect stands at the edge with its number.
    right = before + 0.12 * max(before - 1.0, 0.05)
    for row, (error, colour) in enumerate(zip(errors, colours, strict=True)):
        if error is None:
            ax.annotate("not refitted", (before, row), (-5, 0), textcoords="offset points", ha="right", va="center",
                        fontsize="x-small", color="0.6")  # fmt: skip
            continue
        end = min(error, right)
        ax.plot([before, end], [row, row], color=colour, lw=2.5, zorder=2, solid_capstyle="butt")
        ax.plot(end, row, "o", color=colour, ms=8, zorder=3)
        ax.annotate(f"{error:.2f}", (end, row), (0, 5), textcoords="offset points", ha="center", fontsize="x-small",
                    bbox={"fc": "white", "ec": "none", "pad": 0.5})  # fmt: skip
    ax.axvline(before, color=BEFORE, lw=1.6, zorder=1)
    ax.axvline(1.0, color="0.2", lw=1.6, ls="--", zorder=1)
    at = {"xycoords": ax.get_xaxis_transform(), "textcoords": "offset points", "ha": "center", "fontsize": "x-small"}
    ax.annotate("before", (before, 1.0), (0, 3), color=BEFORE, **at)
    ax.annotate("noise floor", (1.0, 1.0), (0, 3), color="0.2", **at)
    low = min([1.0, *known])
    ax.set_xlim(low - 0.06 * (right - low), right + 0.02 * (right - low))
    ax.set_xlabel("held-out error with it, all parameters refitted [times the noise]", fontsize="small")
    ax.set_title("refitted", loc="center", fontsize="small", fontweight="bold")


def _step(axes: Sequence[Axes], step: Step, before: float) -> None:
    refitted = {trial.id: trial.held_out.normalised_rms for trial in step.compared}
    shares = {c.effect.id: c.share for c in step.screened}
    names = list(refitted) + [name for name in shares if name not in refitted and shares[name] > 0.005]
    names = names[: max(_MOST_ROWS, len(refitted))]
    colour = {name: ALIKE if name in step.equivalent else OTHER for name in names} | {step.chosen.id: AFTER}
    colours = [colour[name] for name in names]
    _bars(axes[0], [shares.get(name, 0.0) for name in names], colours)
    _refits(axes[1], [refitted.get(name) for name in names], colours, before)
    axes[0].set_yticks(range(len(names)), [in_words(name) for name in names])
    for label, name in zip(axes[0].get_yticklabels(), names, strict=True):
        label.set_fontweight("bold" if name == step.chosen.id else "normal")
    axes[1].set_yticks(range(len(names)), [""] * len(names))
    for ax in axes:
        ax.set_ylim(len(names) - 0.4, -0.9)
        tidy(ax)
        ax.grid(axis="y", visible=False)


def _rows(step: Step) -> int:
    """How many candidates `_step` shows."""
    refitted = {trial.id for trial in step.compared}
    others = [c for c in step.screened if c.effect.id not in refitted and c.share > 0.005]
    return max(len(refitted), min(len(refitted) + len(others), _MOST_ROWS))


def ranking(found: Explanation) -> Figure | None:
    """Which candidates were looked at, how much each promised, and what was left once it was refitted.

    One row of panels for every effect added. Green: added; light green: the data cannot tell it from that. None where
    nothing was looked at.
    """
    steps, first = found.search.steps, [c for c in found.search.first_look if c.share > 0.0][:_MOST_ROWS]
    if not steps and not first:
        return None
    if not steps:
        figure = Figure(figsize=(7.5, 1.2 + 0.3 * len(first)), layout="constrained")
        ax = figure.subplots()
        _bars(ax, [c.share for c in first], [OTHER] * len(first))
        ax.set_yticks(range(len(first)), [in_words(c.effect.id) for c in first])
        ax.set_ylim(len(first) - 0.4, -0.6)
        tidy(ax)
        ax.grid(axis="y", visible=False)
        return figure
    counts = [_rows(step) for step in steps]
    figure = Figure(figsize=(11, 0.6 + sum(1.1 + 0.3 * n for n in counts)), layout="constrained")
    grid = figure.subplots(len(steps), 2, squeeze=False, width_ratios=(1, 1.5), height_ratios=[n + 3 for n in counts])
    for row, step in zip(grid, steps, strict=True):
        _step(list(row), step, step.evidence[0].held_out.normalised_rms)
    handles = [Patch(color=AFTER, label="added")]
    if any(step.equivalent for step in steps):
        handles.append(Patch(color=ALIKE, label="not told apart from it by this data"))
    figure.legend(handles=handles, loc="outside lower right", ncols=2, fontsize="small", frameon=False)
    return figure
