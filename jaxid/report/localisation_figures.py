"""Where a model falls short, in one picture: the missing force over time, and when it acts. Returns a matplotlib `Figure`."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..explanation.where.condition_shares import ConditionShare, power
from ..explanation.where.localise import Localisation
from ..explanation.where.missing_force import ForceHistory
from ..explanation.where.patterns import Pattern, answering
from ..logs import Log, LogSet
from .style import COLOURS, tidy

_BARS = 8
_MARK = "#F0E442"
_PLAIN_BAR = "0.72"
_CUT = 6.0
"""Ratio at which the scale of the bars ends, unless a condition that stands out needs more."""


def worst_log(found: Localisation) -> int:
    """Number of the log with the most power of the missing force."""
    return int(np.argmax([power(force).sum() for force in found.forces]))


def _runs(mask: np.ndarray, time: np.ndarray) -> list[tuple[float, float]]:
    """Stretches of time (start, stop) over which a mask holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return [(float(time[a]), float(time[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _force(ax: Axes, force: ForceHistory, i: int, colour: str) -> None:
    value, half = force.force[:, i], 1.96 * force.std[:, i]
    ax.fill_between(force.time, value - half, value + half, color=colour, alpha=0.25, lw=0, label="95 %")
    ax.plot(force.time, value, color=colour, lw=1.2)
    ax.axhline(0.0, color="0.3", lw=0.8)
    # Where nothing shows (standstill) the band may leave the picture; the force must fill it.
    reach = float(np.max(np.abs(value)) + np.median(half))
    ax.set_ylim(-1.15 * reach, 1.15 * reach)
    ax.set_ylabel(f"missing in\n{force.names[i]} [{force.units[i]}]")


def _speed(ax: Axes, log: Log, name: str) -> None:
    unit = log.channels.units.get(name, "")
    ax.plot(log.time, log.output(name), ".", ms=1.6, color="0.35")
    ax.axhline(0.0, color="0.3", lw=0.8)
    ax.set_ylabel(f"{name}\n[{unit}]" if unit else name)


def _conditions(ax: Axes, conditions: list[ConditionShare]) -> None:
    """Bars of (share of the force) / (share of the time); 1 would be a force that does not care."""
    outs = [c.ratio_ci95[1] for c in conditions if c.stands_out] + [c.ratio for c in conditions]
    end = min(max([2.0, *outs]), max(_CUT, *(c.ratio for c in conditions)))
    for row, c in enumerate(conditions):
        ax.barh(row, c.ratio, height=0.62, color=COLOURS[1] if c.stands_out else _PLAIN_BAR, zorder=2)
        low, high = c.ratio_ci95
        ax.plot([low, min(high, 1.05 * end)], [row, row], color="0.15", lw=1.2, zorder=3)
        text = f"{100 * c.share:.0f} % in {100 * c.time_share:.0f} %"
        ax.text(1.02, row, text, va="center", fontsize="x-small", transform=ax.get_yaxis_transform())
    ax.text(1.02, -0.75, "of force in time", fontsize="x-small", color="0.35", transform=ax.get_yaxis_transform())
    ax.axvline(1.0, color="0.2", lw=1.2, ls="--", zorder=3)
    ax.set_yticks(range(len(conditions)), [c.name for c in conditions])
    for label, c in zip(ax.get_yticklabels(), conditions, strict=True):
        label.set_fontweight("bold" if c.stands_out else "normal")
    ax.set_ylim(len(conditions) - 0.4, -0.6)
    ax.set_xlim(0.0, 1.08 * end)
    ax.set_xlabel("times as much force as at random moments [-]", fontsize="small")
    ax.set_title("when it acts", loc="left", fontsize="small", fontweight="bold")


def _patterns(ax: Axes, patterns: tuple[Pattern, ...]) -> None:
    """Bars of the share of the force that each pattern reproduces."""
    for row, pattern in enumerate(patterns):
        share = 100 * max(pattern.share, 0.0)
        ax.barh(row, share, height=0.62, color=COLOURS[1] if pattern.stands_out else _PLAIN_BAR, zorder=2)
        ax.text(share + 1.5, row, f"{share:.0f} %", va="center", fontsize="x-small")
    ax.set_yticks(range(len(patterns)), [pattern.name for pattern in patterns])
    for label, pattern in zip(ax.get_yticklabels(), patterns, strict=True):
        label.set_fontweight("bold" if pattern.stands_out else "normal")
    ax.set_ylim(len(patterns) - 0.4, -0.6)
    ax.set_xlim(0.0, 112.0)
    ax.set_xlabel("share of the force that it reproduces [%]", fontsize="small")
    ax.set_title("what it follows", loc="left", fontsize="small", fontweight="bold")


def localisation(found: Localisation, logs: LogSet) -> Figure:
    """The missing force of the worst log with its 95 % band, the measured speeds beneath, and what it depends on.

    `logs` are those that `found` was estimated on. Times of the condition that stands out most are shaded. Bars right:
    how many times as much of the force acts under a condition as at random moments (line: 95 % interval; coloured: it
    stands out), and how much of the force each pattern reproduces.
    """
    e = worst_log(found)
    force, log = found.forces[e], logs[e]
    speeds = [name for name in force.names if name in log.measured] or list(log.measured)[:1]
    ratios = [1.6] * len(force.names) + [0.8] * len(speeds)
    figure = Figure(figsize=(11.5, max(1.0 + 1.05 * sum(ratios), 5.2)), layout="constrained")
    left, right = np.asarray(figure.subfigures(1, 2, width_ratios=(1.75, 1.0)))
    axes = left.subplots(len(ratios), 1, sharex=True, squeeze=False, height_ratios=ratios)[:, 0]
    for i in range(len(force.names)):
        _force(axes[i], force, i, COLOURS[i % len(COLOURS)])
        share = found.force_share[force.names[i]]
        axes[i].set_title(f"{100 * share:.0f} % of the missing force", loc="right", fontsize="small",
                          color=COLOURS[i % len(COLOURS)])  # fmt: skip
    for j, name in enumerate(speeds):
        _speed(axes[len(force.names) + j], log, name)
    follows = answering(found.patterns)
    if follows is not None:
        for i, ax in enumerate(axes[: len(force.names)]):
            ax.plot(force.time, follows.fitted[e][:, i], "k--", lw=1.1, label=f"fitted to the {follows.name}")
    best = found.standing_out[0] if found.standing_out else None
    if best is not None and found.marked:
        for ax in axes:
            for start, stop in _runs(found.marked[e], log.time):
                ax.axvspan(start, stop, color=_MARK, alpha=0.45, lw=0, zorder=0)
        axes[0].axvspan(np.nan, np.nan, color=_MARK, alpha=0.45, lw=0, label=best.phrase)
    axes[0].legend(fontsize="x-small", loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, borderpad=0)
    for ax in axes:
        tidy(ax)
        ax.margins(x=0.01)
    axes[-1].set_xlabel(f"time in {log.name} [s]")
    left.align_ylabels(axes)
    if found.conditions:
        shown = sorted(found.conditions[:_BARS], key=lambda c: -c.ratio)
        panels = right.subplots(2, 1, height_ratios=(len(shown) + 2, len(found.patterns) + 2))
        _conditions(panels[0], shown)
        _patterns(panels[1], found.patterns)
        for ax in panels:
            tidy(ax)
            ax.grid(axis="y", visible=False)
    else:
        right.text(0.5, 0.5, "no force above its own uncertainty", ha="center", va="center", color="0.35")
    figure.suptitle(_wrapped(found.sentence), fontsize="medium", x=0.01, ha="left")
    return figure


def _wrapped(text: str, width: int = 125) -> str:
    """The sentence in lines of about `width` characters."""
    lines, line = [], ""
    for word in text.split():
        if len(line) + len(word) + 1 > width:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    return "\n".join([*lines, line])
