"""Figures of an explanation; every function returns a matplotlib `Figure`. Orange is before, green is after.

Residuals are in units of the noise's standard deviation throughout, so that 1 is the noise floor.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.mlab import psd
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..explanation.explanation import Explanation
from ..explanation.left.heldout import HeldOut
from ..explanation.next_experiment import NextExperiment
from .own_clock import on_own_clock, own_interval, own_rows
from .style import COLOURS, tidy

Array = NDArray[np.float64]

BEFORE, AFTER = COLOURS[1], COLOURS[2]
_MEASURED, _NOISE = "0.45", "0.88"
_LAGS = 50
_WINDOW, _SMOOTHED = 0.1, 0.01
"""Length of the enlarged stretch and of moving averages, in shares of the longest log."""


def states(found: Explanation) -> list[tuple[HeldOut, str, str]]:
    """What there is to compare: held-out state, colour and label, before and after; one where nothing was added."""
    if found.effects:
        return [(found.before, BEFORE, "before"), (found.after, AFTER, "after")]
    return [(found.before, AFTER if found.verdict == "adequate" else BEFORE, "model")]


def size_of(residual: Array) -> float:
    """Mean square of one log's residual [T, channels], zero where nothing was measured."""
    return float(np.nanmean(residual**2)) if np.isfinite(residual).any() else 0.0


def worst_log(found: Explanation) -> int:
    """Number of the held-out log with the largest error before."""
    return int(np.argmax([size_of(r) for r in found.before.residuals]))


def worst_window(residual: Array, time: Array, length: float) -> tuple[float, float]:
    """The stretch of `length` seconds with the largest squared residual."""
    squares = np.nansum(residual**2, axis=1)
    samples = max(min(round(length / float(np.median(np.diff(time)))), len(time) - 1), 1)
    first = int(np.argmax(np.convolve(squares, np.ones(samples), mode="valid")))
    return float(time[first]), float(time[min(first + samples, len(time) - 1)])


def _mean_over(values: Array, time: Array, length: float) -> Array:
    """Moving average over `length` seconds."""
    n = max(round(length / float(np.median(np.diff(time)))), 1)
    there = np.convolve(np.isfinite(values), np.ones(n), mode="same")
    return np.convolve(np.nan_to_num(values), np.ones(n), mode="same") / np.maximum(there, 1)


def before_after(found: Explanation) -> Figure:
    """The worst held-out log: residuals before and after over the whole run; its worst tenth enlarged.

    Left, one row a channel: residual in units of the noise, which stays in the grey band 95 % of the time when nothing
    is missing (thick: its mean over a hundredth of the log). Right: measured and simulated in the framed
    stretch.
    """
    time = [log.time for log in found.held_out]
    e = worst_log(found)
    channels, shown = list(found.before.by_channel), states(found)
    longest = max(float(np.ptp(own)) for own in time)
    window = worst_window(found.before.residuals[e], time[e], _WINDOW * longest)
    figure = Figure(figsize=(11.5, 1.0 + 1.9 * len(channels)), layout="constrained")
    grid = figure.subplots(len(channels), 2, squeeze=False, sharex="col", width_ratios=(1.9, 1.0))
    for i, name in enumerate(channels):
        ax = grid[i, 0]
        ax.axhspan(-1.96, 1.96, color=_NOISE, lw=0, zorder=0)
        for state, colour, _ in shown:
            error = state.residuals[e][:, i]
            ax.plot(*on_own_clock(time[e], error), color=colour, lw=0.5, alpha=0.4)
            ax.plot(time[e], _mean_over(error, time[e], _SMOOTHED * longest), color=colour, lw=1.6, zorder=3)
        largest = [np.nanquantile(np.abs(state.residuals[e][:, i]), 0.999) for state, *_ in shown]
        reach = 1.1 * max(*largest, 4.0)
        ax.set_ylim(-reach, reach)
        ax.set_ylabel(f"{name}: error\n[times the noise]")
        ax.axvspan(*window, fill=False, ec="0.2", lw=1.2, zorder=4)
    _enlarged(found, list(grid[:, 1]), e, window, channels)
    for ax in grid.ravel():
        tidy(ax)
        ax.margins(x=0.01)
    grid[-1, 0].set_xlabel(f"time in {found.held_out[e].name} [s]")
    grid[-1, 1].set_xlabel("time [s]")
    grid[0, 1].set_title("the framed stretch enlarged", loc="left", fontsize="small", fontweight="bold")
    grid[0, 0].set_title("simulated minus measured", loc="left", fontsize="small", fontweight="bold")
    handles = [Line2D([], [], color=colour, lw=2, label=label) for *_, colour, label in shown]
    handles += [Patch(color=_NOISE, label="95 % of noise alone")]
    handles.append(Line2D([], [], color=_MEASURED, marker=".", ls="", label="measured"))
    figure.legend(handles=handles, loc="outside upper right", ncols=4, fontsize="small", frameon=False)
    figure.align_ylabels(grid[:, 0])
    return figure


def _enlarged(
    found: Explanation, axes: Sequence[Axes], e: int, window: tuple[float, float], channels: Sequence[str]
) -> None:
    log = found.held_out[e]
    shown = (log.time >= window[0]) & (log.time <= window[1])
    for ax, name in zip(axes, channels, strict=True):
        column = log.channels.measured.index(name)
        ax.plot(log.time[shown], log.output(name)[shown], ".", ms=3, color=_MEASURED)
        for state, colour, _ in states(found):
            error = state.noise[name] * state.residuals[e][:, list(state.by_channel).index(name)]
            there = shown & np.isfinite(error)
            ax.plot(log.time[there], (log.outputs[:, column] + error)[there], color=colour, lw=1.8)
        unit = log.channels.units.get(name, "")
        ax.set_ylabel(f"{name} [{unit}]" if unit else name)


def residuals_of(found: Explanation, state: HeldOut, i: int) -> tuple[list[Array], float]:
    """Held-out residuals [samples] of channel `i` in rows of its own clock, and the interval between two of them."""
    measured = [(log.time, r[:, i]) for log, r in zip(found.held_out, state.residuals, strict=True)]
    measured = [(time, part) for time, part in measured if np.isfinite(part).any()]
    interval = own_interval([time for time, _ in measured], [part for _, part in measured])
    return [own_rows(time, part, interval) for time, part in measured], interval


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
    found: Any = [psd(np.nan_to_num(part), NFFT=n, Fs=1.0 / interval, noverlap=n // 2) for part in parts]
    weights = [len(part) for part in parts]
    power = np.average([p for p, _ in found], axis=0, weights=weights)
    # One-sided density of white noise of variance 1 is 2 / rate; the two ends of the spectrum have half of it.
    level = np.full(len(power), 2.0 * interval)
    level[0] /= 2.0
    level[-1] /= 2.0 if n % 2 == 0 else 1.0
    return found[0][1][1:], (power / level)[1:]


def whiteness(found: Explanation) -> Figure:
    """Autocorrelation and spectrum of the held-out residuals before and after, one row a channel."""
    channels, shown = list(found.before.by_channel), states(found)
    figure = Figure(figsize=(11.5, 0.9 + 1.9 * len(channels)), layout="constrained")
    grid = figure.subplots(len(channels), 2, squeeze=False, sharex="col")
    for i, name in enumerate(channels):
        auto, power = grid[i]
        for state, colour, _ in shown:
            parts, interval = residuals_of(found, state, i)
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
            tidy(ax)
    grid[0, 0].set_title("residual's correlation with itself", loc="left", fontsize="small", fontweight="bold")
    grid[0, 1].set_title("residual's spectrum", loc="left", fontsize="small", fontweight="bold")
    grid[-1, 0].set_xlabel("lag [s]")
    grid[-1, 1].set_xlabel("frequency [Hz]")
    handles = [Line2D([], [], color=colour, lw=2, label=label) for *_, colour, label in shown]
    handles += [Line2D([], [], color="0.2", ls="--", label="noise alone"), Patch(color="0.75", label="95 % of noise")]
    figure.legend(handles=handles, loc="outside upper right", ncols=4, fontsize="small", frameon=False)
    figure.align_ylabels(grid)
    return figure


def moved(found: Explanation) -> Figure | None:
    """The robot's own parameters before (orange) and after (green) with 95 % intervals, relative to the larger one."""
    pairs = {name: pair for name, pair in found.moved.items() if any(e.value for e in pair)}
    if not pairs or not found.effects:
        return None
    figure = Figure(figsize=(8, 1.3 + 0.36 * len(pairs)), layout="constrained")
    ax = figure.subplots()
    ax.axvline(0.0, color="0.3", lw=0.8)
    farthest = 2.0
    for row, (before, after) in enumerate(pairs.values()):
        size = max(abs(before.value), abs(after.value))
        for e, colour, shift in ((before, BEFORE, -0.14), (after, AFTER, 0.14)):
            low, value, high = (100 * (v - after.value) / size for v in (e.ci95[0], e.value, e.ci95[1]))
            sure = e.status == "identified"
            if sure:
                ax.plot([low, high], [row + shift] * 2, color=colour, lw=2.5, solid_capstyle="butt")
            ax.plot(value, row + shift, "o", color=colour, ms=7, mfc=colour if sure else "white")
            farthest = max(farthest, abs(value), *([abs(low), abs(high)] if sure else []))
        ax.annotate("", (0.0, row), (100 * (before.value - after.value) / size, row), zorder=1,
                    arrowprops={"arrowstyle": "->", "color": "0.6", "lw": 1.0})  # fmt: skip
    ax.set_yticks(range(len(pairs)), list(pairs))
    ax.set_ylim(len(pairs) - 0.5, -0.5)
    reach = min(1.12 * farthest, 120.0)
    ax.set_xlim(-reach, reach)
    ax.set_xlabel("difference from the value after [% of the larger of the two]")
    tidy(ax)
    ax.grid(axis="y", visible=False)
    handles = [Line2D([], [], color=c, marker="o", lw=2, label=n) for c, n in ((BEFORE, "before"), (AFTER, "after"))]
    if any(e.status != "identified" for pair in pairs.values() for e in pair):
        handles.append(
            Line2D([], [], color="0.4", marker="o", ls="", mfc="white", label="at a bound or not identified")
        )
    figure.legend(handles=handles, loc="outside upper right", ncols=3, fontsize="small", frameon=False)
    return figure


def next_inputs(proposed: NextExperiment, units: Mapping[str, str]) -> Figure:
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
        tidy(ax)
    axes[-1].set_xlabel("time [s]")
    return figure
