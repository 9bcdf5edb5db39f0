"""Local coordinates of an optimisation step, in which no unit is left.

At every linearisation each unknown gets its own unit: how far it is from its bound, or from zero, but no less than what
shows in the data. Steps w in these units are taken

- linearly, z + unit w, up to the bounds (projection), or
- along a curve that is exponential far from a bound and linear near it,

      z = bound + width sinh(asinh((z0 - bound) / width) + w),

  `width` being the parameter's standard error if all others were known: a mass may fall by decades in a few steps, and a
  friction that the data does not want still reaches zero exactly.

Arrays are NumPy's, or JAX's inside a program.
"""

from typing import NamedTuple

from jaxtyping import Bool, Float

from ..._arrays import AnyArray as Array
from ..._arrays import namespace
from .arrow import gradient, in_units, norms
from .bounds import Bounds, Plain
from .problem import Triangle, Unknowns

_FAR = 100.0
"""Times a parameter's size, or its scale, that a unit is at most: of one that hardly shows, the little that it does would lead
anywhere, and far from what it is nothing of it shows any more."""


class Chart(NamedTuple):
    """Units of the unknowns at `here`. `held` parameters are on a bound that the cost pushes them against. `slope` and `norm`:
    the gradient of the cost and the lengths of the Jacobian's columns, in the problem's own units."""

    here: Unknowns
    units: Unknowns
    lower: Float[Array, " n"]
    upper: Float[Array, " n"]
    width: Float[Array, " n"]
    held: Bool[Array, " n"]
    slope: Unknowns
    norm: Unknowns

    def scaled(self, triangle: Triangle) -> Triangle:
        """The linearisation for steps in these units, parameters that are held left out."""
        xp = namespace(self.held)
        return in_units(triangle, self.units._replace(z=xp.where(self.held, 0.0, self.units.z)))

    def _there(self, z: Float[Array, "*lanes n"], states: Float[Array, "*lanes E s"]) -> Unknowns:
        xp = namespace(z)
        return Unknowns(xp.clip(z, self.lower, self.upper), self.here.states + self.units.states * states)

    def within(self, there: Unknowns) -> Unknowns:
        """A place, projected onto the bounds."""
        return there._replace(z=namespace(there.z).clip(there.z, self.lower, self.upper))

    def straight(self, w: Float[Array, "*lanes n"], states: Float[Array, "*lanes E s"]) -> Unknowns:
        """Where linear steps lead, projected onto the bounds."""
        return self._there(self.here.z + self.units.z * w, states)

    def curved(self, w: Float[Array, "*lanes n"], states: Float[Array, "*lanes E s"]) -> Unknowns:
        """Where steps along the curve lead; linear for parameters without bounds."""
        xp = namespace(w)
        has_lower, has_upper = xp.isfinite(self.lower), xp.isfinite(self.upper)
        lower, upper = (xp.where(xp.isfinite(x), x, 0.0) for x in (self.lower, self.upper))

        def along(distance, step):
            own = xp.hypot(distance, self.width)
            return self.width * xp.sinh(xp.arcsinh(distance / self.width) + step * self.units.z / own)

        from_lower = lower + along(xp.where(has_lower, self.here.z - lower, 0.0), w)
        from_upper = upper - along(xp.where(has_upper, upper - self.here.z, 0.0), -w)
        bent = xp.where(has_lower & ((w < 0) | ~has_upper), from_lower, from_upper)
        return self._there(xp.where(has_lower | has_upper, bent, self.here.z + self.units.z * w), states)


def _widths(norm: Float[Array, "..."], otherwise: Float[Array, "..."]) -> Float[Array, "..."]:
    """Standard errors of unknowns if all others were known; `otherwise` (or one, if that is zero) without effect."""
    xp = namespace(norm)
    return xp.where(norm > 0, 1.0 / xp.where(norm > 0, norm, 1.0), xp.where(otherwise > 0, otherwise, 1.0))


def chart_at(bounds: Bounds | Plain, here: Unknowns, triangle: Triangle) -> Chart:
    """The units at a linearisation."""
    xp = namespace(triangle.shared)
    lower, upper = bounds.lower / bounds.scale, bounds.upper / bounds.scale
    below, above, size = here.z - lower, upper - here.z, xp.abs(here.z)
    nearest = xp.minimum(below, above)
    bounded = xp.isfinite(nearest)
    norm = norms(triangle)
    width = _widths(norm.z, xp.where(bounded, nearest, size))
    # Without a bound: as far as the unknown alone could go to explain all of the residual.
    residual = xp.maximum(xp.sqrt(2.0 * triangle.cost), 1.0)
    free = xp.maximum(size, xp.where(norm.z > 0, residual, 1.0) * width)
    units = xp.minimum(xp.where(bounded, xp.hypot(nearest, width), free), _FAR * xp.maximum(size, 1.0))
    states = _widths(norm.states, xp.abs(here.states)) * xp.where(norm.states > 0, residual, 1.0)
    slope = gradient(triangle)
    return Chart(
        here=here,
        units=Unknowns(units, xp.maximum(states, xp.abs(here.states))),
        lower=lower,
        upper=upper,
        width=width,
        held=((here.z <= lower) & (slope.z >= 0)) | ((here.z >= upper) & (slope.z <= 0)),
        slope=slope,
        norm=norm,
    )
