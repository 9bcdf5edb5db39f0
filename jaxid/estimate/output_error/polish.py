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
from ..._arrays import namespace
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


def _moved(triangle: Triangle, step: Unknowns) -> Float[Array, " m"]:
    """J times a step."""
    own = (triangle.local * step.states[:, None, :]).sum(axis=2) + triangle.crossed @ step.z
    return namespace(own).concatenate([own.ravel(), triangle.shared @ step.z])


def _less(a: Unknowns, b: Unknowns, share: Float[Array, ""] | float = 1.0) -> Unknowns:
    return Unknowns(a.z - share * b.z, a.states - share * b.states)


def extrapolated(triangle: Triangle, here: Unknowns, there: Unknowns, steps: Steps) -> Unknowns:
    """Where steps end of which this one leads from `here` to `there` after `steps`; lengths are those of `triangle`, the
    Jacobian `here`."""
    xp = namespace(triangle.shared)
    whole = _moved(triangle, _less(there, here))
    left, end, found = whole, there, []
    last = here, there
    for k in range(_KEPT):
        earlier = tuple(Unknowns(*(leaf[k] for leaf in both)) for both in (steps.before, steps.after))
        apart = _less(last[1], earlier[1])
        change = _moved(triangle, _less(apart, _less(last[0], earlier[0])))
        size = (change**2).sum()
        for other, its, square in found:  # what the later changes show already
            share = (change @ other) / square
            change, apart = change - share * other, _less(apart, its, share)
        square = (change**2).sum()
        tells = (k < steps.known) & (square > _LEAST * size) & (square > 0.0)
        square = xp.where(tells, square, 1.0)
        share = xp.where(tells, (change @ left) / square, 0.0)
        left, end = left - share * change, _less(end, apart, share)
        found.append((xp.where(tells, change, 0.0), apart, square))
        last = earlier
    beyond = _moved(triangle, _less(end, there))
    near = (beyond**2).sum() <= _FARTHEST**2 * (whole**2).sum()
    return Unknowns(*(xp.where(near, a, b) for a, b in zip(end, there, strict=True)))
