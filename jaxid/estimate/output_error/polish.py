"""Undamped steps next to a minimum, extrapolated.

A Gauss-Newton step leaves out how the residual itself bends the cost, so that what is left after each step is a constant share
of what was left before: a tenth, or six tenths. Two steps in a row show that share, and the place where all that follow would
end is known from them (Anderson's extrapolation of depth one, Journal of the ACM 12, 1965; Aitken's of a vector).

Arrays are NumPy's, or JAX's inside a program.
"""

from jaxtyping import Float

from ..._arrays import AnyArray as Array
from ..._arrays import namespace
from .problem import Triangle, Unknowns

_FARTHEST = 10.0
"""Extrapolation beyond so many steps is not believed."""


def _moved(triangle: Triangle, step: Unknowns) -> tuple[Float[Array, "E s"], Float[Array, " n"]]:
    """J times a step."""
    own = (triangle.local * step.states[:, None, :]).sum(axis=2) + triangle.crossed @ step.z
    return own, triangle.shared @ step.z


def _less(a: Unknowns, b: Unknowns) -> Unknowns:
    return Unknowns(a.z - b.z, a.states - b.states)


def extrapolated(triangle: Triangle, here: Unknowns, there: Unknowns, before: Unknowns, after: Unknowns) -> Unknowns:
    """Where steps end of which this one leads from `here` to `there` and the last one led from `before` to `after`; lengths are
    those of `triangle`, the Jacobian `here`."""
    xp = namespace(triangle.shared)
    step = _less(there, here)
    change = _less(step, _less(after, before))
    by, of = _moved(triangle, change), _moved(triangle, step)
    square = sum((x**2).sum() for x in by)
    share = sum((x * y).sum() for x, y in zip(by, of, strict=True)) / xp.where(square > 0.0, square, 1.0)
    share = xp.where(xp.isfinite(share) & (xp.abs(share) <= _FARTHEST), share, 0.0)
    # The difference of where the two steps lead.
    apart = _less(there, after)
    return Unknowns(there.z - share * apart.z, there.states - share * apart.states)
