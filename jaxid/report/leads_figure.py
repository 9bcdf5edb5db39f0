"""The missing force against what it may depend on: the lead where no candidate explains it."""

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..explanation.explanation import Explanation
from ..explanation.where.conditions import motions
from .style import COLOURS, tidy

Array = NDArray[np.float64]


def _leads(found: Explanation, e: int, column: int) -> dict[str, Array]:
    """What the missing force of log `e` may depend on [T], by axis label."""
    assert found.localisation is not None
    motion = motions(found.baseline.robot, found.held_out)[e]
    force, log = found.localisation.forces[e], found.held_out[e]
    units = log.channels.units
    signals: dict[str, Array] = {}
    name = force.names[column]
    if name in log.measured:
        signals[f"{name} [{units.get(name, '')}]"] = log.output(name)
    if motion.heading is not None:
        signals["heading [deg]"] = np.degrees(np.angle(np.exp(1j * motion.heading)))
    if motion.path is not None:
        signals |= {f"{axis} [m]": along for axis, along in zip("xy", motion.path.T, strict=False)}
    return signals | {"time [s]": log.time}


def leads(found: Explanation) -> Figure | None:
    """The strongest missing force of all held-out logs against speed, heading, place and time (lines: median in bins).

    None where no force rises above its uncertainty.
    """
    place = found.localisation
    if place is None or not any(place.force_share.values()):
        return None
    name = max(place.force_share, key=lambda n: place.force_share[n])
    column = list(place.force_share).index(name)
    each = [_leads(found, e, column) for e in range(len(place.forces))]
    labels = list(each[0])
    values = np.concatenate([force.force[:, column] for force in place.forces])
    figure = Figure(figsize=(2.3 * len(labels) + 0.8, 2.9), layout="constrained")
    axes = figure.subplots(1, len(labels), sharey=True, squeeze=False)[0]
    for ax, label in zip(axes, labels, strict=True):
        x = np.concatenate([signals[label] for signals in each])
        ax.plot(x[::2], values[::2], ".", ms=1.6, color=COLOURS[1], alpha=0.25, rasterized=True)
        edges = np.unique(np.nanquantile(x, np.linspace(0, 1, 15)))
        inside = [values[(x >= a) & (x <= b)] for a, b in zip(edges[:-1], edges[1:], strict=True)]
        middle = [float(np.median(v)) if v.size else np.nan for v in inside]
        ax.plot((edges[:-1] + edges[1:]) / 2, middle, color="0.1", lw=2.0)
        ax.axhline(0.0, color="0.3", lw=0.8)
        ax.set_xlabel(label)
        tidy(ax)
    axes[0].set_ylabel(f"missing in {name} [{place.units[name]}]")
    return figure
