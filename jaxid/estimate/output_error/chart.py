"""Local coordinates of an optimisation step, in which no unit is left.

At every linearisation each unknown gets its own unit: how far it is from its bound, or from zero, but no less than what
shows in the data. Steps w in these units are taken

- linearly, z + unit w, up to the bounds (projection), or
- along a curve that is exponential far from a bound and linear near it,

      z = bound + width sinh(asinh((z0 - bound) / width) + w),

  `width` being the parameter's standard error if all others were known: a mass may fall by decades in a few steps, and a
  friction that the data does not want still reaches zero exactly.
"""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .arrow import gradient, in_units, norms
from .bounds import Bounds
from .problem import Triangle, Unknowns


class Chart(NamedTuple):
    """Units of the unknowns at `here`. `held` parameters are on a bound that the cost pushes them against."""

    here: Unknowns
    units: Unknowns
    lower: Float[Array, " n"]
    upper: Float[Array, " n"]
    width: Float[Array, " n"]
    held: Bool[Array, " n"]

    def scaled(self, triangle: Triangle) -> Triangle:
        """The linearisation for steps in these units, parameters that are held left out."""
        return in_units(triangle, self.units._replace(z=jnp.where(self.held, 0.0, self.units.z)))

    def _there(self, z: Float[Array, " n"], states: Float[Array, "E s"]) -> Unknowns:
        return Unknowns(jnp.clip(z, self.lower, self.upper), self.here.states + self.units.states * states)

    def straight(self, w: Float[Array, " n"], states: Float[Array, "E s"]) -> Unknowns:
        """Where a linear step leads, projected onto the bounds."""
        return self._there(self.here.z + self.units.z * w, states)

    def curved(self, w: Float[Array, " n"], states: Float[Array, "E s"]) -> Unknowns:
        """Where a step along the curve leads; linear for parameters without bounds."""
        has_lower, has_upper = jnp.isfinite(self.lower), jnp.isfinite(self.upper)
        lower, upper = (jnp.where(jnp.isfinite(x), x, 0.0) for x in (self.lower, self.upper))

        def along(distance, step):
            own = jnp.hypot(distance, self.width)
            return self.width * jnp.sinh(jnp.arcsinh(distance / self.width) + step * self.units.z / own)

        from_lower = lower + along(jnp.where(has_lower, self.here.z - lower, 0.0), w)
        from_upper = upper - along(jnp.where(has_upper, upper - self.here.z, 0.0), -w)
        bent = jnp.where(has_lower & ((w < 0) | ~has_upper), from_lower, from_upper)
        return self._there(jnp.where(has_lower | has_upper, bent, self.here.z + self.units.z * w), states)


def _widths(norm: Float[Array, "..."], otherwise: Float[Array, "..."]) -> Float[Array, "..."]:
    """Standard errors of unknowns if all others were known; `otherwise` (or one, if that is zero) without effect."""
    return jnp.where(norm > 0, 1.0 / jnp.where(norm > 0, norm, 1.0), jnp.where(otherwise > 0, otherwise, 1.0))


def chart_at(bounds: Bounds, here: Unknowns, triangle: Triangle) -> Chart:
    """The units at a linearisation."""
    lower, upper = bounds.lower / bounds.scale, bounds.upper / bounds.scale
    below, above, size = here.z - lower, upper - here.z, jnp.abs(here.z)
    nearest = jnp.minimum(below, above)
    bounded = jnp.isfinite(nearest)
    norm = norms(triangle)
    width = _widths(norm.z, jnp.where(bounded, nearest, size))
    # Without a bound: as far as the unknown alone could go to explain all of the residual.
    residual = jnp.maximum(jnp.sqrt(2.0 * triangle.cost), 1.0)
    free = jnp.maximum(size, jnp.where(norm.z > 0, residual, 1.0) * width)
    states = _widths(norm.states, jnp.abs(here.states)) * jnp.where(norm.states > 0, residual, 1.0)
    slope = gradient(triangle).z
    return Chart(
        here=here,
        units=Unknowns(jnp.where(bounded, jnp.hypot(nearest, width), free), jnp.maximum(states, jnp.abs(here.states))),
        lower=lower,
        upper=upper,
        width=width,
        held=((here.z <= lower) & (slope >= 0)) | ((here.z >= upper) & (slope <= 0)),
    )
