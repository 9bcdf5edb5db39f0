"""From logs to a solution of the linear equations: momentum balances first, then equation 33 about the estimate."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...logs import Log, LogError
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..result import Estimate, Status
from .log_rows import measured_speeds
from .weighted_least_squares import Solution, solve
from .window_equations import WindowEquations, window_equations

Array = NDArray[np.float64]
METHOD = "integral_least_squares"
STEPS = 8


def with_estimate(robot: Robot, names: tuple[str, ...], theta: Array) -> Robot:
    return robot.with_values(**dict(zip(names, theta.tolist(), strict=True)))


def _together(robot: Robot, log: Log) -> bool:
    """Whether any row of a log holds all measured speeds, or what stands in for them."""
    speeds = [log.output(name) for name in measured_speeds(robot)]
    shown = [np.isfinite(values) for values in speeds if np.isfinite(values).any()]
    return bool(np.all(shown, axis=0).any()) if shown else True


def identify(robot: Robot, logs: list[Log], window: int | None) -> tuple[Solution, WindowEquations, int, bool]:
    """Momentum balances first, then equation 33 about the estimate until it stands."""
    names = robot.parameters.free_names
    nothing = np.zeros(len(names), bool)
    equations = window_equations(robot, logs, "momentum", window)
    if not len(equations):
        listed = ", ".join(log.name for log in logs)
        if not any(_together(robot, log) for log in logs):
            raise LogError(
                f"no row of the logs {listed} holds all of {', '.join(measured_speeds(robot))}, which were measured at "
                "times of their own; balances need them at the same times. Use output error, which takes every sensor as it "
                "comes."
            )
        raise LogError(
            f"the logs {listed} hold no two samples in a row in which the robot moves, or its "
            "speeds never come above three times what their sensors' noise or coarse steps are; give logs in which it moves "
            "faster, or speeds averaged over more of an encoder's counts, or use output error."
        )
    solution, theta = None, np.array([robot.parameters[name].value for name in names])
    # Without a known force the balances only say how parameters compare, and theta = 0 solves them.
    # What is left then is rounding of the table's values, which may be in other units and so be far too large.
    driven = np.linalg.norm(equations.targets) > 1e-11 * np.linalg.norm(equations.regressors * theta)
    if driven:
        solution = solve(equations, robot, nothing)
    start = theta if solution is None else solution.theta
    best, held, previous = solution, nothing, start
    moved, error, size = np.full(len(names), np.inf), np.zeros(len(names)), np.zeros(len(names))
    for step in range(1, STEPS + 1):
        trial = window_equations(with_estimate(robot, names, previous), logs, "speed", window)
        if not (len(trial) and np.isfinite(trial.regressors).all() and np.isfinite(trial.targets).all()):
            if step == 1 and solution is not None:
                previous = theta
                continue
            break
        best, equations = solve(trial, robot, held), trial
        held = held | best.held
        error = np.nan_to_num(np.sqrt(np.diag(best.covariance)))
        moved, size = np.abs(best.theta - previous), np.abs(best.theta)
        previous = best.theta
        if np.all(moved <= np.maximum(0.02 * error, 1e-7 * size)):
            return best, equations, step + 1, True
    if best is None:
        raise LogError(
            f"no input acts in the logs {', '.join(log.name for log in logs)} and {robot.name!r} cannot be linearised "
            "at its start values; give logs in which the robot is driven."
        )
    # Without noise, interpolation between samples keeps the last digits moving.
    return best, equations, STEPS + 1, bool(np.all(moved <= np.maximum(error, 1e-3 * size)))


def estimates_of(robot: Robot, found: Mapping[str, Estimate]) -> dict[str, Estimate]:
    return {
        name: found[name] if name in found else Estimate.of(p.value, float("nan"), p.unit, "fixed")
        for name, p in robot.parameters.items()
    }


def estimates_with(
    robot: Robot, names: Sequence[str], theta: Array, errors: Array, status: Sequence[Status]
) -> dict[str, Estimate]:
    """Estimates of free parameters, their intervals cut off at the bounds."""
    found = {}
    for name, value, error, own in zip(names, theta, errors, status, strict=True):
        p = robot.parameters[name]
        estimate = Estimate.of(value, error, p.unit, own)
        low, high = estimate.ci95
        # Comparisons that a NaN keeps.
        low, high = (p.lower if low < p.lower else low), (p.upper if high > p.upper else high)
        found[name] = replace(estimate, ci95=(low, high))
    return found


def status_notes(names: Sequence[str], status: Sequence[Status], errors: Array) -> list[str]:
    """What the owner should know of parameters that are not identified."""
    blind = [n for n, s, e in zip(names, status, errors, strict=True) if s == "not_identifiable" and np.isnan(e)]
    vague = [n for n, s, e in zip(names, status, errors, strict=True) if s == "not_identifiable" and not np.isnan(e)]
    bound = [n for n, s in zip(names, status, strict=True) if s == "at_bound"]
    notes = []
    if blind:
        notes.append(
            f"{', '.join(blind)}: not determined by this method's equations on these logs; one at the table's value goes with "
            "whatever the others are."
        )
    if vague:
        notes.append(
            f"{', '.join(vague)}: the standard error exceeds the value; estimated all the same, so that the intervals of "
            "the others hold whatever it is."
        )
    if bound:
        notes.append(f"{', '.join(bound)}: at a bound of the table: the unbounded estimate lies outside.")
    return notes


def notes_on(robot: Robot, equations: WindowEquations) -> tuple[str, ...]:
    """Which part of the logs the balances use, and what of the robot they do not contain."""
    notes = [
        f"Balances over stretches of {equations.window} samples; {100 * equations.dropped:.1f} % of the intervals were "
        "left out because something stood still, turned round, or was not measured.",
    ]
    unseen = [
        effect.id
        for effect in robot.effects
        if type(effect).command is not Effect.command or type(effect).measure is not Effect.measure
    ]
    if unseen:
        notes.append(f"{', '.join(unseen)}: acts on the command or the sensor, which the balances do not contain.")
    return tuple(notes)
