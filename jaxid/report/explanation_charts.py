"""Charts of an explanation: the missing force, measured over simulated before and after, and the experiment to drive next."""

from collections.abc import Mapping

import numpy as np

from ..explanation.explanation import Explanation
from ..explanation.next_experiment import NextExperiment
from ..explanation.where.localise import Localisation
from ..explanation.where.patterns import answering
from ..logs import LogSet
from .chart import Chart, Panel, Trace, reach_of, stretches
from .comparison_page import quantity
from .explanation_figures import correlation, residuals_of, states
from .localisation_figures import worst_log
from .own_clock import on_own_clock

_COLOUR = {"before": "before", "after": "after"}


def force_chart(found: Localisation, logs: LogSet) -> Chart:
    """The missing force of the log that has most of it, with its 95 % band, over the measured speeds."""
    e = worst_log(found)
    force, log = found.forces[e], logs[e]
    follows = answering(found.patterns)
    best = found.standing_out[0] if found.standing_out else None
    marked = stretches(np.asarray(found.marked[e]), log.time) if best is not None and found.marked else ()
    panels, shares = [], []
    for i, name in enumerate(force.names):
        value, half = force.force[:, i], 1.96 * force.std[:, i]
        colour = f"c{i % 3}"
        traces = [Trace(force.time, value, colour, f"missing in {name}")]
        if follows is not None:
            traces.append(Trace(force.time, follows.fitted[e][:, i], "ink", f"fitted to the {follows.name}", "dashed"))
        # Where nothing shows (standstill) the band may leave the picture; the force must fill it.
        reach = 1.15 * (float(np.nanmax(np.abs(value))) + float(np.median(half)))
        share = f"{100 * found.force_share[name]:.0f} % of the missing force"
        shares.append(f"{share} is in {name}")
        title = f"missing in {name} [{force.units[i]}]: {share}"
        bands = ((force.time, value - half, value + half, colour),)
        panels.append(Panel(title, tuple(traces), -reach, reach, bands=bands, marked=marked))
    speeds = [name for name in force.names if name in log.measured] or list(log.measured)[:1]
    for name in speeds:
        dots = (Trace(log.time, log.output(name), "measured", "measured", "dots"),)
        panels.append(Panel(quantity(log, name, {}), dots, marked=marked, small=True, follows=True))
    return Chart(
        tuple(panels),
        alt=f"The missing force over time in {log.name}: {', '.join(shares)}. {found.sentence}",
        caption=f"{log.name}, the held-out log with most of it; shaded beside a line: 95 %.",
        marked_label=best.phrase if best is not None and marked else "",
    )


def before_after_chart(found: Explanation, e: int) -> Chart:
    """Held-out log `e` measured and simulated, before and after, and below it the residual in units of the noise."""
    log = found.held_out[e]
    panels, told = [], []
    for i, name in enumerate(found.before.by_channel):
        column, y = log.channels.measured.index(name), log.output(name)
        traces, left = [Trace(log.time, y, "measured", "measured", "dots")], []
        for state, _, label in states(found):
            error = state.residuals[e][:, i]
            colour = _COLOUR.get(label, "after" if found.verdict == "adequate" else "before")
            shown = f"simulated {label}" if found.effects else "simulated"
            own = on_own_clock(log.time, log.outputs[:, column] + state.noise[name] * error)
            traces.append(Trace(*own, colour, shown))
            left.append(Trace(*on_own_clock(log.time, error), colour, "", "thin"))
            size = float(np.sqrt(np.nanmean(error**2))) if np.isfinite(error).any() else np.nan
            told.append(f"{label} it is {size:.2f} times the noise in {name}")
        there = y[np.isfinite(y)]
        low, high = (float(there.min()), float(there.max())) if there.size else (-1.0, 1.0)
        margin = 0.15 * max(high - low, 6 * found.before.noise[name])
        panels.append(
            Panel(quantity(log, name, found.model.words), tuple(traces), low - margin, high + margin, follows=True)
        )
        reach = reach_of([trace.y for trace in left], 4.0, 1e6)
        panels.append(Panel(f"residual of {name} [times the noise]", tuple(left), -reach, reach, 1.96, small=True))
    alt = f"{log.name}, measured and simulated; the error: {', '.join(told)}."
    return Chart(tuple(panels), alt, band_label="where noise alone lies 95 % of the time")


def whiteness_alt(found: Explanation) -> str:
    """What the pictures of correlation and spectrum show, in words."""
    said = []
    for i, name in enumerate(found.before.by_channel):
        for state, _, label in states(found):
            parts, _ = residuals_of(found, state, i)
            if parts and (own := correlation(parts)).size > 1:
                said.append(f"{name} {label}: correlation of neighbours {own[1]:.2f}")
    return f"The residual's correlation with itself and its spectrum. {'; '.join(said)}."


def next_chart(proposed: NextExperiment, units: Mapping[str, str]) -> Chart:
    """The inputs of the proposed experiment."""
    panels = []
    for k, name in enumerate(proposed.input_names):
        unit = f" [{units[name]}]" if units.get(name) else ""
        panels.append(
            Panel(f"{name}{unit}", (Trace(proposed.time, proposed.inputs[:, k], "c0", "", "step"),), small=True)
        )
    largest = float(np.max(np.abs(proposed.inputs)))
    return Chart(
        tuple(panels),
        alt=f"Inputs to drive, {proposed.description}: up to {largest:.3g} for {proposed.time[-1]:.3g} s.",
    )
