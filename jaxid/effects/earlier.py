"""Where the past lies between stamps."""

import jax.numpy as jnp

from ..kernel.places import stamps_before


def earlier(time, delay):
    """Where `time - delay` [T] lies between the increasing stamps `time` [T], `delay` >= 0: the stamp before it, and the
    share of the interval from there to the next; before the first stamp, that stamp itself."""
    then = jnp.maximum(time - delay, time[0])
    # At a stamp itself the interval before it: the derivative at no delay is that of a small one.
    before = jnp.clip(stamps_before(time, then) - 1, 0, len(time) - 2)
    return before, (then - time[before]) / (time[before + 1] - time[before])
