"""Charts of a page: panels over one axis as inlined SVG, which the page's script zooms and pans; without it they stand still.

Paths are written once, in whole numbers of a square of `_X` by `_Y` that the browser stretches to the panel, so that a zoom is
another window on that square and lines keep their width on a telephone as on a wide screen.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Style = Literal["line", "dots", "thin", "step", "dashed"]

_X, _Y = 100_000, 10_000
_MOST = 6000
"""Points of a trace; of longer ones the smallest and the largest of every stretch are drawn."""
_MARGIN = 0.06
_TICKS = (1.0, 2.0, 2.5, 5.0, 10.0)


@dataclass(frozen=True)
class Trace:
    """One line, or dots: `x`, `y` [n] (NaN: a gap), its `colour` ("measured", "input", or a number of the palette, as the
    legend has it) and `label` (empty: not in the legend)."""

    x: Array
    y: Array
    colour: str
    label: str = ""
    style: Style = "line"


@dataclass(frozen=True)
class Panel:
    """Traces over one quantity with its unit: `title`, such as "yaw rate eta2 [rad/s]".

    `low`, `high`: what of it is shown (all by default). `bands`: (x, lower, upper) each, `level`: half width of a band about
    zero; `marked`: stretches of x that are shaded; `small`: half as high, as residuals are. `follows`: whether a zoom also
    fits the height.
    """

    title: str
    traces: tuple[Trace, ...]
    low: float | None = None
    high: float | None = None
    level: float | None = None
    bands: tuple[tuple[Array, Array, Array, str], ...] = ()
    marked: tuple[tuple[float, float], ...] = ()
    small: bool = False
    follows: bool = False


@dataclass(frozen=True)
class Chart:
    """Panels over one axis `x_title`, with what they show in words for who does not see them (`alt`) and a `caption`."""

    panels: tuple[Panel, ...]
    alt: str
    caption: str = ""
    x_title: str = "time [s]"
    band_label: str = ""
    marked_label: str = ""

    @property
    def start(self) -> float:
        return min(float(np.nanmin(t.x)) for p in self.panels for t in p.traces)

    @property
    def stop(self) -> float:
        stop = max(float(np.nanmax(t.x)) for p in self.panels for t in p.traces)
        return stop if stop > self.start else self.start + 1.0

    @property
    def legend(self) -> list[tuple[str, str, str]]:
        """(label, colour, style) of every trace that has a label, each once."""
        every = [(t.label, t.colour, t.style) for p in self.panels for t in p.traces if t.label]
        return list(dict.fromkeys(every))

    @property
    def thinned(self) -> bool:
        """Whether some trace has more points than are drawn."""
        return any(len(t.x) > _MOST for p in self.panels for t in p.traces)

    @property
    def drawn(self) -> "list[Drawn]":
        """The panels as the template needs them."""
        return [_drawn(panel, self.start, self.stop) for panel in self.panels]

    @property
    def x_ticks(self) -> list[tuple[str, float]]:
        """Labels of the axis and where they stand, in per cent."""
        return [(text, 100 * (at - self.start) / (self.stop - self.start)) for text, at in ticks(self.start, self.stop)]


@dataclass(frozen=True)
class Drawn:
    """A panel as numbers in the square: paths (data, colour, style), bands (data, colour), shaded stretches (from, width),
    labels of the y axis and where they stand [%], and the values at bottom and top."""

    title: str
    paths: list[tuple[str, str, str]]
    bands: list[tuple[str, str]]
    marked: list[tuple[int, int]]
    y_ticks: list[tuple[str, float]]
    low: float
    high: float
    small: bool
    follows: bool
    size: tuple[int, int] = (_X, _Y)


def ticks(low: float, high: float, most: int = 6) -> list[tuple[str, float]]:
    """Round numbers between two values, at most `most` + 1 of them, with as many digits as tell them apart."""
    at, step = np.zeros(0), 1.0
    while len(at) < 2:  # one label alone tells no scale
        rough = (high - low) / most
        power = 10.0 ** np.floor(np.log10(rough))
        step = float(next(t * power for t in _TICKS if t * power >= rough * (1 - 1e-9)))
        at = np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step
        most += 1
    leading = step / 10 ** np.floor(np.log10(step) + 1e-9)
    digits = max(0, -int(np.floor(np.log10(step) + 1e-9)) + (abs(leading - 2.5) < 0.01))
    largest = max(abs(low), abs(high))
    short = step >= 1e-4 and largest < 1e6
    significant = int(np.ceil(np.log10(largest / step))) + 2

    def said(x: float) -> str:
        if abs(x) < 1e-6 * step:
            return "0"
        return (f"{x:.{digits}f}" if short else f"{x:.{significant}g}".replace("e-0", "e-")).replace("-", "−")

    return [(said(float(x)), float(x)) for x in at]


def thinned(x: Array, y: Array, most: int = _MOST) -> tuple[Array, Array]:
    """The smallest and the largest value of every stretch, in their order: no peak is lost. As it is where it is short."""
    if len(x) <= most:
        return x, y
    edges = np.linspace(0, len(x), most // 2 + 1).astype(int)
    keep: list[int] = []
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        part = y[a:b]
        if np.isnan(part).all():
            keep.append(int(a))
        else:
            keep += sorted({int(a + np.nanargmin(part)), int(a + np.nanargmax(part))})
    return x[keep], y[keep]


def _path(x: NDArray[np.int64], y: NDArray[np.int64], there: NDArray[np.bool_], style: str) -> str:
    """The path's data: absolute at its starts, then relative, which is shorter; dots are lines of no length."""
    parts: list[str] = []
    if style == "dots":
        px, py = 0, 0
        for a, b in zip(x[there], y[there], strict=True):
            parts.append(f"m{a - px} {b - py}h0")
            px, py = int(a), int(b)
        return "".join(parts)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        parts.append(f"M{x[a]} {y[a]}")
        if style == "step":
            parts.append("".join(f"h{x[k] - x[k - 1]}v{y[k] - y[k - 1]}" for k in range(a + 1, b)))
        elif b > a + 1:
            dx, dy = np.diff(x[a:b]), np.diff(y[a:b])
            parts.append("l" + " ".join(f"{i} {j}" for i, j in zip(dx, dy, strict=True)))
    return "".join(parts)


def _range(panel: Panel) -> tuple[float, float]:
    """What of the quantity is shown."""
    values = [t.y[np.isfinite(t.y)] for t in panel.traces]
    values += [edge[np.isfinite(edge)] for _, low, high, _ in panel.bands for edge in (low, high)]
    every = np.concatenate([*values, np.zeros(0)])
    low = panel.low if panel.low is not None else float(every.min(initial=np.inf))
    high = panel.high if panel.high is not None else float(every.max(initial=-np.inf))
    if not (np.isfinite(low) and np.isfinite(high)):
        return -1.0, 1.0
    if not high > low:
        size = abs(high) or 1.0
        return low - 0.5 * size, high + 0.5 * size
    margin = _MARGIN * (high - low)
    return (low if panel.low is not None else low - margin), (high if panel.high is not None else high + margin)


def _drawn(panel: Panel, start: float, stop: float) -> Drawn:
    low, high = _range(panel)

    def across(x: Array) -> NDArray[np.int64]:
        return np.round((x - start) / (stop - start) * _X).astype(np.int64)

    def up(y: Array) -> NDArray[np.int64]:
        # What leaves the panel far leaves it all the same.
        return np.round(np.clip((high - np.nan_to_num(y)) / (high - low), -50.0, 50.0) * _Y).astype(np.int64)

    paths = []
    for trace in panel.traces:
        x, y = thinned(np.asarray(trace.x, float), np.asarray(trace.y, float))
        paths.append((_path(across(x), up(y), np.isfinite(y), trace.style), trace.colour, trace.style))
    bands = []
    if panel.level is not None:
        top, bottom = up(np.array([panel.level, -panel.level]))
        bands.append((f"M0 {top}H{_X}V{bottom}H0z", "noise"))
    for x, lower, upper, colour in panel.bands:
        there = np.isfinite(lower) & np.isfinite(upper)
        x, lower, upper = (each[there][:: max(1, len(x) // _MOST)] for each in (x, lower, upper))
        ax, ay = np.concatenate([across(x), across(x)[::-1]]), np.concatenate([up(upper), up(lower)[::-1]])
        bands.append((_path(ax, ay, np.ones(len(ax), bool), "line") + "z", colour))
    marked = [(int(a), max(int(b - a), 60)) for a, b in (across(np.array(span)) for span in panel.marked)]
    shown = ticks(low, high, 3 if panel.small else 4)
    at = [(text, 100 * (high - value) / (high - low)) for text, value in shown]
    return Drawn(panel.title, paths, bands, marked, at, low, high, panel.small, panel.follows)


def stretches(mask: NDArray[np.bool_], x: Array) -> tuple[tuple[float, float], ...]:
    """Stretches of `x` [n] over which a mask [n] holds."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    return tuple((float(x[a]), float(x[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True))


def reach_of(parts: Sequence[Array], least: float, most: float = np.inf) -> float:
    """Half height of a panel of residuals: nearly all of them, at least `least` and at most `most`."""
    sizes = [np.abs(part[np.isfinite(part)]) for part in parts]
    largest = max((float(np.quantile(size, 0.998)) for size in sizes if size.size), default=0.0)
    return 1.15 * min(max(largest, least), most)
