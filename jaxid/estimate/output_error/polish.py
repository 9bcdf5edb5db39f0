"""Undamped steps next to a minimum, extrapolated.

A Gauss-Newton step leaves out how the residual itself bends the cost, so that what is left after each step is a constant share
of what was left before, another in every direction: a tenth, or six tenths. A few steps in a row show these shares, and the
place where all that follow would end is known from them (Anderson's extrapolation, Journal of the ACM 12, 1965).

Arrays are NumPy's, or JAX's inside a program.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from ..._arrays import AnyArray as Array
from ..._arrays import namespace, surely_not
from .problem import Triangle, Unknowns

_KEPT = 3
"""So many steps are kept."""
_FARTHEST = 10.0
"""Extrapolation beyond so many lengths of the step is not believed."""
_LEAST = 1e-20
"""Share of a square below which nothing is left of it."""


class Steps(NamedTuple):
    """The last undamped steps, the last one first: where each began (`before`), and where it led by itself (`after`); of which
    the first `known` count."""

    before: Unknowns
    after: Unknowns
    known: Int[Array, ""]


def no_steps(here: Unknowns) -> Steps:
    """Before the first one."""
    none = Unknowns(*(np.zeros((_KEPT, *leaf.shape)) for leaf in here))
    return Steps(none, none, np.asarray(0))


def with_step(steps: Steps, here: Unknowns, there: Unknowns) -> Steps:
    """With one more, from `here` to `there`."""
    xp = namespace(here.z)

    def ahead(new: Unknowns, old: Unknowns) -> Unknowns:
        return Unknowns(*(xp.concatenate([a[None], b[:-1]]) for a, b in zip(new, old, strict=True)))

    return Steps(ahead(here, steps.before), ahead(there, steps.after), xp.minimum(steps.known + 1, _KEPT))


def _flat(points: Unknowns) -> Float[Array, "k N"]:
    """Parameters and initial states of k points, one behind the other."""
    z, states = points
    return namespace(z).concatenate([z, states.reshape(len(z), states.shape[1] * states.shape[2])], axis=1)


def _moved(triangle: Triangle, steps: Float[Array, "k N"]) -> Float[Array, "k M"]:
    """J times steps."""
    E, s, n = triangle.crossed.shape
    k = len(steps)
    z, states = steps[:, :n], steps[:, n:].reshape(k, E, 1, s)
    own = (triangle.local * states).sum(axis=3).reshape(k, E * s) + z @ triangle.crossed.reshape(E * s, n).T
    return namespace(own).concatenate([own, z @ triangle.shared.T], axis=1)


def extrapolated(triangle: Triangle, here: Unknowns, there: Unknowns, steps: Steps) -> Unknowns:
    """Where steps end of which this one leads from `here` to `there` after `steps`; lengths are those of `triangle`, the
    Jacobian `here`."""
    xp, (n, shape) = namespace(triangle.shared), (len(here.z), here.states.shape)
    began, led = (
        xp.concatenate([_flat(Unknowns(new.z[None], new.states[None])), _flat(old)])
        for new, old in ((here, steps.before), (there, steps.after))
    )
    apart = led[:-1] - led[1:]
    moved = _moved(triangle, xp.concatenate([led[:1] - began[:1], apart - (began[:-1] - began[1:])]))
    left, changes, end = moved[0], moved[1:], led[0]
    for k in range(_KEPT):
        if surely_not(k < steps.known):
            break
        change, way = changes[k], apart[k]
        square = change @ change
        tells = (k < steps.known) & (square > 0.0)
        square = xp.where(tells, square, 1.0)
        share = xp.where(tells, (change @ left) / square, 0.0)
        left, end = left - share * change, end - share * way
        # What the earlier changes show beyond this one.
        same = xp.where(tells, changes @ change / square, 0.0)[:, None]
        before = (changes**2).sum(axis=1, keepdims=True)
        changes, apart = changes - same * change, apart - same * way
        changes = xp.where((changes**2).sum(axis=1, keepdims=True) > _LEAST * before, changes, 0.0)
    (beyond,) = _moved(triangle, (end - led[0])[None])
    end = xp.where(beyond @ beyond <= _FARTHEST**2 * (moved[0] @ moved[0]), end, led[0])
    return Unknowns(end[:n], end[n:].reshape(shape))
