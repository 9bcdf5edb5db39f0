"""Small mechanisms that users bring: pendulum, crane, two masses with a spring, a velocity-commanded drive and a plain
differential drive. Right-hand sides for `reference.stick_slip`, whose dry friction truly sticks.

Every input vector ends with external generalised forces (process noise). The vector `e` holds what a user's model may
lack, indexed by `E`: a drag [force / speed^power], a Stribeck rise [force] of dry friction with its speed at the rubbing
axis, a constant force (a slope), and a dry friction that changes with the position: level (1 + ripple sin(position / period)).
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numba import njit

from reference.compiled import compiled
from reference.stick_slip import DYNAMICS, integrate

E = IntEnum("E", "drag power stribeck stribeck_speed slope ripple period", start=0)
NOTHING = np.array([0.0, 2.0, 0.0, 1.0, 0.0, 0.0, 1.0])


@njit
def drag(s, e):
    return e[E.drag] * s * abs(s) ** (e[E.power] - 1.0) if s != 0.0 else 0.0


@njit
def dry_level(coulomb, s, position, e):
    rise = e[E.stribeck] * np.exp(-((s / e[E.stribeck_speed]) ** 2)) if e[E.stribeck] != 0.0 else 0.0
    return coulomb * (1.0 + e[E.ripple] * np.sin(position / e[E.period])) + rise


Pendulum = IntEnum("Pendulum", "J k b mgl tau", start=0)


@compiled(DYNAMICS)
def pendulum(t, x, u, p, e, xdot, G, B, bias, level):
    """J q'' = k u - b q' - mgl sin q - tau sgn q'; x = (q, q'), u = (input, torque)."""
    q, w = x[0], x[1]
    torque = p[Pendulum.k] * u[0] + u[1] - p[Pendulum.b] * w - p[Pendulum.mgl] * np.sin(q)
    torque += e[E.slope] - drag(w, e)
    xdot[0], xdot[1] = w, torque / p[Pendulum.J]
    G[1, 0], B[0, 0], bias[0] = 1 / p[Pendulum.J], 1.0, 0.0
    level[0, 0] = level[1, 0] = dry_level(p[Pendulum.tau], w, q, e)


Crane = IntEnum("Crane", "M m l g b Fc c", start=0)


@compiled(DYNAMICS)
def crane(t, x, u, p, e, xdot, G, B, bias, level):
    """A cart that carries a hanging load on a rod of length l; x = (q, phi, v, w), u = (force, force)."""
    phi, v, w = x[1], x[2], x[3]
    m, rod = p[Crane.m], p[Crane.l]
    sin, cos = np.sin(phi), np.cos(phi)
    force = u[0] + u[1] - p[Crane.b] * v + m * rod * w * w * sin + e[E.slope] - drag(v, e)
    moment = -m * p[Crane.g] * rod * sin - p[Crane.c] * w
    a, c, d = p[Crane.M] + m, m * rod * cos, m * rod * rod
    det = a * d - c * c
    xdot[0], xdot[1] = v, w
    xdot[2], xdot[3] = (d * force - c * moment) / det, (a * moment - c * force) / det
    G[2, 0], G[3, 0] = d / det, -c / det
    B[0, 0], B[0, 1], bias[0] = 1.0, 0.0, 0.0
    level[0, 0] = level[1, 0] = dry_level(p[Crane.Fc], v, x[0], e)


TwoMasses = IntEnum("TwoMasses", "m1 m2 s d b Fc k", start=0)


@compiled(DYNAMICS)
def two_masses(t, x, u, p, e, xdot, G, B, bias, level):
    """Two masses with a spring and a damper between them; the first is driven and rubs; x = (x1, x2, v1, v2)."""
    v1, v2 = x[2], x[3]
    between = p[TwoMasses.s] * (x[0] - x[1]) + p[TwoMasses.d] * (v1 - v2)
    force = p[TwoMasses.k] * u[0] + u[1] - p[TwoMasses.b] * v1 - between + e[E.slope] - drag(v1, e)
    xdot[0], xdot[1] = v1, v2
    xdot[2], xdot[3] = force / p[TwoMasses.m1], between / p[TwoMasses.m2]
    G[2, 0], G[3, 0] = 1 / p[TwoMasses.m1], 0.0
    B[0, 0], B[0, 1], bias[0] = 1.0, 0.0, 0.0
    level[0, 0] = level[1, 0] = dry_level(p[TwoMasses.Fc], v1, x[0], e)


VelocityDrive = IntEnum("VelocityDrive", "Tv Kv Tw Kw", start=0)


@compiled(DYNAMICS)
def velocity_drive(t, x, u, p, e, xdot, G, B, bias, level):
    """Commanded speeds, each with a gain and a lag: T v' = K u - v; x = (v, w), u = (v, w commanded, disturbances)."""
    v, w = x[0], x[1]
    xdot[0] = (p[VelocityDrive.Kv] * u[0] - v + u[2] + e[E.slope] - drag(v, e)) / p[VelocityDrive.Tv]
    xdot[1] = (p[VelocityDrive.Kw] * u[1] - w + u[3]) / p[VelocityDrive.Tw]
    G[0, 0], G[1, 0] = 1 / p[VelocityDrive.Tv], 0.0
    B[0, 0], B[0, 1], bias[0] = 1.0, 0.0, 0.0
    level[0, 0] = level[1, 0] = e[E.stribeck]


DifferentialDrive = IntEnum("DifferentialDrive", "M J L kf ke B Fc", start=0)


@compiled(DYNAMICS)
def differential_drive(t, x, u, p, e, xdot, G, B, bias, level):
    """Two driven wheels at +-L, no caster: per wheel kf (u - ke s) - B s - Fc sgn s at its rim speed s.

    x = (v, w), u = (right, left voltage, force, moment).
    """
    v, w, L = x[0], x[1], p[DifferentialDrive.L]
    right, left = v + L * w, v - L * w
    f_right = p[DifferentialDrive.kf] * (u[0] - p[DifferentialDrive.ke] * right) - p[DifferentialDrive.B] * right
    f_left = p[DifferentialDrive.kf] * (u[1] - p[DifferentialDrive.ke] * left) - p[DifferentialDrive.B] * left
    xdot[0] = (f_right + f_left + u[2] + e[E.slope] - drag(v, e)) / p[DifferentialDrive.M]
    xdot[1] = (L * (f_right - f_left) + u[3]) / p[DifferentialDrive.J]
    for i in range(2):
        sign, s = (1.0, right) if i == 0 else (-1.0, left)
        G[0, i], G[1, i] = 1 / p[DifferentialDrive.M], sign * L / p[DifferentialDrive.J]
        B[i, 0], B[i, 1], bias[i] = 1.0, sign * L, 0.0
        level[0, i] = level[1, i] = dry_level(p[DifferentialDrive.Fc], s, 0.0, e)


@dataclass(frozen=True)
class Mechanism:
    """Equations and layout: `first` speed of `speeds` in the state, rubbing axes, inputs and external forces."""

    dynamics: Callable
    symbols: type[IntEnum]
    n_states: int
    first: int
    speeds: int
    n_axes: int
    n_inputs: int
    n_forces: int


PENDULUM = Mechanism(pendulum, Pendulum, 2, 1, 1, 1, 1, 1)
CRANE = Mechanism(crane, Crane, 4, 2, 2, 1, 1, 1)
TWO_MASSES = Mechanism(two_masses, TwoMasses, 4, 2, 2, 1, 1, 1)
VELOCITY_DRIVE = Mechanism(velocity_drive, VelocityDrive, 2, 0, 2, 1, 2, 2)
DIFFERENTIAL_DRIVE = Mechanism(differential_drive, DifferentialDrive, 2, 0, 2, 2, 2, 2)


def states_at(
    dynamics: Callable,
    p: np.ndarray,
    e: np.ndarray,
    start: np.ndarray,
    time: np.ndarray,
    inputs: np.ndarray,
    layout: tuple[int, int, int],
    *,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    longest: float = 0.02,
) -> np.ndarray:
    """States (N, n) at the times (N,), uneven ones too; row k of `inputs` (N, m) is held from t_k to t_(k+1).

    `layout` is (first speed, speeds, rubbing axes). Raises RuntimeError if the integration comes to a halt.
    """
    first, speeds, axes = layout
    states, _, events = integrate(
        dynamics,
        np.ascontiguousarray(start, float),
        np.ascontiguousarray(time - time[0], float),
        np.ascontiguousarray(inputs, float),
        np.ascontiguousarray(p, float),
        np.ascontiguousarray(e, float),
        first,
        speeds,
        axes,
        rtol,
        atol,
        longest,
    )
    if events < 0 or not np.isfinite(states).all():
        raise RuntimeError("The integration came to a halt.")
    return states
