"""Which states process noise accelerates, and how large states are."""

from collections.abc import Sequence
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from ..._compile import compiled
from ...parameters import ParameterError
from ...robots.robot import Robot
from ...simulation.rollout import Integrator, begins_in_motion, commanded, step

_PROBES = 3


@partial(compiled, static_argnums=0)
def _slopes(robot: Robot, state, inputs, dry, numbers):
    """Derivatives of the states' rates by inputs, dry friction and parameters."""

    def rates(inputs, dry, numbers):
        return robot.rates(state, tuple(inputs), tuple(dry), numbers)

    return jax.jacfwd(rates, argnums=(0, 1, 2))(inputs, dry, numbers)


def noisy_states(robot: Robot, asked: Sequence[str] | None = None) -> tuple[str, ...]:
    """The states that process noise acts on: those `asked` for, else the robot's velocities.

    A state whose rate depends on no input, friction or parameter only integrates others, as a position does, and is no
    velocity whatever it is called. A robot none of whose velocities is one has noise on all states that do depend on them.
    Raises `ParameterError` for an unknown state.
    """
    if asked is not None:
        unknown = [name for name in asked if name not in robot.states]
        if unknown:
            raise ParameterError(
                f"there is no state {unknown[0]!r} for process noise; the states of {robot.name} are "
                f"{', '.join(robot.states)}"
            )
        return tuple(dict.fromkeys(asked))
    own = robot.own_states
    found: set[str] = set()
    random = np.random.default_rng(0)
    for _ in range(_PROBES):
        state = {name: np.asarray(random.uniform(0.2, 1.0)) for name in robot.states}
        inputs = random.uniform(0.2, 1.0, len(robot.channels.inputs))
        numbers = {k: np.asarray(v * random.uniform(0.8, 1.2) + 1e-3) for k, v in robot.parameters.numbers.items()}
        dry = random.uniform(0.2, 1.0, len(jax.eval_shape(robot.rubbing, state, numbers)))
        slopes = _slopes(robot.structure, state, inputs, dry, numbers)
        for name in own:
            if any(bool(np.any(np.asarray(leaf) != 0)) for leaf in jax.tree.leaves(slopes[name])):
                found.add(name)
    moved = tuple(name for name in robot.velocities if name in found)
    return moved or tuple(name for name in own if name in found)


@partial(compiled, static_argnames=("robot", "integrator"))
def _trajectories(robot: Robot, integrator: Integrator, numbers, start, inputs, dt, known):
    """States [E, T, n] of a simulation in which the measured ones are set to what was measured."""

    def one(start, inputs, dt, known):
        def sample(state, row):
            u, interval, seen = row
            state = {**state, **seen}

            def substep(s, held):
                return step(robot, s, tuple(held), interval / integrator.substeps, numbers, integrator.friction), None

            after, _ = jax.lax.scan(substep, state, u)
            return after, jnp.stack([state[name] for name in robot.states])

        fine = commanded(robot, numbers, inputs, dt, integrator.substeps, begins_in_motion(robot, start))
        return jax.lax.scan(sample, start, (fine, dt, known))[1]

    return jax.vmap(one)(start, inputs, dt, known)


def state_scales(
    robot: Robot, integrator: Integrator, numbers, start, batch, known: dict[str, Float[Array, "E T"]]
) -> NDArray[np.float64]:
    """Root mean square of every state [n], one where a state never moves: units cancel in whatever is relative to it."""
    trajectories = np.asarray(_trajectories(robot, integrator, numbers, start, batch.inputs, batch.dt, known))
    real = np.arange(trajectories.shape[1])[None, :] < np.asarray(batch.length)[:, None]
    found = []
    for i in range(len(robot.states)):
        values = trajectories[..., i][real]
        values = values[np.isfinite(values)]
        rms = float(np.sqrt(np.mean(values**2))) if values.size else 0.0
        found.append(rms if np.isfinite(rms) and rms > 0 else 1.0)
    return np.array(found)
