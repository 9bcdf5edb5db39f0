"""States that no output shows, carried along a log by the model from what the outputs do show.

A caster's angle, a motor's warmth or a filter's memory follow from the motion that led there. With the states that the
measurement gives set to these values at every sample, the model integrates the others from the log's start: they do not drift
off with the motion's own errors, and what forgets its start is known a while later.
"""

from collections.abc import Mapping
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from .._compile import compiled
from ..kernel.direct import outputs
from ..kernel.groups import grouped, ungrouped
from ..kernel.machine import lanes
from ..kernel.symbolic import Untranslated
from ..robots.robot import Robot
from ..robots.signal_path import overrides
from .local_slopes import showing_states
from .rollout import Integrator, begins_in_motion, commanded, step

Array = np.ndarray


def carried(
    robot: Robot,
    integrator: Integrator,
    start: Mapping[str, float],
    inputs: Float[Array, "T nu"],
    dt: Float[Array, " T"],
    shown: Mapping[str, Float[Array, " T"]],
) -> dict[str, Float[Array, " T"]]:
    """All states at the samples of one log that begins in `start`, those `shown` set to these values at every sample. Call
    under float64."""
    numbers = {name: float(value) for name, value in robot.parameters.numbers.items()}
    begin = {name: float(start[name]) for name in robot.states}
    known = {name: np.asarray(values, float) for name, values in shown.items()}
    held = float(begins_in_motion(robot, begin))
    fine = _arriving(robot.structure, integrator, numbers, np.asarray(inputs, float), np.asarray(dt, float), held)
    found = _directly(robot, integrator, numbers, begin, fine, dt, known)
    if found is None:
        found = np.asarray(_in_xla(robot.structure, integrator, numbers, begin, fine, np.asarray(dt, float), known))
    return dict(zip(robot.states, found.T, strict=True))


@partial(compiled, static_argnames=("robot", "integrator"))
def _in_substeps(robot: Robot, integrator: Integrator, numbers, inputs, dt, held):
    return commanded(robot, numbers, inputs, dt, integrator.substeps, held)


def _arriving(robot: Robot, integrator: Integrator, numbers, inputs: Array, dt: Array, held: float) -> Array:
    """What arrives of the inputs [T, substeps, nu]."""
    if any(overrides(type(effect), "command") for effect in robot.effects):
        return np.asarray(_in_substeps(robot, integrator, numbers, inputs, dt, held))
    return np.repeat(inputs[:, None], integrator.substeps, axis=1)


def _directly(robot, integrator, numbers, begin, fine, dt, known) -> Array | None:
    """States [T, states] by machine code; None where that takes XLA."""
    if jax.default_backend() != "cpu":
        return None
    system = showing_states(robot.structure, tuple(numbers), integrator.friction, tuple(known))
    n = integrator.substeps
    fixed = np.stack([*known.values()], axis=1) if known else np.zeros((len(dt), 0))
    p, x = grouped(np.array([[*numbers.values()]])), grouped(np.array([[*begin.values()]]))
    held, steps, known = grouped(fine[None]), grouped(np.asarray(dt, float)[None]), grouped(fixed[None])
    try:
        run = (np.full((n, lanes()), 1.0 / n), p, x, held, steps, known)
        return ungrouped(outputs(system, run), 1)[0, :, : len(robot.states)]
    except Untranslated:
        return None


@partial(compiled, static_argnames=("robot", "integrator"))
def _in_xla(robot: Robot, integrator: Integrator, numbers, begin, fine, dt, known):
    n = integrator.substeps

    def sample(state, row):
        u, interval, there = row
        state = {**state, **there}

        def substep(s, held):
            return step(robot, s, tuple(held), interval / n, numbers, integrator.friction), None

        after, _ = jax.lax.scan(substep, state, u)
        return after, jnp.stack([state[name] for name in robot.states])

    start = {name: jnp.asarray(value, float) for name, value in begin.items()}
    return jax.lax.scan(sample, start, (fine, dt, known))[1]
