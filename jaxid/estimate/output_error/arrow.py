"""Damped steps of an arrow-shaped least-squares problem, experiment by experiment.

Every experiment (or window of a log) has unknowns of its own beside the shared parameters, so that the Jacobian's triangle
is an arrow. Eliminating each experiment's own unknowns by a small QR first costs E small decompositions, where one of
the whole matrix costs the cube of E: with thousands of windows, milliseconds instead of hours (Bjorck, Numerical
Methods for Least Squares Problems, 1996, section 6.3).

Arrays are NumPy's, or JAX's inside a program.
"""

from typing import NamedTuple

from jaxtyping import Float

from ..._arrays import AnyArray as Array
from ..._arrays import namespace
from ...kernel.dense import orthogonal_columns, triangle_of
from .problem import Triangle, Unknowns


def gradient(triangle: Triangle) -> Unknowns:
    """Jᵀ r."""
    by_z = triangle.shared.T @ triangle.residual_shared
    own = triangle.residual_local[..., None]
    by_z = by_z + (triangle.crossed * own).sum(axis=(0, 1))
    return Unknowns(by_z, (triangle.local * own).sum(axis=1))


def norms(triangle: Triangle) -> Unknowns:
    """Lengths of the Jacobian's columns."""
    xp = namespace(triangle.shared)
    by_z = (triangle.shared**2).sum(axis=0) + (triangle.crossed**2).sum(axis=(0, 1))
    return Unknowns(xp.sqrt(by_z), xp.sqrt((triangle.local**2).sum(axis=1)))


def in_units(triangle: Triangle, units: Unknowns) -> Triangle:
    """The same problem for unknowns in other units."""
    return triangle._replace(
        shared=triangle.shared * units.z,
        crossed=triangle.crossed * units.z,
        local=triangle.local * units.states[:, None, :],
    )


def solved_upwards(R: Float[Array, "... s s"], b: Float[Array, "... s"]) -> Float[Array, "... s"]:
    """x of R x = b for small upper triangles, written out."""
    x: list[Array] = []
    for i in reversed(range(R.shape[-1])):
        known = sum(R[..., i, i + 1 + k] * value for k, value in enumerate(x))
        x.insert(0, (b[..., i] - known) / R[..., i, i])
    return namespace(b).stack(x, axis=-1)


class Eliminated(NamedTuple):
    """A problem whose experiments' own unknowns are eliminated, slightly damped.

    `pull`, `values`, `right`: what is left for the shared unknowns, by singular values; `pull` is the gradient along the
    singular vectors. `own` [E, s, s + n + 1]: rows from which the own unknowns follow.
    """

    pull: Float[Array, " n"]
    values: Float[Array, " n"]
    right: Float[Array, "n n"]
    own: Float[Array, "E s m"]

    def shared_step(self, damping: Float[Array, "*lanes"] | float) -> Float[Array, "*lanes n"]:
        """Damped steps of the shared unknowns."""
        damping = namespace(self.pull).asarray(damping)[..., None]
        return -(self.pull / (self.values**2 + damping)) @ self.right

    def own_step(
        self, shared: Float[Array, "*lanes n"], share: Float[Array, "*lanes E 1"] | float = 1.0
    ) -> Float[Array, "*lanes E s"]:
        """What goes with steps of the shared unknowns: a `share` of the way that the own ones would go alone, and all that
        the shared ones cause."""
        E, s, n = *self.own.shape[:2], shared.shape[-1]
        if not s:
            return namespace(shared).zeros((*shared.shape[:-1], E, 0))
        caused = shared @ self.own[:, :, s:-1].reshape(E * s, n).T
        return -solved_upwards(
            self.own[:, :, :s], caused.reshape(*shared.shape[:-1], E, s) + share * self.own[:, :, -1]
        )


def eliminate(triangle: Triangle, damping: float) -> Eliminated:
    """Eliminate the experiments' own unknowns, damped by `damping`."""
    xp = namespace(triangle.shared)
    E, s, n = triangle.crossed.shape
    shared = xp.concatenate([triangle.shared, triangle.residual_shared[:, None]], axis=1)
    rows = xp.zeros((E, 0, n + 1))
    if s:
        measured = xp.concatenate([triangle.local, triangle.crossed, triangle.residual_local[:, :, None]], axis=2)
        damped = xp.concatenate([damping**0.5 * xp.eye(s), xp.zeros((s, n + 1))], axis=1)
        rows = triangle_of(xp.concatenate([measured, xp.broadcast_to(damped, (E, *damped.shape))], axis=1))
        shared = triangle_of(xp.concatenate([rows[:, s:, s:].reshape(-1, n + 1), shared]))
    columns, right = orthogonal_columns(shared[:, :n])
    return Eliminated(columns @ shared[:, n], xp.sqrt((columns**2).sum(axis=1)), right, rows[:, :s])
