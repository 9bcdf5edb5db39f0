r"""The Pioneer's equations of motion in matrices, named as in the paper.

Innocenti et al., *Dynamical model parameters identification of a wheeled mobile robot*, eqs. 1-32: two driving wheels
and a caster, Lagrange's equations with five rolling constraints, reduced to the two speeds eta. This file is the
model's reference; `pioneer_closed_form` holds the same dynamics in scalars, for rollouts. Where the print and the
derivation differ, the derivation is built and the docstring says so; `docs/misprints.md` lists the differences.

Frames: body x to the right, body y forward, origin midway between the driving wheels; heading theta = 0 along world +y.
Wheel 1 is the caster, 2 the right and 3 the left driving wheel. The caster's pivot is at (0, -l1) in the body and its
wheel at (d sin beta, -l1 - d cos beta), so beta = 0 is a trailing caster.

    q   = (x, y, theta, beta, phi1, phi2, phi3)   [m, m, rad, rad, rad, rad, rad]
    eta = (eta1, eta2)                            [m/s forward, rad/s counter-clockwise]
    V   = (V2, V3), tau = (tau2, tau3)            [V], [N m at the wheels]; right, left

`p` maps the paper's symbols to scalars in SI units: M (platform), m (one driving wheel), m1 (caster wheel) [kg];
R, R1, L, l1, d, xm, ym [m]; I0, Ir1, Ir, Ip1, Ip [kg m^2] (r: about the axle, p: about the vertical);
Cs, Cs1 [N m]; Cv, Cv1 [N m s]; KT [N m/A]; KE [V s/rad]; Ra [ohm]; tr, mu [-]; tau_fr [N m at the motor].
An absent symbol raises KeyError with its name. All functions take one state; use `jax.vmap` for many.
"""

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from ..._float64 import in_float64

Parameters = Mapping[str, Any]


def _rows(*rows: tuple[Any, ...]) -> Array:
    return jnp.stack([jnp.stack([jnp.asarray(x, dtype=float) for x in row]) for row in rows])


def _velocity_map_rate(q: Array, eta: Array, p: Parameters) -> tuple[Array, Array]:
    """qdot = S eta, shape (7,), and (dS/dt) eta along it, shape (7,)."""
    qdot = velocity_map(q, p) @ eta
    _, rate = jax.jvp(lambda at: velocity_map(at, p) @ eta, (q,), (qdot,))
    return qdot, rate


@in_float64
def inertia_matrix(q: ArrayLike, p: Parameters) -> Array:
    """Inertia matrix M(q) of eqs. 13-18, shape (7, 7), in the units of q (kg, kg m, kg m^2).

    Corrected: M(beta)13 has -M ym (printed +M ym) and M(beta)33 contains the driving wheels' 2 Ip (absent in print).
    """
    q = jnp.asarray(q, dtype=float)
    c, s = jnp.cos(q[3]), jnp.sin(q[3])
    arm = p["m1"] * p["d"]
    total = p["M"] + 2 * p["m"] + p["m1"]
    m13 = -p["M"] * p["ym"] + p["m1"] * p["l1"] + arm * c
    m23 = p["M"] * p["xm"] + arm * s
    m33 = (
        p["M"] * (p["xm"] ** 2 + p["ym"] ** 2)
        + 2 * p["m"] * p["L"] ** 2
        + p["m1"] * (p["l1"] ** 2 + p["d"] ** 2)
        + 2 * arm * p["l1"] * c
        + p["I0"]
        + p["Ip1"]
        + 2 * p["Ip"]
    )
    caster = arm * p["d"] + p["Ip1"]  # I_beta, eq. 18
    body = _rows(
        (total, 0, m13, arm * c),
        (0, total, m23, arm * s),
        (m13, m23, m33, caster + arm * p["l1"] * c),
        (arm * c, arm * s, caster + arm * p["l1"] * c, caster),
    )
    ct, st = jnp.cos(q[2]), jnp.sin(q[2])
    to_body = _rows((ct, st, 0, 0), (-st, ct, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1))  # R(theta), eq. 14, and 1 for beta
    matrix = jnp.zeros((7, 7)).at[:4, :4].set(to_body.T @ body @ to_body)
    return matrix.at[jnp.arange(4, 7), jnp.arange(4, 7)].set(jnp.stack([p["Ir1"] * 1.0, p["Ir"] * 1.0, p["Ir"] * 1.0]))


@in_float64
def constraint_matrix(q: ArrayLike, p: Parameters) -> Array:
    """Constraint matrix A(q) of eqs. 4 and 6, shape (5, 7): A qdot is the slip of the contact points [m/s], zero.

    Rows: sideways slip of the driving axle (both wheels share it), rolling of the right wheel, rolling of the left
    wheel, sideways slip of the caster wheel, rolling of the caster wheel. The paper uses A without printing it.
    """
    q = jnp.asarray(q, dtype=float)
    ct, st = jnp.cos(q[2]), jnp.sin(q[2])
    c, s = jnp.cos(q[3]), jnp.sin(q[3])
    cw, sw = jnp.cos(q[2] + q[3]), jnp.sin(q[2] + q[3])
    return _rows(
        (ct, st, 0, 0, 0, 0, 0),
        (-st, ct, p["L"], 0, 0, -p["R"], 0),
        (-st, ct, -p["L"], 0, 0, 0, -p["R"]),
        (cw, sw, p["d"] + p["l1"] * c, p["d"], 0, 0, 0),
        (-sw, cw, -p["l1"] * s, 0, -p["R1"], 0, 0),
    )


@in_float64
def velocity_map(q: ArrayLike, p: Parameters) -> Array:
    """Velocity map S(q) of eqs. 5 and 12, shape (7, 2): qdot = S eta.

    Corrected: both entries of the row of beta are negative (printed positive), which makes A S = 0 and lets the caster
    trail when the robot drives forwards.
    """
    q = jnp.asarray(q, dtype=float)
    c, s = jnp.cos(q[3]), jnp.sin(q[3])
    return _rows(
        (-jnp.sin(q[2]), 0),
        (jnp.cos(q[2]), 0),
        (0, 1),
        (-s / p["d"], -(p["d"] + p["l1"] * c) / p["d"]),
        (c / p["R1"], -p["l1"] * s / p["R1"]),
        (1 / p["R"], p["L"] / p["R"]),
        (1 / p["R"], -p["L"] / p["R"]),
    )


@in_float64
def coriolis(q: ArrayLike, qdot: ArrayLike, p: Parameters) -> Array:
    """Coriolis and centrifugal matrix C(q, qdot), shape (7, 7), built from Christoffel's symbols of M(q).

    C qdot is eq. 19; of the matrices with that product this is the one for which dM/dt - 2 C is skew-symmetric.
    """
    q, qdot = jnp.asarray(q, dtype=float), jnp.asarray(qdot, dtype=float)
    slope = jax.jacfwd(lambda at: inertia_matrix(at, p))(q)  # slope[i, j, k] = dM_ij / dq_k
    return 0.5 * (slope @ qdot + jnp.einsum("ikj,k->ij", slope, qdot) - jnp.einsum("jki,k->ij", slope, qdot))


@in_float64
def kinetic_energy(q: ArrayLike, qdot: ArrayLike, p: Parameters) -> Array:
    """Kinetic energy Ec of eq. 3 [J], a scalar."""
    qdot = jnp.asarray(qdot, dtype=float)
    return 0.5 * qdot @ inertia_matrix(q, p) @ qdot


@in_float64
def reduced_inertia(q: ArrayLike, p: Parameters) -> Array:
    """Reduced inertia J(q) = S^T M S of eq. 9, shape (2, 2) [kg, kg m; kg m, kg m^2]. Depends on beta alone."""
    s = velocity_map(q, p)
    return s.T @ inertia_matrix(q, p) @ s


@in_float64
def reduced_bias(q: ArrayLike, eta: ArrayLike, p: Parameters) -> Array:
    """Velocity terms g(q, eta) = S^T (M (dS/dt) eta + C S eta) of eq. 10, shape (2,) [N, N m]."""
    q, eta = jnp.asarray(q, dtype=float), jnp.asarray(eta, dtype=float)
    qdot, rate = _velocity_map_rate(q, eta, p)
    return velocity_map(q, p).T @ (inertia_matrix(q, p) @ rate + coriolis(q, qdot, p) @ qdot)


@in_float64
def input_matrix(q: ArrayLike, p: Parameters) -> Array:
    """Input matrix G = S^T B of eqs. 10 and 20, shape (2, 2): G tau is the driving force [N] and torque [N m]."""
    return velocity_map(q, p)[5:].T


@in_float64
def friction(q: ArrayLike, eta: ArrayLike, p: Parameters) -> Array:
    """Friction f_r = S^T F_r of eqs. 11 and 21-23, shape (2,) [N, N m].

    Sliding friction at the two driving axles and the caster's pivot; a part at rest gets none (sign 0 = 0), so what
    holds a robot still is the simulator's task. The motor's own tau_fr is in `motor_torque`, as in the paper.
    """
    s = velocity_map(q, p)
    rates = s @ jnp.asarray(eta, dtype=float)
    pivot = p["Cs1"] * jnp.sign(rates[3]) + p["Cv1"] * rates[3]
    wheels = p["Cs"] * jnp.sign(rates[5:]) + p["Cv"] * rates[5:]
    return s[3] * pivot + s[5:].T @ wheels


@in_float64
def motor_torque(V: ArrayLike, wheel_speed: ArrayLike, p: Parameters) -> Array:
    """Torque at the wheel tau [N m] of eq. 28, from armature voltage V [V] and wheel speed [rad/s], element by element.

    Corrected: the motor's friction torque carries the sign of the wheel speed, as a18 and a29 of eqs. 34-35 have it;
    eqs. 25 and 28 print tau_fr without it, which would drive a wheel that turns backwards.
    """
    V, wheel_speed = jnp.asarray(V, dtype=float), jnp.asarray(wheel_speed, dtype=float)
    current = (V - p["KE"] * p["tr"] * wheel_speed) / p["Ra"]
    return p["tr"] * p["mu"] * (p["KT"] * current - p["tau_fr"] * jnp.sign(wheel_speed))


@in_float64
def acceleration(q: ArrayLike, eta: ArrayLike, V: ArrayLike, p: Parameters) -> Array:
    """deta/dt = J^-1 (G tau - g - f_r) of eqs. 8 and 32 with the motors of eq. 28, shape (2,) [m/s^2, rad/s^2].

    `V` is (V2, V3). Holds while what rubs slides; see `friction`.
    """
    eta = jnp.asarray(eta, dtype=float)
    wheel_speed = (velocity_map(q, p) @ eta)[5:]
    drive = input_matrix(q, p) @ motor_torque(V, wheel_speed, p)
    return jnp.linalg.solve(reduced_inertia(q, p), drive - reduced_bias(q, eta, p) - friction(q, eta, p))


# The paper's own letters, for readers who hold it.
M = inertia_matrix
A = constraint_matrix
S = velocity_map
C = coriolis
J = reduced_inertia
g = reduced_bias
G = input_matrix
f_r = friction
