r"""The Pioneer's reduced dynamics in scalars: what rollouts evaluate, and the coefficients that experiments identify.

The matrices of `papers/pioneer/equations.py` collapse. The caster wheel sees the robot's motion (eta1, l1 eta2) turned by beta,

    u = cos(beta) eta1 - l1 sin(beta) eta2      speed of the caster wheel along its rolling direction [m/s]
    w = sin(beta) eta1 + l1 cos(beta) eta2      speed of the pivot across it [m/s]

and rolling turns the caster at -w/d in the world, so beta_dot = -w/d - eta2. With the caster's rolling mass
`m1 + Ir1/R1^2` and swivelling mass `Ip1/d^2`, J and g of Innocenti et al., eqs. 9-10, are a few products; no division
by anything but constants, no trigonometry, any broadcastable shapes, NumPy or JAX (in its caller's precision).

`p` and the conventions are those of `papers/pioneer/equations.py`. cos_b, sin_b are of beta.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import Array
from jax.typing import ArrayLike

from .._float64 import in_float64

Parameters = Mapping[str, Any]


class StraightCoefficients(NamedTuple):
    """Coefficients of eq. 34, driving straight with the caster trailing: a11 [1/kg], a15 [1/s], a18 [m/s^2]."""

    a11: Any
    a15: Any
    a18: Any


class TurningCoefficients(NamedTuple):
    """Coefficients of eq. 35, turning on the spot: a22 [1/(kg m^2)], a26 [1/s], a29 [rad/s^2]."""

    a22: Any
    a26: Any
    a29: Any


def _caster_masses(p: Parameters) -> tuple[Any, Any]:
    """Rolling and swivelling mass of the caster [kg]."""
    return p["m1"] + p["Ir1"] / (p["R1"] * p["R1"]), p["Ip1"] / (p["d"] * p["d"])


def _fixed_inertia(p: Parameters) -> tuple[Any, Any]:
    """The part of J11 [kg] and J22 [kg m^2] that does not depend on beta: platform and driving wheels."""
    wheels = 2 * (p["m"] + p["Ir"] / (p["R"] * p["R"]))
    platform = p["M"] * (p["xm"] * p["xm"] + p["ym"] * p["ym"]) + p["I0"] + 2 * p["Ip"]
    return p["M"] + wheels, platform + wheels * p["L"] * p["L"]


def _motor_viscous(p: Parameters) -> Any:
    """What back-EMF adds to Cv of a driving wheel [N m s]."""
    return p["tr"] * p["tr"] * p["mu"] * p["KT"] * p["KE"] / p["Ra"]


def _motor_coulomb(p: Parameters) -> Any:
    """What the motor's own friction adds to Cs of a driving wheel [N m]."""
    return p["tr"] * p["mu"] * p["tau_fr"]


def reduced_inertia(cos_b: Any, sin_b: Any, p: Parameters) -> tuple[Any, Any, Any]:
    """J11 [kg], J12 [kg m] and J22 [kg m^2] of J = S^T M S, eq. 9."""
    rolling, swivelling = _caster_masses(p)
    j11, j22 = _fixed_inertia(p)
    cc, ss = cos_b * cos_b, sin_b * sin_b
    return (
        j11 + rolling * cc + swivelling * ss,
        p["M"] * p["xm"] + (swivelling - rolling) * p["l1"] * (sin_b * cos_b),
        j22 + p["l1"] * p["l1"] * (rolling * ss + swivelling * cc),
    )


def caster_rate(cos_b: Any, sin_b: Any, eta1: Any, eta2: Any, p: Parameters) -> Any:
    """beta_dot = -(sin_b/d) eta1 - ((d + l1 cos_b)/d) eta2 [rad/s], the fourth row of S eta (eq. 12 corrected)."""
    return -(sin_b * eta1 + p["l1"] * cos_b * eta2) / p["d"] - eta2


def bias(cos_b: Any, sin_b: Any, eta1: Any, eta2: Any, p: Parameters) -> tuple[Any, Any]:
    """g1 [N] and g2 [N m] of eq. 10.

    The platform gives the centripetal terms of its centre of mass ahead of the axle (ym); the caster gives the rate
    at which u and w change by beta alone, weighed by the masses that follow them. The centre of mass beside the axis
    (xm) gives nothing: its two terms cancel.
    """
    rolling, swivelling = _caster_masses(p)
    turn = p["l1"] * eta2
    rate = -(sin_b * eta1 + cos_b * turn) / p["d"] - eta2
    across = rolling * rate * (sin_b * eta1 + cos_b * turn)
    along = swivelling * rate * (cos_b * eta1 - sin_b * turn)
    lever = p["M"] * p["ym"] * eta2
    return (
        sin_b * along - cos_b * across - lever * eta2,
        p["l1"] * (sin_b * across + cos_b * along) + lever * eta1,
    )


def traction(V2: Any, V3: Any, p: Parameters) -> tuple[Any, Any]:
    """Force F [N] (eq. 34) and torque Gamma [N m] (eq. 35) that the voltages [V] would give wheels at rest."""
    per_volt = p["tr"] * p["mu"] * p["KT"] / (p["R"] * p["Ra"])
    return per_volt * (V2 + V3), p["L"] * per_volt * (V2 - V3)


@in_float64
def equation_33(beta: ArrayLike, p: Parameters) -> dict[str, Array]:
    """Coefficients a11..a19, a21..a29 of eq. 33 at a caster angle [rad], each of beta's shape.

        deta1/dt = a11 F + a12 Gamma - a13 eta1^2 - a14 eta2^2 - a15 eta1 - a16 eta2 - a17 eta1 eta2 - a18 s1 - a19 s2
                   - a1_caster s3

    and deta2/dt alike with a2*. F and Gamma are those of `traction`. The paper prints no formula for the coefficients
    and writes the dry friction with s1 = sign(eta1), s2 = sign(eta2). That holds on its two experiments; in general
    the wheels' and the caster's rubbing speeds decide:

        s1 = (sign(phi2_dot) + sign(phi3_dot)) / 2    s2 = (sign(phi2_dot) - sign(phi3_dot)) / 2    s3 = -sign(beta_dot)

    so the caster's share has its own pair, `a1_caster` and `a2_caster`. On the spot at beta = -90 degrees s3 = s2, and
    the paper's a29 is `a29 + a2_caster`.
    """
    beta = jnp.asarray(beta, dtype=float)
    c, s = jnp.cos(beta), jnp.sin(beta)
    j11, j12, j22 = reduced_inertia(c, s, p)
    det = j11 * j22 - j12 * j12
    i11, i12, i22 = j22 / det, -j12 / det, j11 / det

    rolling, swivelling = _caster_masses(p)
    d, l1 = p["d"], p["l1"]
    arm = d + l1 * c  # beta_dot = -(s eta1 + arm eta2) / d
    # -d beta_dot w and -d beta_dot u as quadratic forms in (eta1, eta2): coefficients of eta1^2, eta2^2, eta1 eta2.
    across = (s * s, l1 * c * arm, s * (d + 2 * l1 * c))
    along = (s * c, -l1 * s * arm, c * arm - l1 * s * s)
    lever = p["M"] * p["ym"]
    g1 = [(rolling * c * w - swivelling * s * u) / d for w, u in zip(across, along, strict=True)]
    g2 = [-l1 * (rolling * s * w + swivelling * c * u) / d for w, u in zip(across, along, strict=True)]
    g1[1], g2[2] = g1[1] - lever, g2[2] + lever

    viscous = 2 * (_motor_viscous(p) + p["Cv"]) / (p["R"] * p["R"])
    pivot = p["Cv1"] / (d * d)
    force_viscous = (viscous + pivot * s * s, pivot * s * arm)  # of eta1, of eta2
    torque_viscous = (pivot * s * arm, viscous * p["L"] * p["L"] + pivot * arm * arm)
    coulomb = 2 * (_motor_coulomb(p) + p["Cs"]) / p["R"]

    forces = (1.0, 0.0, g1[0], g1[1], force_viscous[0], force_viscous[1], g1[2], coulomb, 0.0, p["Cs1"] * s / d)
    torques = (0.0, 1.0, g2[0], g2[1], torque_viscous[0], torque_viscous[1], g2[2], 0.0, coulomb * p["L"])
    torques += (p["Cs1"] * arm / d,)
    coefficients = {}
    for row, left, right in (("1", i11, i12), ("2", i12, i22)):
        for column, force, torque in zip((*"123456789", "_caster"), forces, torques, strict=True):
            coefficients["a" + row + column] = left * force + right * torque
    return coefficients


@in_float64
def equation_33_acceleration(
    beta: ArrayLike, eta1: ArrayLike, eta2: ArrayLike, V2: ArrayLike, V3: ArrayLike, p: Parameters
) -> tuple[Array, Array]:
    """deta1/dt [m/s^2] and deta2/dt [rad/s^2] from `equation_33`, broadcasting over its arguments."""
    beta, e1, e2 = (jnp.asarray(x, dtype=float) for x in (beta, eta1, eta2))
    a = equation_33(beta, p)
    force, torque = traction(jnp.asarray(V2, dtype=float), jnp.asarray(V3, dtype=float), p)
    right, left = jnp.sign(e1 + p["L"] * e2), jnp.sign(e1 - p["L"] * e2)
    caster = -jnp.sign(caster_rate(jnp.cos(beta), jnp.sin(beta), e1, e2, p))
    losses = (e1 * e1, e2 * e2, e1, e2, e1 * e2, (right + left) / 2, (right - left) / 2, caster)
    columns = (*"3456789", "_caster")

    def row(i: str) -> Array:
        loss = sum(a["a" + i + column] * term for column, term in zip(columns, losses, strict=True))
        return a["a" + i + "1"] * force + a["a" + i + "2"] * torque - loss

    return row("1"), row("2")


def straight_coefficients(p: Parameters) -> StraightCoefficients:
    """a11, a15, a18 of eq. 34: eta2 = 0, beta = 0."""
    rolling, _ = _caster_masses(p)
    a11 = 1 / (_fixed_inertia(p)[0] + rolling)
    return StraightCoefficients(
        a11=a11,
        a15=2 * (_motor_viscous(p) + p["Cv"]) / (p["R"] * p["R"]) * a11,
        a18=2 * (p["Cs"] + _motor_coulomb(p)) / p["R"] * a11,
    )


def turning_coefficients(p: Parameters) -> TurningCoefficients:
    """a22, a26, a29 of eq. 35: eta1 = 0, beta = -90 degrees, xm = 0.

    Corrected: a22 has `l1^2 Ir1 / R1^2` (printed `Ir^2 Ir1 / R1^2`). Kept as the paper has it: the caster at exactly
    -90 degrees, where its pivot still rubs at -eta2. Turning about the axle's middle it settles where
    d + l1 cos(beta) = 0 and stands still in the body, so Cv1 and Cs1 act in the turn's first moments only. Kept too:
    eta1 = 0, which needs something to hold the robot against M ym eta2^2 (a24 is zero here, a14 is not).
    """
    rolling, _ = _caster_masses(p)
    a22 = 1 / (_fixed_inertia(p)[1] + rolling * p["l1"] * p["l1"])
    ratio = p["L"] / p["R"]
    return TurningCoefficients(
        a22=a22,
        a26=(2 * ratio * ratio * (_motor_viscous(p) + p["Cv"]) + p["Cv1"]) * a22,
        a29=(2 * ratio * (_motor_coulomb(p) + p["Cs"]) + p["Cs1"]) * a22,
    )


def wheel_friction(straight: StraightCoefficients, p: Parameters) -> tuple[Any, Any]:
    """Cv [N m s] and Cs [N m] from eq. 34's coefficients: the inverse of `straight_coefficients`.

    Of `p` only the wheel's R and the motor's constants are used, so a measured a11 needs no known masses.
    """
    cv = straight.a15 / straight.a11 * p["R"] * p["R"] / 2 - _motor_viscous(p)
    cs = straight.a18 / straight.a11 * p["R"] / 2 - _motor_coulomb(p)
    return cv, cs


def caster_friction(turning: TurningCoefficients, p: Parameters) -> tuple[Any, Any]:
    """Cv1 [N m s] and Cs1 [N m] from eq. 35's coefficients: the inverse of `turning_coefficients`.

    Of `p` only L, R, the motor's constants and the wheels' Cv and Cs (from `wheel_friction`) are used. The caster's
    share is a small difference of large numbers: 0.02 % of a26 and 0.3 % of a29 with the published values.
    """
    ratio = p["L"] / p["R"]
    cv1 = turning.a26 / turning.a22 - 2 * ratio * ratio * (_motor_viscous(p) + p["Cv"])
    cs1 = turning.a29 / turning.a22 - 2 * ratio * (_motor_coulomb(p) + p["Cs"])
    return cv1, cs1
