"""Numbers for compiled programs. An operation of `jax.numpy` outside of a program is compiled as a program of its own, for
every shape, which takes a few hundredths of a second: what is prepared for a program is prepared with NumPy."""

from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

if TYPE_CHECKING:
    AnyArray = Any
else:
    AnyArray = Array | np.ndarray | np.generic
"""JAX's array, or NumPy's; what is written for both has no one static type."""


def array(values: Any) -> Array:
    """NumPy's array (or a number, or a list of numbers) as JAX's, nothing compiled."""
    return jax.device_put(np.asarray(values))


def namespace(values: Any) -> Any:
    """`jax.numpy` for JAX's array, a traced one included, else `numpy`: what is written once for both compiles nothing where
    it is given numbers."""
    return jnp if isinstance(values, jax.Array) else np


def chosen(condition: Any, new: Any, old: Any) -> Any:
    """The tree `new` where the condition holds, else `old`."""
    if isinstance(condition, jax.Array):
        return jax.tree.map(lambda a, b: jnp.where(condition, a, b), new, old)
    return new if condition else old


def surely_not(condition: Any) -> bool:
    """Whether a condition is known not to hold, as it never is while JAX traces."""
    return not isinstance(condition, jax.Array) and not condition
