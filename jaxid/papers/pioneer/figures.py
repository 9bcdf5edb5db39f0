"""The Pioneer paper's figures 2-4 from a log and a model, and what a turn on the spot does to a coupled robot.

Figures 3 and 4 are the general ones of `figures`, for the speed the paper shows.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from ...logs import Log, LogSet
from ...report import figures
from ...report.style import COLOURS, tidy
from ...robots.effect import Numbers, Scalars, State
from ...robots.pioneer import Pioneer
from ...robots.pioneer_closed_form import traction
from ...simulation.simulate import simulate
from .experiments import Check

_TIME = "time [s]"
_METHOD = "model"


@dataclass(frozen=True)
class _Watched(Pioneer):
    """A Pioneer whose caster angle can be seen, in place of its forward speed."""

    def observe(self, state: State, inputs: Scalars, p: Numbers) -> Scalars:
        return state["beta"], state["eta2"]


def _panels(rows: int, height: float) -> tuple[Figure, np.ndarray]:
    figure = Figure(figsize=(9, height), layout="constrained")
    panels = figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0]
    for ax in panels:
        tidy(ax)
        ax.margins(x=0.01)
    panels[-1].set_xlabel(_TIME)
    return figure, panels


def figure_2(log: Log, robot: Pioneer | None = None) -> Figure:
    """Figure 2: voltages, the force that they would give wheels at rest (F of equation 34), measured speed."""
    p = (robot or Pioneer()).parameters.numbers
    force, _ = traction(log.input("V2"), log.input("V3"), p)
    figure, (volts, push, speed) = _panels(3, 5)
    colour = COLOURS[0]
    volts.step(log.time, log.input("V2"), where="post", lw=2.4, color="0.6", label="V2 (right)")
    volts.step(log.time, log.input("V3"), "--", where="post", lw=1.2, color="0.15", label="V3 (left)")
    volts.legend(fontsize="small", frameon=False)
    volts.set_ylabel("voltage [V]")
    push.step(log.time, force, where="post", lw=1.2, color=colour)
    push.set_ylabel("F [N]")
    speed.plot(log.time, log.output("eta1"), lw=0.8, color=colour)
    speed.set_ylabel("eta1 [m/s]")
    for ax, letter, what in zip(
        (volts, push, speed), "abc", ("input voltage", "total force", "linear speed"), strict=True
    ):
        ax.set_title(f"{letter}) {what}", loc="left", fontsize="small")
    figure.align_ylabels()
    return figure


def figure_3(check: Check) -> Figure:
    """Figure 3: speed of the robot and of the model."""
    simulated = {_METHOD: check.found.simulated[check.log.name]}
    size = check.found.rms["eta1"] / check.noise["eta1"]
    return figures.response(check.log, ["eta1"], simulated, check.noise, {_METHOD: f"model ({size:.2f})"})


def figure_4(check: Check) -> Figure:
    """Figure 4: the residual of eta1, its histogram and its autocorrelation."""
    name, found = check.log.name, check.found
    return figures.residuals(
        "eta1",
        check.log.channels.units["eta1"],
        {_METHOD: found.residuals["eta1"]},
        {name: check.log.time},
        {_METHOD: found.tests["eta1"]},
        check.noise["eta1"],
    )


def turn_on_the_spot(log: Log, robot: Pioneer | None = None) -> Figure:
    """What opposite voltages do to the coupled robot: both speeds measured and simulated, and the caster's angle.

    Give the log its caster's first angle with `pioneer_paper.with_caster_across`. Dashed: what equation 35 assumes.
    """
    robot = robot or Pioneer()
    watched = _Watched(robot.parameters, robot.effects, robot.pose, robot.wheel_angles)
    outputs, beta = simulate(robot, LogSet([log]))[0], simulate(watched, LogSet([log]))[0][:, 0]
    figure, panels = _panels(3, 5.5)
    colour = COLOURS[1]
    for ax, name, j in zip(panels[:2], ("eta2", "eta1"), (1, 0), strict=True):
        ax.plot(log.time, log.output(name), ".", ms=2, color="0.6", label="measured")
        ax.plot(log.time, outputs[:, j], lw=1.4, color=colour, label="coupled model")
        ax.set_ylabel(f"{name} [{log.channels.units[name]}]")
    panels[2].plot(log.time, np.degrees(beta), lw=1.4, color=colour)
    panels[2].set_ylabel("beta [deg]")
    for ax, value in ((panels[1], 0.0), (panels[2], -90.0)):
        ax.axhline(value, ls="--", lw=1.0, color="0.2", label="equation 35")
    for ax, what in zip(panels, ("it turns", "and drifts backwards", "and its caster follows"), strict=True):
        ax.set_title(what, loc="left", fontsize="small")
    figure.legend(
        *panels[1].get_legend_handles_labels(), fontsize="small", frameon=False, loc="outside lower center", ncols=3
    )
    figure.align_ylabels()
    return figure
