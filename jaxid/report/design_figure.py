"""Figure of a designed experiment: what to drive and what to expect of it."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..design import PlannedRun
from .style import COLOURS, tidy


def planned(run: PlannedRun) -> Figure:
    """Inputs over time, the outputs that the model expects, and the path on the floor where there is one."""
    names = (*run.channels.inputs, *run.channels.measured)
    values = (*run.inputs.T, *run.outputs.T)
    driven, path = len(run.channels.inputs), run.path is not None
    figure = Figure(figsize=(12 if path else 9, 0.8 + 0.95 * len(names)), layout="constrained")
    parts = np.ravel(figure.subfigures(1, 2, squeeze=False, width_ratios=(3, 1))) if path else (figure, None)
    left, right = parts[0], parts[1]
    axes = left.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for i, (ax, name, series) in enumerate(zip(axes, names, values, strict=True)):
        held = "steps-post" if i < driven else "default"
        ax.plot(run.time, series, color=COLOURS[0] if i < driven else COLOURS[2], lw=1.3, drawstyle=held)
        ax.axhline(0.0, color="0.3", lw=0.8)
        unit = run.channels.units.get(name, "")
        ax.set_ylabel(f"{name}\n[{unit}]" if unit else name, fontsize="small")
        ax.margins(x=0.01)
        tidy(ax)
    axes[0].set_title("to drive", loc="left", fontsize="small")
    axes[driven].set_title("to expect", loc="left", fontsize="small")
    axes[-1].set_xlabel("time [s]")
    figure.align_ylabels()
    if right is not None and run.path is not None:
        floor = right.subplots()
        _path(floor, run.path)
        floor.set_title("path from the dot", loc="left", fontsize="small")
    return figure


def _path(ax: Axes, path: NDArray[np.float64]) -> None:
    ax.plot(*path.T, color=COLOURS[2], lw=1.3)
    ax.plot(*path[0], "o", color="0.3", ms=4)
    ax.set_aspect("equal", adjustable="datalim")
    ax.set(xlabel="x [m]", ylabel="y [m]")
    tidy(ax)


def floor_path(run: PlannedRun) -> Figure:
    """The path on the floor alone."""
    assert run.path is not None
    figure = Figure(figsize=(5, 4), layout="constrained")
    _path(figure.subplots(), run.path)
    return figure
