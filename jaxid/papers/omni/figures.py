"""The omni paper's figures 2-7 and 9-12 from logs and simulations. Every function returns a matplotlib `Figure`."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...logs import Log
from ...report.style import COLOURS, tidy
from ...robots.omni import Omni
from .closed_loop import LARGEST_DUTY, ClosedLoop
from .experiments import CoastDown, SteadyState
from .methods import Friction, Inertia
from .printed import AXES, TABLE_1, TABLE_2, Axis
from .stretches import currents

_SPEED = {"V": "V [m/s]", "Vn": "Vn [m/s]", "W": "W [rad/s]"}
_FORCE = {"V": "Fv [N]", "Vn": "Fvn [N]", "W": "Gamma [N m]"}
_ACCELERATION = {"V": "dV/dt [m/s²]", "Vn": "dVn/dt [m/s²]", "W": "dW/dt [rad/s²]"}
_MOTORS = {"V": (2, 4), "Vn": (1, 3), "W": (1, 2, 3, 4)}
_PAPER, _REAL, _USED = "0.4", "0.6", "0.9"
"""Greys of what the paper printed, of what was measured, and of the stretch that counts."""
_TIME = "time [s]"


def _panels(rows: int, columns: int, width: float, height: float) -> tuple[Figure, np.ndarray]:
    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False)


def _label(ax: Axes, x: str, y: str, legend: bool = False) -> None:
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    tidy(ax)
    if legend:
        ax.legend(fontsize="small", frameon=False)


def steady_run(log: Log, first: SteadyState, robot: Omni | None = None) -> Figure:
    """Figures 2-4: speed and motor currents of one steady run, the stretch that method 1 used shaded."""
    own = [point for point in first.points if point.log == log.name]
    axis = own[0].axis if own else AXES[int(np.argmax(np.nanmean(np.abs(log.outputs[:, :3]), axis=0)))]
    figure, panels = _panels(1, 2, 9, 3)
    speed, current = panels[0]
    speed.plot(log.time, log.output(axis), lw=1, color=COLOURS[0])
    speed.set_ylim(bottom=min(0.0, float(np.nanmin(log.output(axis)))), top=1.4 * float(np.nanmean(log.output(axis))))
    values, measured = currents(log, robot)
    for motor in _MOTORS[axis]:
        current.plot(log.time, values[:, motor - 1], lw=0.8, color=COLOURS[motor - 1], label=f"i{motor}")
    for ax in (speed, current):
        for point in own:
            ax.axvspan(point.start, point.stop, color=_USED, lw=0, zorder=0)
    _label(speed, _TIME, _SPEED[axis])
    _label(current, _TIME, "current [A]" if measured else "current by the motor model [A]")
    current.legend(fontsize="small", ncols=2, frameon=False)
    figure.suptitle(f"{log.name}: the shaded part counts as steady", fontsize="medium", x=0.01, ha="left")
    return figure


def friction_lines(friction: Mapping[Axis, Friction] | None = None) -> Figure:
    """Figure 5: the paper's Table 1 with its printed lines and, where given, method 1's points and lines from logs."""
    figure, panels = _panels(1, 3, 11, 3.4)
    for ax, axis in zip(panels[0], AXES, strict=True):
        speeds, forces = TABLE_1[axis]
        reach = np.array([0.5, 1.3])
        viscous, coulomb = TABLE_2[axis]
        ax.plot(speeds, forces, "o", color=_PAPER, label="paper, Table 1")
        ax.plot(reach, viscous * reach + coulomb, "--", color=_PAPER, label=f"paper: {viscous:.2f} x + {coulomb:.2f}")
        found = (friction or {}).get(axis)
        if found is not None:
            B, C = found.viscous.value, found.coulomb.value
            ax.plot(np.abs(found.x), np.abs(found.y), "s", color=COLOURS[0], label="logs")
            ax.plot(reach, B * reach + C, color=COLOURS[0], label=f"logs: {B:.2f} x + {C:.2f}")
        _label(ax, _SPEED[axis], _FORCE[axis], legend=True)
    return figure


def coast_down(log: Log, second: CoastDown) -> Figure:
    """Figures 6 and 7: speed while coasting down, the force-free stretch shaded, and its Euler differences."""
    axis, start, stop = second.stretches[log.name]
    figure, panels = _panels(1, 2, 9, 3)
    whole, part = panels[0]
    whole.plot(log.time, log.output(axis), lw=1, color=COLOURS[0])
    whole.axvspan(start, stop, color=_USED, lw=0, zorder=0)
    _label(whole, _TIME, _SPEED[axis])
    inside = (log.time >= start) & (log.time <= stop)
    t, v = log.time[inside], log.output(axis)[inside]
    part.plot(t, v, color=COLOURS[0], label=_SPEED[axis])
    part.plot(t[:-1], np.diff(v) / np.diff(t), lw=0.8, color=COLOURS[1], label=f"{_ACCELERATION[axis]} (Euler)")
    _label(part, _TIME, f"{_SPEED[axis]}, {_ACCELERATION[axis]}")
    part.legend(fontsize="small", frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0)
    figure.suptitle(
        f"{log.name}: without traction from {start:.2f} s to {stop:.2f} s", fontsize="medium", x=0.01, ha="left"
    )
    return figure


def hanging(log: Log, found: Inertia) -> Figure:
    """Figure 9: angle and angular velocity (Euler) of the hanging robot with the fitted motion."""
    theta, t = log.output("theta"), log.time
    alpha = found.acceleration.value if found.acceleration else np.nan
    alpha = alpha if theta[-1] >= theta[0] else -alpha
    since = t - t[0]
    # The remaining two coefficients of the parabola, for the drawing.
    line = np.polyfit(since, theta - 0.5 * alpha * since**2, 1)
    figure, panels = _panels(1, 2, 9, 3)
    angle, rate = panels[0]
    angle.plot(t, theta, ".", ms=3, color=_REAL, label="measured")
    angle.plot(t, 0.5 * alpha * since**2 + np.polyval(line, since), color=COLOURS[1], label="fit")
    _label(angle, _TIME, "theta [rad]", legend=True)
    rate.plot(0.5 * (t[1:] + t[:-1]), np.diff(theta) / np.diff(t), ".", ms=3, color=_REAL, label="Euler differences")
    rate.plot(t, alpha * since + line[0], color=COLOURS[1], label=f"slope {alpha:.4f} rad/s²")
    _label(rate, _TIME, "W [rad/s]", legend=True)
    figure.suptitle(
        f"{log.name}: J = {found.J.value:.4f} ± {found.J.std_error:.4f} kg m²", fontsize="medium", x=0.01, ha="left"
    )
    return figure


def closed_loop(run: ClosedLoop, axis: Axis, real: Log, robot: Omni | None = None) -> Figure:
    """Figures 10-12: speed, motor currents and PWM duties of the velocity-controlled robot, real and simulated.

    `real` is a log of the same reference from rest, with currents; `robot` gives the supply voltage of duty 255.
    """
    motors, j = _MOTORS[axis], AXES.index(axis)
    figure = Figure(figsize=(2.6 + 2.3 * len(motors), 4.2), layout="constrained")
    panels = figure.subplot_mosaic(
        [["speed", *(f"i{motor}" for motor in motors)], ["speed", *(f"duty{motor}" for motor in motors)]],
        width_ratios=[1.3, *([1.0] * len(motors))],
    )
    supply = (robot or Omni()).parameters["supply"].value
    measured, _ = currents(real, robot)

    def both(ax: Axes, title: str, log: np.ndarray, simulated: np.ndarray, held: bool) -> None:
        style = "steps-post" if held else "default"
        ax.plot(real.time, log, color=_REAL, lw=1.8, label="real", drawstyle=style)
        ax.plot(run.time, simulated, color=COLOURS[1], lw=1.0, label="simulated", drawstyle=style)
        ax.set_title(title, fontsize="medium", loc="left")

    speed = panels["speed"]
    speed.plot(run.time, run.reference[:, j], "--", color="0.3", lw=0.8, label="reference")
    both(speed, f"speed {axis}", real.output(axis), run.speeds[:, j], held=False)
    _label(speed, _TIME, _SPEED[axis], legend=True)
    for motor in motors:
        k = motor - 1
        both(panels[f"i{motor}"], f"current, motor {motor}", measured[:, k], run.currents[:, k], held=True)
        duty = LARGEST_DUTY / supply * real.inputs[:, k]
        both(panels[f"duty{motor}"], f"PWM, motor {motor}", duty, run.duty[:, k], held=True)
        _label(panels[f"i{motor}"], _TIME, f"i{motor} [A]")
        _label(panels[f"duty{motor}"], _TIME, "duty [of 255]")
    # As in the paper: one range for all motors, each on the side to which it drives.
    for name, simulated in (("i", run.currents), ("duty", run.duty)):
        reach = 1.2 * float(np.max(np.abs(simulated)))
        for motor in motors:
            ahead = np.mean(simulated[:, motor - 1]) > 0
            panels[f"{name}{motor}"].set_ylim(*((-0.1 * reach, reach) if ahead else (-reach, 0.1 * reach)))
    return figure


def measured_and_simulated(log: Log, simulated: Mapping[str, np.ndarray]) -> Figure:
    """V, Vn and W of one log with simulated outputs `{label: [T, 3 or more]}` on top."""
    figure, panels = _panels(3, 1, 9, 5.5)
    for j, (ax, axis) in enumerate(zip(panels[:, 0], AXES, strict=True)):
        ax.plot(log.time, log.output(axis), color="0.75", lw=3.5, label="measured")
        for (label, outputs), colour in zip(simulated.items(), COLOURS, strict=False):
            ax.plot(log.time, outputs[:, j], lw=1, color=colour, label=label)
        _label(ax, _TIME, _SPEED[axis], legend=j == 0)
    return figure
