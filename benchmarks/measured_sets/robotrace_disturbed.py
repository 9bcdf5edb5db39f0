"""Stretches of a robotrace log that its own model does not explain."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from jaxid import Axis, Fit, Integrator, Log, LogSet, output_error, simulate

from . import PICTURE_WIDTH, save

Array = NDArray[np.float64]
SAMPLING = 1e-3  # s
STEP = Integrator(1)  # a sample of 1 ms resolves time constants of 50 to 130 ms
WINDOW = 0.1  # s, of the search for disturbed stretches
ODD = 3.0  # times the median error of a window: disturbed
STRETCHES = ((2.1, 3.1), (5.1, 6.1))
"""What the set's README says about tra_B [s]."""


def window_errors(log: Log, fit: Fit) -> tuple[Array, Array]:
    """(start times [N], rms errors [N]) of windows of 0.1 s, each simulated from the speed measured at its start."""
    starts = np.arange(0.0, log.duration - WINDOW, WINDOW)
    cuts = [log.window(start - SAMPLING / 2, start + WINDOW - SAMPLING / 2) for start in starts]
    seen = simulate(fit.robot, LogSet(cuts), integrator=STEP)
    errors = [np.sqrt(np.mean((cut.output("v") - s[:, 0]) ** 2)) for cut, s in zip(cuts, seen, strict=True)]
    return starts, np.array(errors)


def disturbed(log: Log, model: Axis, rounds: int = 3) -> tuple[Fit, Array, Array, list[tuple[float, float]]]:
    """Stretches of a log that its own model does not explain: (fit without them, window starts, errors, stretches).

    Starting from all of the log, the windows whose error exceeds three times the median are left out and the rest is
    fitted again, every part with its own initial state.
    """
    parts = [log]
    for _ in range(rounds):
        fit = output_error(model, LogSet(parts), initial_states="estimate", integrator=STEP)
        starts, errors = window_errors(log, fit)
        odd = errors > ODD * np.median(errors)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], odd, [False]])))
        ends = np.append(starts, starts[-1] + WINDOW)
        found = [(float(ends[a]), float(ends[b])) for a, b in edges.reshape(-1, 2)]
        limits = np.concatenate([[0.0], np.ravel(found), [log.duration]]).reshape(-1, 2)
        parts = [log.window(a, b) for a, b in limits if b - a > 2 * WINDOW]
    return fit, starts, errors, found


def disturbed_picture(log: Log, simulated: Array, starts: Array, errors: Array, found, pictures: Path) -> str:
    """Speed with the found stretches shaded, and the error of every window against the limit."""
    figure, axes = plt.subplots(2, 1, figsize=(PICTURE_WIDTH, 4.5), sharex=True)
    axes[0].plot(log.time, log.output("v"), lw=0.9, label="measured")
    axes[0].plot(log.time, simulated, lw=0.9, label="free run, fitted without the shaded")
    axes[0].set_ylabel("speed [m/s]")
    axes[0].set_ylim(-2.6, 3.4)
    axes[1].bar(starts + WINDOW / 2, errors, width=0.9 * WINDOW, color="C1")
    axes[1].axhline(ODD * np.median(errors), color="k", lw=0.8)
    axes[1].set_ylabel("error of a window [m/s]")
    axes[1].set_xlabel("time [s]")
    for k, (a, b) in enumerate(STRETCHES):
        axes[0].plot((a, b), (-2.3, -2.3), "k", lw=4, label=None if k else "disturbed by the set's README")
    for a, b in found:
        for ax in axes:
            ax.axvspan(a, b, color="0.85", zorder=0)
    axes[0].legend(loc="upper right", ncol=3)
    return save(figure, pictures, "robotrace_disturbed.png")
