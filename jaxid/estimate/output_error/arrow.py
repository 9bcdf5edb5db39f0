"""Damped steps of an arrow-shaped least-squares problem, experiment by experiment.

Every experiment (or window of a log) has unknowns of its own beside the shared parameters, so that the Jacobian's triangle
is an arrow. Eliminating each experiment's own unknowns by a small QR first costs E small decompositions, where one of
the whole matrix costs the cube of E: with thousands of windows, milliseconds instead of hours (Bjorck, Numerical
Methods for Least Squares Problems, 1996, section 6.3).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...kernel.dense import orthogonal_columns, triangle_of
from .problem import Triangle, Unknowns


def gradient(triangle: Triangle) -> Unknowns:
    """Jᵀ r."""
    by_z = triangle.shared.T @ triangle.residual_shared
    by_z = by_z + jnp.einsum("eij,ei->j", triangle.crossed, triangle.residual_local)
    return Unknowns(by_z, jnp.einsum("eij,ei->ej", triangle.local, triangle.residual_local))


def norms(triangle: Triangle) -> Unknowns:
    """Lengths of the Jacobian's columns."""
    by_z = jnp.sum(triangle.shared**2, axis=0) + jnp.sum(triangle.crossed**2, axis=(0, 1))
    return Unknowns(jnp.sqrt(by_z), jnp.linalg.norm(triangle.local, axis=1))


def in_units(triangle: Triangle, units: Unknowns) -> Triangle:
    """The same problem for unknowns in other units."""
    return triangle._replace(
        shared=triangle.shared * units.z,
        crossed=triangle.crossed * units.z,
        local=triangle.local * units.states[:, None, :],
    )


def solved_upwards(R: Float[Array, "s s"], b: Float[Array, " s"]) -> Float[Array, " s"]:
    """x of R x = b for a small upper triangle, written out."""
    x: list[Array] = []
    for i in reversed(range(R.shape[0])):
        known = sum((R[i, i + 1 + k] * value for k, value in enumerate(x)), jnp.zeros(()))
        x.insert(0, (b[i] - known) / R[i, i])
    return jnp.stack(x)


class Eliminated(NamedTuple):
    """A problem whose experiments' own unknowns are eliminated, slightly damped.

    `pull`, `values`, `right`: what is left for the shared unknowns, by singular values; `pull` is the gradient along the
    singular vectors. `own` [E, s, s + n + 1]: rows from which the own unknowns follow.
    """

    pull: Float[Array, " n"]
    values: Float[Array, " n"]
    right: Float[Array, "n n"]
    own: Float[Array, "E s m"]

    def shared_step(self, damping: Float[Array, ""]) -> Float[Array, " n"]:
        """Damped step of the shared unknowns."""
        return -(self.pull / (self.values**2 + damping)) @ self.right

    def own_step(self, shared: Float[Array, " n"], share: Float[Array, ""] | float = 1.0) -> Float[Array, "E s"]:
        """What goes with a step of the shared unknowns: a `share` of the way that the own ones would go alone, and all that
        the shared ones cause."""
        s = self.own.shape[1]
        if not s:
            return jnp.zeros(self.own.shape[:2])

        def solved(rows):
            return -solved_upwards(rows[:, :s], rows[:, s:-1] @ shared + share * rows[:, -1])

        return jax.vmap(solved)(self.own)


def eliminate(triangle: Triangle, damping: float) -> Eliminated:
    """Eliminate the experiments' own unknowns, damped by `damping`."""
    E, s, n = triangle.crossed.shape
    shared = jnp.concatenate([triangle.shared, triangle.residual_shared[:, None]], axis=1)
    rows = jnp.zeros((E, 0, n + 1))
    if s:

        def eliminated(local, crossed, residual):
            measured = jnp.concatenate([local, crossed, residual[:, None]], axis=1)
            damped = jnp.concatenate([jnp.sqrt(damping) * jnp.eye(s), jnp.zeros((s, n + 1))], axis=1)
            return triangle_of(jnp.concatenate([measured, damped]))

        rows = jax.vmap(eliminated)(triangle.local, triangle.crossed, triangle.residual_local)
        shared = triangle_of(jnp.concatenate([rows[:, s:, s:].reshape(-1, n + 1), shared]))
    columns, right = orthogonal_columns(shared[:, :n])
    return Eliminated(columns @ shared[:, n], jnp.linalg.norm(columns, axis=1), right, rows[:, :s])
