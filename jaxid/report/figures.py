"""Figures of a comparison, after figures 3 and 4 of Innocenti et al.; every function returns a matplotlib `Figure`.

No pyplot: nothing global changes, and figures can be made on any thread. A method has the same colour in all of them.
"""

import io
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .._distributions import normal_density
from ..estimate.residual_tests import ChannelTests
from ..logs import Log
from .own_clock import on_own_clock
from .style import COLOURS, MEASURED, NOISE, tidy
from .tables import number, title_of

Array = NDArray[np.float64]

_TIME = "time [s]"
_LETTER = 0.6
"""Width of a letter in units of the font's size."""
_PLAIN = {"fc": "white", "ec": "none", "pad": 1}


@dataclass(frozen=True)
class Ratio:
    """One estimate relative to its reference: `value` and 95 % interval as ratios (NaN where there is none)."""

    value: float
    low: float
    high: float


def colours(labels: Sequence[str]) -> dict[str, str]:
    """One colour for each method."""
    return {label: COLOURS[i % len(COLOURS)] for i, label in enumerate(labels)}


def _quantity(log: Log, name: str) -> str:
    unit = log.channels.units.get(name, "")
    return f"{name} [{unit}]" if unit else name


def response(
    log: Log,
    channels: Sequence[str],
    simulated: Mapping[str, Array],
    noise: Mapping[str, float],
    words: Mapping[str, str],
) -> Figure:
    """Figure 3: inputs, then every channel measured and simulated by each method, its residual below.

    `simulated` holds [samples, channels.measured] by method label, `words` what the legend says of each method: its
    name and, in brackets, the RMS of its residual in units of the noise. The grey band is where noise alone lies in
    95 % of the samples. A simulation that leaves the picture is cut off there.
    """
    colour = colours(list(simulated))
    ratios = [0.9] + [1.7, 0.8] * len(channels)
    figure = Figure(figsize=(9.5, 1.0 + 1.05 * sum(ratios)), layout="constrained")
    axes = figure.subplots(len(ratios), 1, sharex=True, squeeze=False, height_ratios=ratios)[:, 0]
    top = axes[0]
    shades = ("0.15", "0.6", "#8c6d31", "#7b4173")
    for i, name in enumerate(log.channels.inputs):
        style = "--" if i % 2 else "-"
        top.step(log.time, log.input(name), style, where="post", lw=1.0, color=shades[i % len(shades)], label=name)
    units = {log.channels.units.get(name, "") for name in log.channels.inputs}
    unit = units.pop() if len(units) == 1 else ""
    top.set_ylabel("input" + (f" [{unit}]" if unit else ""))
    top.legend(fontsize="small", ncols=4, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, borderpad=0)
    for j, name in enumerate(channels):
        upper, lower = axes[1 + 2 * j], axes[2 + 2 * j]
        column = log.channels.measured.index(name)
        y = log.output(name)
        upper.plot(log.time, y, ".", ms=2.5, color=MEASURED, label="measured")
        half = 1.96 * noise[name]
        lower.axhspan(-half, half, color=NOISE, lw=0, label="95 % of noise")
        low, high = float(np.nanmin(y)), float(np.nanmax(y))
        reach, sizes, drawn = 0.0, {}, {}
        for label, outputs in simulated.items():
            own = outputs[:, column]
            # A simulation that diverges ends where it is far out of the picture.
            drawn[label] = np.where(np.abs(own) < 1e3 * max(-low, high, half), own, np.nan)
            error = np.abs(drawn[label] - y)
            error = error[np.isfinite(error)]
            sizes[label] = float(np.median(error)) if error.size else np.inf
            reach = max(reach, float(np.quantile(error, 0.998)) if error.size else 0.0)
        for i, (label, own) in enumerate(drawn.items()):
            # Later methods thinner and dashed, so that one that lies underneath stays visible.
            style = {"lw": max(2.2 - 0.6 * i, 1.0), "ls": ("-", (0, (5, 2)), (0, (2, 1)))[i % 3]}
            upper.plot(log.time, own, color=colour[label], label=words[label], **style)
            # The smaller residual lies on top of the larger one.
            above = 2 + sum(sizes[other] > sizes[label] for other in sizes)
            lower.plot(*on_own_clock(log.time, own - y), lw=0.7, color=colour[label], alpha=0.85, zorder=above)
        margin = 0.15 * max(high - low, 6 * noise[name])
        upper.set_ylim(low - margin, high + margin)
        limit = 1.15 * min(max(reach, 1.5 * half), max(high - low, 3 * half))
        lower.set_ylim(-limit, limit)
        upper.set_ylabel(_quantity(log, name))
        unit = log.channels.units.get(name, "")
        lower.set_ylabel("residual" + (f"\n[{unit}]" if unit else ""), fontsize="small")
    for ax in axes:
        tidy(ax)
        ax.margins(x=0.01)
    axes[-1].set_xlabel(_TIME)
    figure.align_ylabels(axes)
    handles, labels = axes[1].get_legend_handles_labels()
    more, words = axes[2].get_legend_handles_labels()
    figure.legend(handles + more, labels + words, loc="outside lower center", ncols=4, fontsize="small", frameon=False)
    title = f"{log.name}: measured and simulated (in brackets: RMS of the residual, 1 = noise alone)"
    figure.suptitle(title, fontsize="medium", x=0.01, ha="left")
    return figure


def residuals(
    channel: str,
    unit: str,
    parts: Mapping[str, Mapping[str, Array]],
    times: Mapping[str, Array],
    tests: Mapping[str, ChannelTests],
    noise: float,
) -> Figure:
    """Figure 4 of one channel, one row a method: residual over time, its histogram, its autocorrelation.

    `parts[method][log]` [samples] are residuals; the logs of `times` [samples] stand side by side. All rows share
    their scales.
    """
    labels = [label for label in parts if label in tests]
    colour = colours(list(parts))
    figure = Figure(figsize=(11, 0.8 + 2.3 * max(len(labels), 1)), layout="constrained")
    grid = figure.subplots(max(len(labels), 1), 3, squeeze=False, width_ratios=(2.2, 1, 1), sharex="col")
    figure.suptitle(f"Residual of {channel} on the held-out logs", fontsize="medium", x=0.01, ha="left")
    every = np.concatenate([e[np.isfinite(e)] for label in labels for e in parts[label].values()] or [np.zeros(1)])
    limit = 1.1 * max(float(np.quantile(np.abs(every), 0.999)), 3.0 * noise)
    begins, shift = {}, 0.0
    for name, time in times.items():
        begins[name] = shift - float(time[0])
        shift += float(time[-1] - time[0]) + 0.03 * float(time[-1] - time[0])
    bins = np.linspace(-limit, limit, 61)
    grid_x = np.linspace(-limit, limit, 400)
    suffix = f" [{unit}]" if unit else ""
    for row, label in enumerate(labels):
        over, spread, auto = grid[row]
        own = np.concatenate([e[np.isfinite(e)] for e in parts[label].values()])
        for name, e in parts[label].items():
            over.plot(*on_own_clock(times[name] + begins[name], e), lw=0.5, color=colour[label])
        for name in times.keys() - parts[label].keys():
            middle = float(times[name][0] + times[name][-1]) / 2 + begins[name]
            over.text(middle, 0.0, "diverges", ha="center", va="center", fontsize="small", color=colour[label])
        over.axhspan(-1.96 * noise, 1.96 * noise, color=NOISE, lw=0, zorder=0)
        over.set_ylim(-limit, limit if row else 1.22 * limit)
        over.set_ylabel(f"residual{suffix}")
        over.set_title(title_of(label), loc="left", fontsize="small", color=colour[label], fontweight="bold")
        spread.hist(own, bins=list(bins), density=True, color=colour[label], alpha=0.45)
        spread.plot(grid_x, normal_density(grid_x, own.mean(), max(own.std(), 1e-300)), color=colour[label], lw=1.5,
                    label="Gaussian fit")  # fmt: skip
        spread.plot(grid_x, normal_density(grid_x, 0.0, noise), "k:", lw=1.2, label="noise alone")
        spread.set_title(f"mean {number(own.mean(), 2)}, std {number(own.std(), 3)}{suffix}", fontsize="small")
        spread.set_yticks([])
        rho, band = tests[label].autocorrelation, tests[label].band95
        auto.axhspan(-band, band, color=NOISE, lw=0, label="95 % of white noise")
        lags = np.flatnonzero(rho)  # at the others there are no two samples, where another sensor has rows of its own
        auto.vlines(lags, 0.0, rho[lags], color=colour[label], lw=1.5)
        auto.plot(lags, rho[lags], "o", ms=3, color=colour[label])
        auto.axhline(0.0, color="0.3", lw=0.6)
        auto.set_ylim(min(-0.2, float(rho.min()) - 0.1), 1.08)
        test = tests[label].whiteness
        verdict = "not tested" if np.isnan(test.p_value) else "not white" if test.rejected else "white"
        auto.set_title(f"autocorrelation: {verdict}", fontsize="small")
        for ax in (over, spread, auto):
            tidy(ax)
        if row == 0:
            for name in times:
                at = times[name][0] + begins[name], 1.2 * limit
                over.text(*at, name, fontsize="x-small", va="top", color="0.25", bbox=_PLAIN)
            spread.legend(fontsize="x-small", frameon=False)
            auto.legend(fontsize="x-small", frameon=False)
    grid[-1, 0].set_xlabel("time, logs side by side [s]")
    grid[-1, 1].set_xlabel(f"residual{suffix}")
    grid[-1, 2].set_xlabel("lag [samples]")
    return figure


def parameters(
    ratios: Mapping[str, Mapping[str, Ratio]],
    reference: str,
    left_out: Sequence[str] = (),
    doubtful: Collection[str] = (),
) -> Figure:
    """Every estimate with its 95 % interval relative to the `reference`, `ratios[parameter][method]`.

    What lies outside the picture stands at its edge with its number; `left_out` are parameters whose reference is zero, and
    `doubtful` methods whose intervals may not hold: these are dotted.
    """
    names = list(ratios)
    labels = list(dict.fromkeys(label for own in ratios.values() for label in own))
    colour = colours(labels)
    # The picture shows what most estimates and intervals span; far ones widen it at most threefold.
    every = [r for own in ratios.values() for r in own.values() if np.isfinite(r.value)]
    away = np.abs(
        np.array([edge for r in every for edge in (r.value, r.low, r.high) if np.isfinite(edge)] or [1.0]) - 1
    )
    most, farthest = float(np.quantile(away, 0.9)), float(away.max())
    half = float(np.clip(1.1 * min(farthest, 3.0 * most), 0.02, 1.0))
    figure = Figure(figsize=(8, 1.3 + max(len(names), 1) * (0.22 + 0.16 * len(labels))), layout="constrained")
    ax = figure.subplots()
    ax.axvline(1.0, color="0.2", lw=1.0)
    for row, name in enumerate(names):
        if row % 2 == 0:
            ax.axhspan(row - 0.5, row + 0.5, color="0.96", lw=0, zorder=0)
        for i, label in enumerate(labels):
            r = ratios[name].get(label)
            if r is None or not np.isfinite(r.value):
                continue
            y = row + (i - (len(labels) - 1) / 2) * 0.7 / max(len(labels), 1)
            if np.isfinite(r.low) and np.isfinite(r.high):
                line = ":" if label in doubtful else "-"
                ax.plot([r.low, r.high], [y, y], line, color=colour[label], lw=2.0, solid_capstyle="butt")
            if abs(r.value - 1.0) > half:
                side = np.sign(r.value - 1.0)
                ax.plot(1.0 + 0.985 * side * half, y, ">" if side > 0 else "<", color=colour[label], ms=6)
                at, place = (1.0 + 0.97 * side * half, y), "right" if side > 0 else "left"
                text = ax.annotate(number(r.value, 3), at, (-6 * side, 0), textcoords="offset points", ha=place)
                text.set(va="center", fontsize="x-small", color=colour[label], bbox=_PLAIN)
            else:
                shape = "o" if np.isfinite(r.low) else "D"
                ax.plot(r.value, y, shape, color=colour[label], ms=5, mfc=colour[label] if shape == "o" else "white")
    for label in labels:
        line, doubt = (":", " (may not hold)") if label in doubtful else ("-", "")
        ax.plot([], [], "o" + line, color=colour[label], ms=5, lw=2, label=title_of(label) + doubt)
    if any(not np.isfinite(r.low) and np.isfinite(r.value) for own in ratios.values() for r in own.values()):
        ax.plot([], [], "D", color="0.4", mfc="white", ms=5, label="no interval (not identified)")
    ax.set_yticks(range(len(names)), names)
    ax.set_ylim(len(names) - 0.5, -0.5)
    ax.set_xlim(1.0 - half, 1.0 + half)
    note = f"    (no ratio: {', '.join(left_out)}, {reference} 0)" if left_out else ""
    ax.set_xlabel(f"estimate with 95 % interval / {reference}{note}")
    tidy(ax)
    ax.grid(axis="y", visible=False)
    figure.legend(loc="outside upper center", ncols=3, fontsize="small", frameon=False)
    return figure


def _shrink_labels(figure: Figure) -> None:
    """Makes labels of y axes, which carry the logs' own column names, as small as their axes ask."""
    for ax in figure.axes:
        label = ax.yaxis.label
        longest = max(map(len, label.get_text().split("\n")))
        size = float(label.get_fontsize())
        room = 72.0 * ax.bbox.height / figure.dpi  # points
        label.set_fontsize(size * min(1.0, room / max(_LETTER * longest * size, room)))


def as_png(figure: Figure, dpi: int = 110) -> bytes:
    """The figure as a PNG file's bytes."""
    _shrink_labels(figure)
    figure.set_dpi(dpi)
    layout = figure.get_layout_engine()
    if layout is not None:
        # Laid out here, not by a whole drawing that is thrown away, which takes as long as the picture itself.
        layout.execute(figure)
        figure.set_layout_engine(None)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, pil_kwargs={"compress_level": 3})
    return buffer.getvalue()
