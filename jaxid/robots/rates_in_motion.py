"""The rates of a robot that moves, its dry friction against the motion, in many states at once."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .effect import Numbers, Scalars, State
from .robot import Robot


def rates_in_motion(
    robot: Robot, names: Sequence[str], states: State, inputs: Scalars, numbers: Numbers
) -> Float[Array, "N m"]:
    """The rates of the states `names` [m] in each of the `states` [N], under `inputs` [N] by channel. Call under float64."""

    def rates(state: State, given: Scalars) -> Float[Array, " m"]:
        speeds, levels = robot.rubbing(state, numbers), robot.coulomb(state, numbers)
        dry = tuple(
            jnp.where(speed > 0, forward, -backward)
            for speed, (backward, forward) in zip(speeds, levels, strict=True)
        )  # fmt: skip
        found = robot.rates(state, given, dry, numbers)
        return jnp.stack([jnp.asarray(found[name], float) for name in names])

    return jax.vmap(rates)(states, tuple(inputs))
