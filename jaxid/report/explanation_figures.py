"""Figures of an explanation; every function returns a matplotlib `Figure`. Orange is before, green is after.

Residuals are in units of the noise's standard deviation throughout, so that 1 is the noise floor.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy import signal

from ..explain.explanation import Explanation
from ..explain.heldout import HeldOut
from ..explain.next_experiment import NextExperiment
from ..explain.search import Step
from ..robots.robot import Robot
from ..simulate.simulate import simulate
from .figures import COLOURS, _tidy

Array = NDArray[np.float64]

BEFORE, AFTER, ALIKE, OTHER = COLOURS[1], COLOURS[2], "#8fd3bd", "0.75"
_MEASURED, _NOISE = "0.45", "0.88"
_MOST_ROWS = 10
_LAGS = 50
_WINDOW = 3.0  # s


def _name(identifier: str) -> str:
    return identifier.replace("_", " ")


def states(found: Explanation) -> list[tuple[HeldOut, Robot, str, str]]:
    """What there is to compare: held-out state, model, colour and label, before and after; one where nothing was added."""
    if found.effects:
        return [
            (found.before, found.baseline.robot, BEFORE, "before"),
            (found.after, found.model, AFTER, "after"),
        ]
    return [(found.before, found.baseline.robot, AFTER if found.verdict == "adequate" else BEFORE, "model")]


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
            ax.text(before, row, "not refitted", va="center", ha="right", fontsize="x-small", color="0.6")
            continue
        end = min(error, right)
        ax.plot([before, end], [row, row], color=colour, lw=2.5, zorder=2, solid_capstyle="butt")
        ax.plot(end, row, "o", color=colour, ms=8, zorder=3)
        side = ("right", -7) if end < before and end > 1 + 0.25 * (before - 1) else ("left", 8)
        at = {"textcoords": "offset points", "va": "center", "ha": side[0], "fontsize": "x-small"}
        ax.annotate(f"{error:.2f}", (end, row), (side[1], 0), **at)
    ax.axvline(before, color=BEFORE, lw=1.6, zorder=1)
    ax.axvline(1.0, color="0.2", lw=1.6, ls="--", zorder=1)
    ax.text(before, -0.75, "before ", color=BEFORE, ha="right", fontsize="x-small", va="bottom")
    ax.text(1.0, -0.75, " noise floor", color="0.2", ha="left", fontsize="x-small", va="bottom")
    low = min([1.0, *known])
    ax.set_xlim(low - 0.06 * (right - low), right + 0.02 * (right - low))
    ax.set_xlabel("held-out error with it, all parameters refitted [times the noise]", fontsize="small")
    ax.set_title("refitted", loc="left", fontsize="small", fontweight="bold", pad=16)


def _step(axes: Sequence[Axes], step: Step, before: float) -> None:
    refitted = {trial.id: trial.check.normalised_rms for trial in step.trials}
    shares = {c.effect.id: c.share for c in step.screened}
    names = list(refitted) + [name for name in shares if name not in refitted and shares[name] > 0.005]
    names = names[: max(_MOST_ROWS, len(refitted))]
    colour = {name: ALIKE if name in step.equivalent else OTHER for name in names} | {step.chosen.id: AFTER}
    colours = [colour[name] for name in names]
    _bars(axes[0], [shares.get(name, 0.0) for name in names], colours)
    _refits(axes[1], [refitted.get(name) for name in names], colours, before)
    axes[0].set_yticks(range(len(names)), [_name(name) for name in names])
    for label, name in zip(axes[0].get_yticklabels(), names, strict=True):
        label.set_fontweight("bold" if name == step.chosen.id else "normal")
    axes[1].set_yticks(range(len(names)), [""] * len(names))
    for ax in axes:
        ax.set_ylim(len(names) - 0.4, -0.9)
        _tidy(ax)
        ax.grid(axis="y", visible=False)


def _rows(step: Step) -> int:
    """How many candidates `_step` shows."""
    refitted = {trial.id for trial in step.trials}
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
        ax.set_yticks(range(len(first)), [_name(c.effect.id) for c in first])
        ax.set_ylim(len(first) - 0.4, -0.6)
        _tidy(ax)
        ax.grid(axis="y", visible=False)
        return figure
    counts = [_rows(step) for step in steps]
    figure = Figure(figsize=(11, 0.6 + sum(1.1 + 0.3 * n for n in counts)), layout="constrained")
    grid = figure.subplots(len(steps), 2, squeeze=False, width_ratios=(1, 1.5), height_ratios=[n + 3 for n in counts])
    before = found.before.normalised_rms
    for row, step in zip(grid, steps, strict=True):
        _step(row, step, before)
        before = step.chosen.check.normalised_rms
    handles = [Patch(color=AFTER, label="added")]
    if any(step.equivalent for step in steps):
        handles.append(Patch(color=ALIKE, label="not told apart from it by this data"))
    figure.legend(handles=handles, loc="outside lower right", ncols=2, fontsize="small", frameon=False)
    return figure


def times(found: Explanation) -> list[Array] | None:
    """Time [T] of every held-out log, from the logs or else from the missing force; None where neither is there."""
    if found.check is not None:
        return [log.time for log in found.check]
    return [force.time for force in found.localisation.forces] if found.localisation is not None else None


def worst_log(found: Explanation) -> int:
    """Number of the held-out log with the largest error before."""
    return int(np.argmax([np.nanmean(r**2) for r in found.before.residuals]))


def worst_window(residual: Array, time: Array, length: float = _WINDOW) -> tuple[float, float]:
    """The stretch of `length` seconds with the largest squared residual."""
    squares = np.nansum(residual**2, axis=1)
    samples = max(min(int(length / np.median(np.diff(time))), len(time) - 1), 1)
    first = int(np.argmax(np.convolve(squares, np.ones(samples), mode="valid")))
    return float(time[first]), float(time[min(first + samples, len(time) - 1)])


def before_after(found: Explanation) -> Figure | None:
    """The worst held-out log: residuals before and after over the whole run; its worst seconds enlarged.

    Left, one row a channel: residual in units of the noise, which stays in the grey band 95 % of the time when nothing
    is missing. Right: measured and simulated in the shaded stretch (only where the logs are there).
    """
    time = times(found)
    if time is None:
        return None
    e = worst_log(found)
    channels, shown = list(found.before.by_channel), states(found)
    window = worst_window(found.before.residuals[e], time[e])
    wide = found.check is not None
    figure = Figure(figsize=(11.5, 1.0 + 1.9 * len(channels)), layout="constrained")
    grid = figure.subplots(len(channels), 1 + wide, squeeze=False, sharex="col",
                           width_ratios=(1.9, 1.0) if wide else (1.0,))  # fmt: skip
    for i, name in enumerate(channels):
        ax = grid[i, 0]
        ax.axhspan(-1.96, 1.96, color=_NOISE, lw=0, zorder=0)
        for state, _, colour, _ in shown:
            ax.plot(time[e], state.residuals[e][:, i], color=colour, lw=0.8)
        largest = [np.nanquantile(np.abs(state.residuals[e][:, i]), 0.999) for state, *_ in shown]
        reach = 1.1 * max(*largest, 4.0)
        ax.set_ylim(-reach, reach)
        ax.set_ylabel(f"{name}: error\n[times the noise]")
        if wide:
            ax.axvspan(*window, fill=False, ec="0.2", lw=1.2, zorder=4)
    if wide:
        _enlarged(found, grid[:, 1], e, window, channels)
    for ax in grid.ravel():
        _tidy(ax)
        ax.margins(x=0.01)
    name = found.check[e].name if found.check is not None else f"held-out log {e + 1}"
    grid[-1, 0].set_xlabel(f"time in {name} [s]")
    if wide:
        grid[-1, 1].set_xlabel("time [s]")
        grid[0, 1].set_title("the framed stretch enlarged", loc="left", fontsize="small", fontweight="bold")
    grid[0, 0].set_title("simulated minus measured", loc="left", fontsize="small", fontweight="bold")
    handles = [Line2D([], [], color=colour, lw=2, label=label) for *_, colour, label in shown]
    handles += [Patch(color=_NOISE, label="95 % of noise alone")]
    if wide:
        handles.append(Line2D([], [], color=_MEASURED, marker=".", ls="", label="measured"))
    figure.legend(handles=handles, loc="outside upper right", ncols=4, fontsize="small", frameon=False)
    figure.align_ylabels(grid[:, 0])
    return figure


def _enlarged(
    found: Explanation, axes: Sequence[Axes], e: int, window: tuple[float, float], channels: Sequence[str]
) -> None:
    assert found.check is not None
    log = found.check[e]
    only = type(found.check)([log])
    shown = (log.time >= window[0]) & (log.time <= window[1])
    simulated = [(simulate(robot, only)[0], colour) for _, robot, colour, _ in states(found)]
    for ax, name in zip(axes, channels, strict=True):
        column = log.channels.measured.index(name)
        ax.plot(log.time[shown], log.output(name)[shown], ".", ms=3, color=_MEASURED)
        for outputs, colour in simulated:
            ax.plot(log.time[shown], outputs[shown, column], color=colour, lw=1.8)
        unit = log.channels.units.get(name, "")
        ax.set_ylabel(f"{name} [{unit}]" if unit else name)


def correlation(parts: Sequence[Array], lags: int = _LAGS) -> Array:
    """Autocorrelation [lags + 1] of residuals in several logs, never across two; an offset counts as correlation."""
    clean = [np.nan_to_num(part) for part in parts]
    lags = min(lags, max(len(part) for part in clean) - 1)
    power = max(sum(float(part @ part) for part in clean), 1e-300)
    products = [sum(float(p[k:] @ p[: len(p) - k]) for p in clean if len(p) > k) for k in range(lags + 1)]
    return np.array(products) / power


def spectrum(parts: Sequence[Array], interval: float) -> tuple[Array, Array]:
    """Frequency [Hz] and power of the residuals in units of the noise's, which is 1 at every frequency (Welch)."""
    n = min(256, min(len(part) for part in parts))
    found = [signal.welch(np.nan_to_num(part), 1.0 / interval, nperseg=n, detrend=False) for part in parts]
    weights = [len(part) for part in parts]
    power = np.average([p for _, p in found], axis=0, weights=weights)
    # One-sided density of white noise of variance 1 is 2 / rate; the two ends of the spectrum have half of it.
    level = np.full(len(power), 2.0 * interval)
    level[0] /= 2.0
    level[-1] /= 2.0 if n % 2 == 0 else 1.0
    return found[0][0][1:], (power / level)[1:]


def whiteness(found: Explanation) -> Figure | None:
    """Autocorrelation and spectrum of the held-out residuals before and after, one row a channel."""
    time = times(found)
    if time is None:
        return None
    interval = float(np.median(np.diff(time[0])))
    channels, shown = list(found.before.by_channel), states(found)
    figure = Figure(figsize=(11.5, 0.9 + 1.9 * len(channels)), layout="constrained")
    grid = figure.subplots(len(channels), 2, squeeze=False, sharex="col")
    for i, name in enumerate(channels):
        auto, power = grid[i]
        for state, _, colour, _ in shown:
            parts = [r[:, i] for r in state.residuals if np.isfinite(r[:, i]).any()]
            if not parts:
                continue
            rho = correlation(parts)
            lag = np.arange(len(rho)) * interval
            auto.fill_between(lag, 0.0, rho, color=colour, alpha=0.3, lw=0)
            auto.plot(lag, rho, color=colour, lw=1.6)
            power.loglog(*spectrum(parts, interval), color=colour, lw=1.4)
        count = max(sum(np.count_nonzero(np.isfinite(r[:, i])) for r in found.before.residuals), 1)
        auto.axhspan(-1.96 / count**0.5, 1.96 / count**0.5, color="0.75", lw=0, zorder=0)
        auto.set_ylim(min(-0.15, *auto.get_ylim()), 1.05)
        power.axhline(1.0, color="0.2", lw=1.4, ls="--")
        power.set_ylim(0.1, max(20.0, power.get_ylim()[1]))
        auto.set_ylabel(f"{name}\ncorrelation [-]")
        power.set_ylabel("power\n[times the noise's]")
        for ax in (auto, power):
            _tidy(ax)
    grid[0, 0].set_title("residual's correlation with itself", loc="left", fontsize="small", fontweight="bold")
    grid[0, 1].set_title("residual's spectrum", loc="left", fontsize="small", fontweight="bold")
    grid[-1, 0].set_xlabel("lag [s]")
    grid[-1, 1].set_xlabel("frequency [Hz]")
    handles = [Line2D([], [], color=colour, lw=2, label=label) for *_, colour, label in shown]
    handles += [Line2D([], [], color="0.2", ls="--", label="noise alone"), Patch(color="0.75", label="95 % of noise")]
    figure.legend(handles=handles, loc="outside upper right", ncols=4, fontsize="small", frameon=False)
    return figure


def moved(found: Explanation) -> Figure | None:
    """The robot's own parameters before (orange) and after (green) with 95 % intervals, relative to the value after."""
    pairs = {n: p for n, p in found.moved.items() if p[1].value != 0 and np.isfinite(p[1].value)}
    if not pairs or not found.effects:
        return None
    relative = {
        name: [
            (100 * (e.value / after.value - 1), *sorted(100 * (end / after.value - 1) for end in e.ci95))
            for e in (before, after)
        ]
        for name, (before, after) in pairs.items()
    }
    ends = np.array([v for own in relative.values() for row in own for v in row])
    reach = float(np.clip(1.15 * np.max(np.abs(ends[np.isfinite(ends)])), 2.0, 100.0))
    figure = Figure(figsize=(8, 1.3 + 0.36 * len(relative)), layout="constrained")
    ax = figure.subplots()
    ax.axvline(0.0, color="0.3", lw=0.8)
    for row, own in enumerate(relative.values()):
        for (value, low, high), colour, shift in zip(own, (BEFORE, AFTER), (-0.14, 0.14), strict=True):
            ax.plot([low, high], [row + shift] * 2, color=colour, lw=2.5, solid_capstyle="butt")
            at = float(np.clip(value, -0.98 * reach, 0.98 * reach))
            shape = "o" if at == value else ">" if value > 0 else "<"
            ax.plot(at, row + shift, shape, color=colour, ms=7)
            if at != value:
                side = ("right", -8) if value > 0 else ("left", 8)
                ax.annotate(f"{value:+.0f} %", (at, row + shift), (side[1], 0), textcoords="offset points",
                            ha=side[0], va="center", fontsize="x-small", color=colour)  # fmt: skip
    ax.set_yticks(range(len(relative)), list(relative))
    ax.set_ylim(len(relative) - 0.5, -0.5)
    ax.set_xlim(-reach, reach)
    ax.set_xlabel("difference from the value after [%]")
    _tidy(ax)
    ax.grid(axis="y", visible=False)
    handles = [Line2D([], [], color=c, marker="o", lw=2, label=n) for c, n in ((BEFORE, "before"), (AFTER, "after"))]
    figure.legend(handles=handles, loc="outside upper right", ncols=2, fontsize="small", frameon=False)
    return figure


def next_inputs(proposed: NextExperiment, units: dict[str, str]) -> Figure:
    """The inputs of the proposed experiment over time."""
    n = len(proposed.input_names)
    figure = Figure(figsize=(9, 0.8 + 0.95 * n), layout="constrained")
    axes = figure.subplots(n, 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for i, (ax, name) in enumerate(zip(axes, proposed.input_names, strict=True)):
        ax.step(proposed.time, proposed.inputs[:, i], where="post", color=COLOURS[0], lw=1.3)
        ax.axhline(0.0, color="0.3", lw=0.8)
        unit = units.get(name, "")
        ax.set_ylabel(f"{name} [{unit}]" if unit else name)
        ax.margins(x=0.01)
        _tidy(ax)
    axes[-1].set_xlabel("time [s]")
    return figure
