"""What effects make of whole signals, each compiled as one program: operation by operation takes ten times as long."""

import jax
import numpy as np
from numpy.typing import NDArray


def measured(effect, outputs, time, numbers, robot) -> NDArray[np.float64]:
    """`effect.measure`, with numbers of the effect by name."""
    return np.asarray(jax.jit(lambda y, t, p: effect.measure(y, t, p, robot))(outputs, time, numbers))


def commanded(effect, inputs, time, dt, numbers, robot) -> NDArray[np.float64]:
    """`effect.command`, with numbers of the effect by name."""
    return np.asarray(jax.jit(lambda u, t, h, p: effect.command(u, t, h, p, robot))(inputs, time, dt, numbers))
