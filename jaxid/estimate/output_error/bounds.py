"""Bounds by transformation: the optimiser moves unbounded coordinates, the parameters never leave their bounds.

    one bound    theta = lower + scale * s(z),   s(z) = (z + sqrt(z² + 4 c²)) / 2,  c = 0.01
    two bounds   theta = middle + half * z / sqrt(1 + z²)

`s` is the identity for z >> c, so that a parameter far from its bound is fitted as it is, and it approaches the bound
algebraically rather than exponentially: a parameter whose best value lies at the bound gets there.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

_CORNER = 0.01
_DEEPEST = 10 * _CORNER
_WIDEST = 10.0


class Bounds(eqx.Module):
    """Bounds and typical magnitude (`scale`) of n parameters; infinite where there is no bound."""

    lower: Float[Array, " n"]
    upper: Float[Array, " n"]
    scale: Float[Array, " n"]

    def _kinds(self):
        has_lower, has_upper = jnp.isfinite(self.lower), jnp.isfinite(self.upper)
        lower = jnp.where(has_lower, self.lower, 0.0)
        upper = jnp.where(has_upper, self.upper, 0.0)
        return has_lower & has_upper, has_lower, has_upper, lower, upper

    def physical(self, z: Float[Array, " n"]) -> Float[Array, " n"]:
        """Parameters from the optimiser's coordinates."""
        both, has_lower, has_upper, lower, upper = self._kinds()
        corner = 0.5 * (jnp.abs(z) + jnp.sqrt(z * z + 4 * _CORNER**2))
        positive = jnp.where(z >= 0, corner, _CORNER**2 / corner)  # the same for z < 0, without cancellation
        inside = 0.5 * (lower + upper) + 0.5 * (upper - lower) * z / jnp.sqrt(1.0 + z * z)
        one_sided = jnp.where(has_lower, lower + self.scale * positive, upper - self.scale * positive)
        return jnp.where(both, inside, jnp.where(has_lower | has_upper, one_sided, self.scale * z))

    def slope(self, z: Float[Array, " n"]) -> Float[Array, " n"]:
        """d(parameter)/d(coordinate)."""
        both, has_lower, has_upper, lower, upper = self._kinds()
        root = jnp.sqrt(z * z + 4 * _CORNER**2)
        rising = self.scale * 0.5 * (1.0 + z / root)
        inside = 0.5 * (upper - lower) * (1.0 + z * z) ** -1.5
        return jnp.where(both, inside, jnp.where(has_lower, rising, jnp.where(has_upper, -rising, self.scale)))

    def reachable(self, z: Float[Array, " n"]) -> Float[Array, " n"]:
        """The coordinates, kept from where the parameter has practically reached its bound and hardly moves any more.

        A step that overshoots would leave it there for ever, though a smaller step might show that it belongs inside.
        """
        both, has_lower, has_upper, _, _ = self._kinds()
        one_sided = jnp.where(has_lower | has_upper, jnp.maximum(z, -_DEEPEST), z)
        return jnp.where(both, jnp.clip(z, -_WIDEST, _WIDEST), one_sided)

    def coordinates(self, theta: Float[Array, " n"]) -> Float[Array, " n"]:
        """The optimiser's coordinates of given parameters; a parameter on its bound starts just inside."""
        both, has_lower, has_upper, lower, upper = self._kinds()
        distance = jnp.where(has_lower, theta - lower, upper - theta) / self.scale
        distance = jnp.maximum(distance, _CORNER)  # the corner itself, where the slope is one half
        one_sided = distance - _CORNER**2 / distance
        half = jnp.where(both, 0.5 * (upper - lower), 1.0)
        share = jnp.clip((theta - 0.5 * (lower + upper)) / half, -0.98, 0.98)
        inside = share / jnp.sqrt(1.0 - share * share)
        return jnp.where(both, inside, jnp.where(has_lower | has_upper, one_sided, theta / self.scale))
