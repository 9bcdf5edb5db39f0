"""How what acts follows what was commanded: held inputs behind lags and ramps, their exact means over every step."""

import jax.numpy as jnp

from ...kernel.recurrence import approached, limited, recurrence, saturated

_TINY = 1e-9
"""Share of a step below which a time constant is none."""


def low_passed(inputs, dt, T):
    """`inputs` [T, nu] held over steps `dt` behind a first-order lag of time constant `T` (one, or one an input): its exact
    mean over every step."""
    dt = dt[:, None]
    keep = jnp.exp(-dt / jnp.maximum(T, _TINY * dt))
    share = T / dt * (1.0 - keep)
    rest = jnp.zeros_like(inputs[0])
    lagged = recurrence(keep, inputs * (1.0 - keep), rest)
    before = jnp.concatenate([rest[None], lagged[:-1]])
    return inputs + (before - inputs) * share


def ramped(inputs, dt, away, back=None):
    """`inputs` [T, nu] followed by at most one unit in `away` seconds, and towards zero in `back` (default: the same; each one,
    or one an input): the mean over every step."""
    back = away if back is None else back
    dt = dt[:, None]
    after = limited(inputs, *(dt / jnp.maximum(per_unit, _TINY * dt) for per_unit in (away, back)))
    before = jnp.concatenate([jnp.zeros_like(after[:1]), after[:-1]])
    # It turns where it passes zero, if it does; it ramps for as long as both ways take, and then holds.
    turn = jnp.clip(0.0, jnp.minimum(before, after), jnp.maximum(before, after))
    first, second = jnp.abs(turn - before) * back / dt, jnp.abs(after - turn) * away / dt
    return after + first * (0.5 * (before + turn) - after) + second * 0.5 * (turn - after)


def lagged_unequally(inputs, dt, away, back):
    """`inputs` [T, nu] held over steps `dt` behind a lag of time constant `away` where its output grows in size, and `back`
    where it shrinks: the exact mean over every step."""
    dt = dt[:, None]
    after = approached(inputs, *(dt / jnp.maximum(T, _TINY * dt) for T in (away, back)))
    before = jnp.concatenate([jnp.zeros_like(after[:1]), after[:-1]])
    turn = jnp.clip(0.0, jnp.minimum(before, after), jnp.maximum(before, after))
    return inputs - (back * (turn - before) + away * (after - turn)) / dt


def as_a_servo(inputs, dt, T, per_unit):
    """`inputs` [T, nu] held over steps `dt`, followed by a loop that closes what is left within the time `T`, by one unit in
    `per_unit` seconds at most (each one, or one an input; zero: no limit): the exact mean over every step."""
    dt = dt[:, None]
    share, most = dt / jnp.maximum(T, _TINY * dt), dt / jnp.maximum(per_unit, _TINY * dt)
    after = saturated(inputs, share, most)
    before = jnp.concatenate([jnp.zeros_like(after[:1]), after[:-1]])
    gap, band = inputs - before, most / share
    size = jnp.abs(gap)
    first = jnp.clip((size - band) / most, 0.0, 1.0)
    slow = size - most * first  # what is left where it begins to slow down
    left = first * 0.5 * (size + slow) + slow * -jnp.expm1(-share * (1.0 - first)) / share
    return inputs - jnp.sign(gap) * left
