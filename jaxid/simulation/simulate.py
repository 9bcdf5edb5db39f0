"""Simulate logs with a model: the same inputs, no measurement fed back."""

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from .._compile import compiled
from .._float64 import in_float64
from ..logs import LogSet
from ..robots.robot import Robot
from .rollout import Integrator, rollout
from .start import initial_states


def integrator_for(robot: Robot, logs: LogSet) -> Integrator:
    """The integrator whose steps suit the coarsest sampled log."""
    return Integrator.suited(robot, max(log.sampling_interval for log in logs))


@partial(compiled, static_argnames=("robot", "integrator"))
def _simulate(robot: Robot, integrator: Integrator, numbers, start, inputs, dt, prescribed):
    return jax.vmap(lambda s, u, d, k: rollout(robot, numbers, s, u, d, integrator, k))(start, inputs, dt, prescribed)


@in_float64
def simulate(
    robot: Robot,
    logs: LogSet,
    *,
    start: Mapping[str, NDArray[np.float64]] | None = None,
    integrator: Integrator | None = None,
    prescribed: Mapping[str, Float[Array, "E T"]] = MappingProxyType({}),
) -> list[NDArray[np.float64]]:
    """Simulated outputs of every log, [samples, channels.measured] each.

    `start` gives initial states per log ([E] by state name); by default they follow from the logs (`initial_states`).
    States in `prescribed` are set to these values at every sample (padded as in `logs.batch()`).
    """
    batch = logs.batch()
    states = dict(initial_states(robot, logs).states)
    if start is not None:
        states |= {name: np.asarray(values, dtype=float) for name, values in start.items()}
    numbers = {name: jnp.asarray(value, float) for name, value in robot.parameters.numbers.items()}
    outputs = _simulate(
        robot.structure,
        integrator or integrator_for(robot, logs),
        numbers,
        {name: jnp.asarray(value) for name, value in states.items()},
        batch.inputs,
        batch.dt,
        dict(prescribed),
    )
    return [np.asarray(outputs[e, : len(log)]) for e, log in enumerate(logs)]
