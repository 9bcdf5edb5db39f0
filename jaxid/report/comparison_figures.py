"""Figures of a comparison from what it holds. Imported when one is drawn, since matplotlib takes long to import."""

import numpy as np
from matplotlib.figure import Figure

from ..estimate.confidence.agreement import counted_channels
from . import figures as draw
from . import tables as tab
from .comparison import Comparison


def held_out_response(found: Comparison, name: str) -> Figure:
    """A held-out log as every method predicts it."""
    log = found.logs[name]
    simulated = {label: v.simulated[name] for label, v in found.predicted.items()}
    words = {}
    for label, v in found.predicted.items():
        own = v.by_log[name]
        words[label] = f"{tab.title_of(label)} ({'diverges' if own.diverged else f'{own.normalised_rms:.2f}'})"
    return draw.response(log, counted_channels(log), simulated, found.noise, words)


def channel_residuals(found: Comparison, channel: str) -> Figure:
    """What every method leaves in a channel."""
    times = {log.name: log.time for log in found.logs if channel in counted_channels(log)}
    parts = {label: v.residuals[channel] for label, v in found.predicted.items()}
    tests = {label: v.tests[channel] for label, v in found.predicted.items() if channel in v.tests}
    return draw.residuals(channel, found._unit(channel), parts, times, tests, found.noise[channel])


def ratios(found: Comparison) -> Figure:
    """Estimates relative to the reference, or to the last method's where there is none."""
    names, combined = found._names
    last = list(found.fits)[-1]
    known = {name: found.references.get(name, np.nan) for name in names + combined}
    what = f"{found.reference} value"
    if not np.isfinite(list(known.values())).any():
        known, what = {name: found._value_of(last, name) for name in known}, tab.title_of(last)
    relative: dict[str, dict[str, draw.Ratio]] = {}
    left_out = [name for name, reference in known.items() if not (np.isfinite(reference) and reference != 0)]
    for name, reference in known.items():
        own = {label: e for label in found.fits if (e := found._estimate(label, name))}
        # A parameter that nobody estimated is not worth a line.
        if name in left_out or all(e.status == "fixed" for e in own.values()):
            continue
        relative[name] = {}
        for label, e in own.items():
            edges = [edge / reference for edge in e.ci95] if e.status == "identified" else [np.nan, np.nan]
            relative[name][label] = draw.Ratio(e.value / reference, min(edges), max(edges))
    return draw.parameters(relative, what, left_out, found._doubtful)
