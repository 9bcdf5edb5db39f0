"""Sine and cosine for rollouts.

Double-precision `sin` and `cos` are the slowest operations of a rollout on the CPU backend (several times the cost of
`tanh`), because each falls back to a scalar library call. This polynomial vectorises. Its error is below 4e-16 for
|x| <= 30 and grows with the rounding of the argument beyond that.
"""

import math

import jax
import jax.numpy as jnp

from .effect import Scalar

_PI_HIGH = 3.141592653589793
_PI_LOW = 1.2246467991473532e-16  # pi - _PI_HIGH, so that the reduced angle keeps full precision
# Taylor series on [-pi/2, pi/2]; the first neglected terms are below 1e-17 there.
_SINE = [(-1.0) ** k / math.factorial(2 * k + 1) for k in range(12)]
_COSINE = [(-1.0) ** k / math.factorial(2 * k) for k in range(12)]


def _horner(coefficients: list[float], z: Scalar) -> Scalar:
    total: Scalar = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = coefficient + z * total
    return total


@jax.jit  # traced once, not operation by operation for every angle of every model
def _polynomials(x: Scalar) -> tuple[Scalar, Scalar]:
    turns = jnp.round(x * (1.0 / _PI_HIGH))
    r = x - turns * _PI_HIGH - turns * _PI_LOW
    sign = 1.0 - 2.0 * (turns - 2.0 * jnp.floor(0.5 * turns))
    z = r * r
    return sign * r * _horner(_SINE, z), sign * _horner(_COSINE, z)


@jax.custom_jvp
def sincos(x: Scalar) -> tuple[Scalar, Scalar]:
    """(sin x, cos x) of an angle [rad]."""
    return _polynomials(x)


@sincos.defjvp
def _sincos_jvp(primals, tangents):
    (x,), (dx,) = primals, tangents
    s, c = sincos(x)
    return (s, c), (c * dx, -s * dx)
