"""From a robot and its logs to an output-error problem in arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import jax.numpy as jnp
import numpy as np

from ...logs import LogSet
from ...logs.noise import noise_scale
from ...logs.windows import in_windows
from ...parameters import ParameterError
from ...robots.given import check_free
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ...simulation.start import free_states, initial_states
from ..result import Fit
from .bounds import Bounds
from .problem import CLOCK_OFFSET, Problem, Structure, Unknowns
from .window_start import started

InitialStates = Literal["auto", "known", "estimate"]
StartValues = Fit | Mapping[str, float] | None
Starts = StartValues | Sequence[Mapping[str, float]]
"""Start values, or several of them, of which the one with the best minimum goes on."""
CLOCK_SPREAD = 50.0
"""Prior standard deviation of the offset between two clocks, in sampling intervals."""


def start_values(robot: Robot, start: StartValues) -> dict[str, float]:
    """Start values of the free parameters."""
    if start is None:
        return {name: robot.parameters[name].value for name in robot.parameters.free_names}
    if isinstance(start, Fit):
        values = start.robot.parameters.numbers
        return {name: values.get(name, robot.parameters[name].value) for name in robot.parameters.free_names}
    for name, value in start.items():
        robot.parameters[name]  # an unknown name is an error, not a silently ignored start
        if not isinstance(value, int | float | np.number | np.ndarray | jnp.ndarray):
            raise ParameterError(
                f"the start value of {name} is {value!r:.60}; give a number in {robot.parameters[name].unit}"
            )
    return {**start_values(robot, None), **{k: float(v) for k, v in start.items() if k in robot.parameters.free_names}}


def every_start(robot: Robot, start: Starts) -> list[dict[str, float]]:
    """Start values of the free parameters, one set a start. Raises `ParameterError` for unknown names and for no
    start, `TypeError` for what is none."""
    if start is None or isinstance(start, Fit | Mapping):
        return [start_values(robot, start)]
    if (
        isinstance(start, str)
        or not isinstance(start, Sequence)
        or not all(isinstance(own, Fit | Mapping) for own in start)
    ):
        raise TypeError(
            f"start = {start!r:.60} is no start; give a fit, values such as {{'M': 1.0}}, or a list of these"
        )
    if not start:
        raise ParameterError("start is an empty list; give at least one start, or None for the robot's own values")
    return [start_values(robot, own) for own in start]


def typical_values(robot: Robot, start: Mapping[str, float], names: tuple[str, ...]) -> np.ndarray:
    """Orders of magnitude of the parameters as far as they are known before anything is simulated: of the start, of the
    table, or one."""
    scales = []
    for name in names:
        parameter = robot.parameters[name]
        candidates = (abs(start.get(name, 0.0)), abs(parameter.value), parameter.typical or 0.0, 1.0)
        scales.append(next(size for size in candidates if size > 0))
    return np.array(scales)


def build(
    robot: Robot,
    logs: LogSet,
    *,
    start: Mapping[str, float],
    initial: InitialStates = "auto",
    integrator: Integrator | None = None,
    clock_offset: bool = False,
) -> tuple[Structure, Problem, Unknowns]:
    """The problem in which all free parameters of `robot` are estimated from `logs`, starting at `start`; with `clock_offset`,
    every log's offset between the inputs' and the outputs' clock as well.

    Optional channels weigh in only where they are states of the robot (a measured position) and their output stands in
    the log. Raises `ParameterError` if no parameter is free.
    """
    check_free(robot)
    names = robot.parameters.free_names
    batch = logs.batch()
    measured = batch.channels.measured
    begin = initial_states(robot.with_values(**start), logs)
    every = np.full((len(logs), len(robot.estimated_states)), initial == "estimate")
    if initial == "auto":
        every = free_states(robot, logs, begin)
    somewhere = np.flatnonzero(np.any(every, axis=0))
    state_names, state_free = tuple(robot.estimated_states[i] for i in somewhere), every[:, somewhere]
    shown = {c for i, c in enumerate(measured) if bool(np.any(np.asarray(batch.mask)[..., i]))}
    spreads = robot.prior_spreads
    precision = np.array([0.0 if name in shown else spreads.get(name, np.inf) ** -2 for name in state_names])
    scales = [spreads.get(name, 1.0) for name in state_names]
    interval = max(log.sampling_interval for log in logs)
    if clock_offset:
        state_names = (*state_names, CLOCK_OFFSET)
        state_free = np.concatenate([state_free, np.ones((len(logs), 1), dtype=bool)], axis=1)
        precision, scales = np.append(precision, (CLOCK_SPREAD * interval) ** -2), [*scales, interval]
        begin.states[CLOCK_OFFSET] = np.zeros(len(logs))

    values = np.array([start.get(name, robot.parameters[name].value) for name in names])
    table = [robot.parameters[name] for name in names]
    scale = typical_values(robot, start, names)
    bounds = Bounds(
        lower=np.asarray([p.lower for p in table]), upper=np.asarray([p.upper for p in table]), scale=np.asarray(scale)
    )
    priors = [p.prior or (0.0, np.inf) for p in table]
    mask = np.asarray(batch.mask) & _modelled(robot, measured)
    problem = Problem(
        dt=np.asarray(batch.dt),
        inputs=np.asarray(batch.inputs),
        outputs=np.asarray(batch.outputs),
        mask=mask,
        sigma=np.asarray(list(noise_scale(logs).values())),
        numbers={name: np.asarray(float(p.value)) for name, p in robot.parameters.items()},
        bounds=bounds,
        free=np.ones(len(names), dtype=bool),
        held=values,
        prior_mean=np.asarray([p[0] for p in priors]),
        prior_precision=np.asarray([p[1] ** -2.0 for p in priors]),
        start={name: np.asarray(value) for name, value in begin.states.items()},
        state_free=state_free,
        state_scale=np.asarray(scales),
        state_precision=np.asarray(precision),
    )
    structure = Structure(robot.structure, names, tuple(state_names), integrator or Integrator.suited(robot, interval))
    unknowns = Unknowns(bounds.coordinates(values), np.zeros((len(logs), len(state_names))))
    return structure, problem, unknowns


def at_fit(
    fit: Fit, logs: LogSet, *, initial: InitialStates = "auto", integrator: Integrator | None = None
) -> tuple[Structure, Problem, Unknowns]:
    """The problem that `fit` solved, at its solution and with its noise. Arguments are those of the fit."""
    start = start_values(fit.robot, fit)
    whole = logs
    if fit.window is not None:
        logs, initial = in_windows(logs, fit.window), "estimate"
    structure, problem, unknowns = build(
        fit.robot, logs, start=start, initial=initial, integrator=integrator, clock_offset=bool(fit.clock_offsets)
    )
    if fit.window is not None:
        problem = started(whole, structure, problem)
    sigma = [fit.noise.get(c, float(problem.sigma[i])) for i, c in enumerate(logs[0].channels.measured)]
    states = np.zeros(unknowns.states.shape)
    for i, name in enumerate(structure.state_names):
        for e, log in enumerate(logs):
            if name == CLOCK_OFFSET:
                value = fit.clock_offsets[log.name].value
            else:
                value = fit.initial_states[log.name][name]
            states[e, i] = (value - float(problem.start[name][e])) / float(problem.state_scale[i])
    problem = replace(problem, sigma=np.asarray(sigma))
    return structure, problem, Unknowns(unknowns.z, np.asarray(np.where(np.asarray(problem.state_free), states, 0.0)))


def _modelled(robot: Robot, measured: tuple[str, ...]):
    """Which measured channels enter the fit: outputs always, optional ones where they are states of the robot."""
    outputs = robot.channels.outputs
    return np.array([name in outputs or name in robot.states for name in measured])
