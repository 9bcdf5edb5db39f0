"""Damped steps of an arrow-shaped least-squares problem, experiment by experiment.

Every experiment (or window of a log) has unknowns of its own beside the shared parameters, so that the Jacobian's triangle
is an arrow. Eliminating each experiment's own unknowns by a small QR first costs E small decompositions, where one of
the whole matrix costs the cube of E: with thousands of windows, milliseconds instead of hours (Bjorck, Numerical
Methods for Least Squares Problems, 1996, section 6.3).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax.scipy.linalg import solve_triangular
from jaxtyping import Array, Float

from .problem import Unknowns


class Arrow(NamedTuple):
    """Jacobian `[[local_e, crossed_e], [0, shared]]` of the unknowns and the residual of the same rows, E experiments."""

    local: Float[Array, "E s s"]
    crossed: Float[Array, "E s n"]
    shared: Float[Array, "n n"]
    residual_local: Float[Array, "E s"]
    residual_shared: Float[Array, " n"]


def gradient(arrow: Arrow) -> Unknowns:
    """Jᵀ r."""
    by_z = arrow.shared.T @ arrow.residual_shared + jnp.einsum("eij,ei->j", arrow.crossed, arrow.residual_local)
    return Unknowns(by_z, jnp.einsum("eij,ei->ej", arrow.local, arrow.residual_local))


def damped_step(arrow: Arrow, damping: Float[Array, ""]) -> Unknowns:
    """-(JᵀJ + damping I)⁻¹ Jᵀ r, without forming JᵀJ."""
    E, s = arrow.residual_local.shape
    n = arrow.residual_shared.shape[0]
    root = jnp.sqrt(damping)
    rows = jnp.concatenate([arrow.shared, root * jnp.eye(n)])
    shared = jnp.concatenate([rows, jnp.append(arrow.residual_shared, jnp.zeros(n))[:, None]], axis=1)
    if not s:
        R = jnp.linalg.qr(shared, mode="r")
        return Unknowns(-solve_triangular(R[:n, :n], R[:n, n]), jnp.zeros((E, 0)))

    def eliminated(local, crossed, residual):
        measured = jnp.concatenate([local, crossed, residual[:, None]], axis=1)
        damped = jnp.concatenate([root * jnp.eye(s), jnp.zeros((s, n + 1))], axis=1)
        return jnp.linalg.qr(jnp.concatenate([measured, damped]), mode="r")

    triangles = jax.vmap(eliminated)(arrow.local, arrow.crossed, arrow.residual_local)
    R = jnp.linalg.qr(jnp.concatenate([triangles[:, s:, s:].reshape(-1, n + 1), shared]), mode="r")
    z = -solve_triangular(R[:n, :n], R[:n, n])

    def own(triangle):
        return -solve_triangular(triangle[:s, :s], triangle[:s, s:-1] @ z + triangle[:s, -1])

    return Unknowns(z, jax.vmap(own)(triangles))


def promise(arrow: Arrow, step: Unknowns) -> Float[Array, ""]:
    """Drop of the cost (half the sum of squares) promised for a damped step: -½ (Jᵀ r) · step, what the step itself may
    cost by its damping left out."""
    slope = gradient(arrow)
    return -0.5 * (jnp.sum(slope.z * step.z) + jnp.sum(slope.states * step.states))
