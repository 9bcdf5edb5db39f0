"""From a robot and its logs to a prediction-error problem in arrays."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...logs import LogSet
from ...parameters import ParameterError
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ..output_error import setup as output_error_setup
from ..output_error.setup import InitialStates
from .cubature import Moments
from .filter import Model, Record
from .late_sensors import lagged_outputs, refusal
from .likelihood import Problem, Unknowns
from .noisy_states import noisy_states, state_scales

_ROUNDING = 1e-8
"""Least standard deviation of a state in units of its root mean square."""
_VAGUE = 30.0
"""Standard deviation of a measured initial state in units of the sensor's noise: its first sample then says nearly all."""


class Task(NamedTuple):
    """A prediction-error problem and where to start."""

    names: tuple[str, ...]
    model: Model
    problem: Problem
    start: Unknowns


def _known(robot: Robot, batch) -> dict[str, Float[Array, "E T"]]:
    """Measured states over time [E, T], linear where a sample is missing; only those that every log holds."""
    found = {}
    for i, name in enumerate(batch.channels.measured):
        mask, y = np.asarray(batch.mask[..., i]), np.asarray(batch.outputs[..., i])
        if name in robot.states and mask.any(axis=1).all():
            at = np.arange(y.shape[1])
            rows = [np.interp(at, at[m], row[m]) for row, m in zip(y, mask, strict=True)]
            found[name] = jnp.asarray(np.stack(rows))
    return found


def build(
    robot: Robot,
    logs: LogSet,
    *,
    start: Mapping[str, float],
    initial: InitialStates = "auto",
    process_noise: Sequence[str] | None = None,
    integrator: Integrator | None = None,
) -> Task:
    """The problem in which all free parameters of `robot` and all noises are estimated from `logs`, starting at `start`.

    Parameters, bounds, priors and initial states are those of output error; states that it would estimate, as in a log that
    starts elsewhere than at rest, are uncertain instead. Raises `ParameterError` if no parameter is free, for an unknown
    state in `process_noise`, and for sensors that the filter cannot have (`late_sensors.refusal`).
    """
    why = refusal(robot, logs)
    if why:
        raise ParameterError(why)
    structure, own, _ = output_error_setup.build(robot, logs, start=start, initial=initial, integrator=integrator)
    noisy = noisy_states(robot, process_noise)
    model = Model(structure.robot, structure.integrator, noisy)
    batch = logs.batch()
    numbers = {**own.numbers, **dict(zip(structure.names, own.held, strict=True))}
    begin = {name: own.start[name] for name in robot.states}
    scales = state_scales(structure.robot, structure.integrator, numbers, begin, batch, _known(robot, batch))

    measured = batch.channels.measured
    sigma = np.asarray(own.sigma)
    spread = np.array([_VAGUE * sigma[measured.index(s)] if s in measured else v
                       for s, v in zip(robot.states, scales, strict=True)])  # fmt: skip
    free = np.zeros((len(logs), len(robot.states)), dtype=bool)
    for column, name in enumerate(structure.state_names):
        free[:, robot.states.index(name)] = np.asarray(own.state_free)[:, column]
    variances = np.where(free, spread, 0.0) ** 2
    lagged = [float(np.sqrt(np.mean(np.asarray(own.outputs)[..., measured.index(c)] ** 2))) or 1.0
              for c in lagged_outputs(robot)]  # fmt: skip
    sizes = np.array([*scales, *lagged])
    records = Record(
        dt=own.dt,
        inputs=own.inputs,
        outputs=own.outputs,
        there=own.mask,
        start=Moments(
            jnp.stack([begin[name] for name in robot.states], axis=-1), jnp.asarray([np.diag(v) for v in variances])
        ),
        floor=jnp.broadcast_to(jnp.asarray((_ROUNDING * sizes) ** 2), (len(logs), len(sizes))),
    )
    interval = float(np.median([log.sampling_interval for log in logs]))
    reference = np.array([scales[robot.states.index(name)] for name in noisy]) / np.sqrt(interval)
    problem = Problem(
        records=records,
        numbers=own.numbers,
        lower=own.bounds.lower,
        upper=own.bounds.upper,
        scale=own.bounds.scale,
        free=own.free,
        held=own.held,
        prior_mean=own.prior_mean,
        prior_precision=own.prior_precision,
        process_reference=jnp.asarray(reference),
        disturbed=jnp.ones(len(noisy), dtype=bool),
        sensor_reference=own.sigma,
        sensed=jnp.any(own.mask, axis=(0, 1)),
    )
    at = Unknowns(own.held / own.bounds.scale, jnp.full(len(noisy), -3.0), jnp.zeros(len(measured)))
    return Task(structure.names, model, problem, at)
