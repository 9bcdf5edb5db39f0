"""Numbers for compiled programs. An operation of `jax.numpy` outside of a program is compiled as a program of its own, for
every shape, which takes a few hundredths of a second: what is prepared for a program is prepared with NumPy."""

from typing import Any

import jax
import numpy as np
from jaxtyping import Array

AnyArray = Array | np.ndarray | np.generic
"""JAX's array, or NumPy's: what programs give to the many fits of a batch is NumPy's."""


def array(values: Any) -> Array:
    """NumPy's array (or a number, or a list of numbers) as JAX's, nothing compiled."""
    return jax.device_put(np.asarray(values))
