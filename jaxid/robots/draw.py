"""What chance does once of a signal, where an effect's law is the mean over all that it may do."""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

Signal = Float[np.ndarray, "T n"]


class Draw(NamedTuple):
    """One draw of the robot's inputs, or outputs: `once(signal [T, n], time [T] s, random) -> signal [T, n]`."""

    of: Literal["inputs", "outputs"]
    once: Callable[[Signal, Float[np.ndarray, " T"], np.random.Generator], Signal]
