"""Bounds of the parameters, and the coordinates in which the optimisers move.

Two kinds of coordinates, neither of which knows a unit:

- `Bounds`: z = parameter / scale, kept inside the bounds by projection. A parameter whose best value is its bound ends on
  it exactly. The scale is a mere unit: what an optimiser does must not depend on it.
- `Unconstrained`: coordinates without bounds, for solvers and samplers that know of none, built around given parameters:

    one bound    theta = bound ± reach * s(q),   s(q) = (q + sqrt(q² + 4 c²)) / 2,  c = 0.01
    two bounds   theta = middle + half * q / sqrt(1 + q²)

  `s` is the identity for q >> c and approaches the bound algebraically rather than exponentially. `reach` is the distance
  from the bound there.
"""

from types import SimpleNamespace
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Float

from ..._arrays import AnyArray as Array
from ..._arrays import namespace

_CORNER = 0.01


class Plain(SimpleNamespace):
    """A problem's or its bounds' attributes as NumPy's arrays, to be read alone: a module's take microseconds each, which a fit
    of many small steps is made of."""


class Bounds(eqx.Module):
    """Bounds of n parameters, infinite where there is none, and the unit (`scale`) of their coordinates."""

    lower: Float[Array, " n"]
    upper: Float[Array, " n"]
    scale: Float[Array, " n"]

    def physical(self, z: Float[Array, "*lanes n"]) -> Any:
        """Parameters from the optimiser's coordinates, never outside their bounds. NumPy's arrays stay such."""
        return physical(self, z)

    def slope(self, z: Float[Array, "*lanes n"]) -> Any:
        """d(parameter)/d(coordinate) inside the bounds, and on them to the inside."""
        return namespace(self.scale).broadcast_to(self.scale, z.shape)

    def coordinates(self, theta: Float[Array, "*lanes n"]) -> Float[Array, "*lanes n"]:
        """The optimiser's coordinates of given parameters; those outside their bounds are put on them. NumPy's arrays stay
        such."""
        xp = namespace(self.scale * theta)
        return xp.clip(theta, self.lower, self.upper) / self.scale


def physical(bounds: Bounds | Plain, z: Float[Array, "*lanes n"]) -> Any:
    """`Bounds.physical` as a function: binding a method of a module takes longer than the few numbers do."""
    theta = bounds.scale * z
    xp = namespace(theta)
    return xp.minimum(xp.maximum(theta, bounds.lower), bounds.upper)


class Unconstrained(eqx.Module):
    """Smooth coordinates q of z in which there are no bounds. `reach` is the distance from the bound, in units of z, where
    q = 1."""

    lower: Float[Array, " n"]
    upper: Float[Array, " n"]
    reach: Float[Array, " n"]

    @classmethod
    def around(cls, bounds: Bounds, z: Float[Array, " n"], least: Float[Array, " n"]) -> "Unconstrained":
        """Coordinates around `z`; `least` [n] is the reach of a parameter that lies on its bound, or is zero without one."""
        lower, upper = bounds.lower / bounds.scale, bounds.upper / bounds.scale
        distance = jnp.minimum(jnp.abs(z - lower), jnp.abs(upper - z))
        distance = jnp.where(jnp.isfinite(distance), distance, jnp.abs(z))
        return cls(lower, upper, jnp.maximum(distance, jnp.where(least > 0, least, 1.0)))

    def _kinds(self):
        has_lower, has_upper = jnp.isfinite(self.lower), jnp.isfinite(self.upper)
        return has_lower & has_upper, has_lower, has_upper, *self._finite()

    def _finite(self):
        return tuple(jnp.where(jnp.isfinite(x), x, 0.0) for x in (self.lower, self.upper))

    def to_z(self, q: Float[Array, " n"]) -> Float[Array, " n"]:
        """Coordinates z from unconstrained ones."""
        both, has_lower, has_upper, lower, upper = self._kinds()
        corner = 0.5 * (jnp.abs(q) + jnp.sqrt(q * q + 4 * _CORNER**2))
        positive = jnp.where(q >= 0, corner, _CORNER**2 / corner)  # the same for q < 0, without cancellation
        inside = 0.5 * (lower + upper) + 0.5 * (upper - lower) * q / jnp.sqrt(1.0 + q * q)
        one_sided = jnp.where(has_lower, lower + self.reach * positive, upper - self.reach * positive)
        return jnp.where(both, inside, jnp.where(has_lower | has_upper, one_sided, self.reach * q))

    def slope(self, q: Float[Array, " n"]) -> Float[Array, " n"]:
        """dz/dq."""
        both, has_lower, has_upper, lower, upper = self._kinds()
        root = jnp.sqrt(q * q + 4 * _CORNER**2)
        rising = self.reach * 0.5 * (1.0 + q / root)
        inside = 0.5 * (upper - lower) * (1.0 + q * q) ** -1.5
        return jnp.where(both, inside, jnp.where(has_lower, rising, jnp.where(has_upper, -rising, self.reach)))

    def from_z(self, z: Float[Array, " n"]) -> Float[Array, " n"]:
        """Unconstrained coordinates; a parameter on its bound is put just inside, where the slope is one half."""
        both, has_lower, has_upper, lower, upper = self._kinds()
        distance = jnp.where(has_lower, z - lower, upper - z) / self.reach
        distance = jnp.maximum(distance, _CORNER)
        one_sided = distance - _CORNER**2 / distance
        half = jnp.where(both, 0.5 * (upper - lower), 1.0)
        share = jnp.clip((z - 0.5 * (lower + upper)) / half, -0.98, 0.98)
        inside = share / jnp.sqrt(1.0 - share * share)
        return jnp.where(both, inside, jnp.where(has_lower | has_upper, one_sided, z / self.reach))
