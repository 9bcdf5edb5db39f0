r"""Pioneer (differential drive with a caster), from body positions and rolling constraints.

Robot frame: x right, y forward, origin Q midway between the driving wheels. All velocities are linear in eta =
(forward speed of Q, yaw rate). Every body k has velocity P_k(beta) eta (components in the robot frame), so its
acceleration in the turning frame is P_k eta' + P_k' eta + eta2 z x (P_k eta), and Kane's equations sum m_k P_k^T a_k
plus the rotary inertias against the torques at the wheels. That gives J(beta) eta' + g(beta, eta) without any
Lagrangian of the seven coordinates.

- right and left wheel at (+-L, 0): spin (eta1 +- L eta2) / R;
- caster: pivot (0, -l1), wheel centre at d (sin b, -cos b) from it. No slip along its axle (cos b, sin b) fixes the
  absolute turning rate w = -(sin b eta1 + l1 cos b eta2) / d, hence beta' = w - eta2, and the centre moves along
  (-sin b, cos b) with speed r = cos b eta1 - l1 sin b eta2, spin r / R1.

Motor: Innocenti et al., eq. 28. Defaults: their tables 1, 2 and 5, L = 0.1689 m.
"""

from enum import IntEnum

import numpy as np
from numba import njit

from reference.compiled import compiled
from reference.effects import E, attached, beyond, friction_level, supply, viscous
from reference.robot import Robot
from reference.stick_slip import DYNAMICS

P = IntEnum("P", "R R1 L l1 d xm ym M m m1 I0 Ir Ir1 Ip Ip1 Cs Cv Cs1 Cv1 KT KE Ra tr mu tau_fr", start=0)
PARAMETERS = {
    "R": 0.0825,
    "R1": 0.035,
    "L": 0.1689,
    "l1": 0.18,
    "d": 0.03,
    "xm": 0.0,
    "ym": -0.07,
    "M": 15.5,
    "m": 0.35,
    "m1": 0.35,
    "I0": 0.3,
    "Ir": 0.0012,
    "Ir1": 2.144e-4,
    "Ip": 5.95e-4,
    "Ip1": 1.072e-4,
    "Cs": 0.3184,
    "Cv": 0.0444,
    "Cs1": 0.004536,
    "Cv1": 0.000429,
    "KT": 0.023,
    "KE": 0.023,
    "Ra": 0.71,
    "tr": 19.7,
    "mu": 0.73,
    "tau_fr": 5.6e-3,
}
assert list(PARAMETERS) == [p.name for p in P]
STATES = (
    "x",
    "y",
    "theta",
    "beta",
    "eta1",
    "eta2",
    "phi2",
    "phi3",
    "V2_lagged",
    "V3_lagged",
    "heat2",
    "heat3",
    "stretch",
    "sprung_speed",
    "bend",
    "eta1_filtered",
    "eta2_filtered",
)


@njit
def mass_and_bias(beta, eta1, eta2, p, xm, J, g):
    """J (2 x 2) and g (2) of J eta' + g = Q, both from m P^T a summed over the bodies."""
    sin, cos = np.sin(beta), np.cos(beta)
    d, l1, L = p[P.d], p[P.l1], p[P.L]
    beta_dot = -(sin * eta1 + l1 * cos * eta2) / d - eta2
    for i in range(2):
        g[i] = J[i, 0] = J[i, 1] = 0.0
    Q = np.empty((2, 2))
    for body in range(4):  # chassis, right wheel, left wheel, caster wheel: translation
        Q_dot = np.zeros((2, 2))
        if body < 3:
            mass = p[P.M] if body == 0 else p[P.m]
            px = xm if body == 0 else (L if body == 1 else -L)
            py = p[P.ym] if body == 0 else 0.0
            Q[0, 0], Q[0, 1], Q[1, 0], Q[1, 1] = 0.0, -py, 1.0, px
        else:
            mass = p[P.m1]
            row = (cos, -l1 * sin)  # speed r along the direction (-sin, cos)
            row_dot = (-sin * beta_dot, -l1 * cos * beta_dot)
            for k in range(2):
                Q[0, k], Q[1, k] = -sin * row[k], cos * row[k]
                Q_dot[0, k] = -cos * beta_dot * row[k] - sin * row_dot[k]
                Q_dot[1, k] = -sin * beta_dot * row[k] + cos * row_dot[k]
        vx, vy = Q[0, 0] * eta1 + Q[0, 1] * eta2, Q[1, 0] * eta1 + Q[1, 1] * eta2
        ax = Q_dot[0, 0] * eta1 + Q_dot[0, 1] * eta2 - eta2 * vy
        ay = Q_dot[1, 0] * eta1 + Q_dot[1, 1] * eta2 + eta2 * vx
        for i in range(2):
            g[i] += mass * (Q[0, i] * ax + Q[1, i] * ay)
            for j in range(2):
                J[i, j] += mass * (Q[0, i] * Q[0, j] + Q[1, i] * Q[1, j])
    # rotation: rate = c1 eta1 + c2 eta2, inertia I
    J[1, 1] += p[P.I0] + 2 * p[P.Ip]
    for side in (1.0, -1.0):
        spin = (1 / p[P.R], side * L / p[P.R])
        for i in range(2):
            for j in range(2):
                J[i, j] += p[P.Ir] * spin[i] * spin[j]
    for which in range(2):
        if which == 0:
            inertia, c, c_dot = p[P.Ir1], (cos / p[P.R1], -l1 * sin / p[P.R1]), (-sin / p[P.R1], -l1 * cos / p[P.R1])
        else:
            inertia, c, c_dot = p[P.Ip1], (-sin / d, -l1 * cos / d), (-cos / d, l1 * sin / d)
        extra = beta_dot * (c_dot[0] * eta1 + c_dot[1] * eta2)
        for i in range(2):
            g[i] += inertia * c[i] * extra
            for j in range(2):
                J[i, j] += inertia * c[i] * c[j]


@compiled(DYNAMICS)
def dynamics(t, x, u, p, e, xdot, G, B, bias, level):
    """Right-hand side; u = (V2, V3, push force, push moment), axes: right wheel, left wheel, caster pivot."""
    theta, beta, eta1, eta2 = x[2], x[3], x[4], x[5]
    sin, cos = np.sin(beta), np.cos(beta)
    d, l1, L = p[P.d], p[P.l1], p[P.L]
    R = (p[P.R] * (1 + 0.5 * e[E.radius]), p[P.R] * (1 - 0.5 * e[E.radius]))
    xm = p[P.xm] + e[E.com]
    J, g = np.empty((2, 2)), np.empty(2)
    q = p
    if e[E.radius] != 0.0:  # the spin of unequal wheels: difference to the nominal one
        q = p.copy()
        q[P.Ir] = 0.0
    mass_and_bias(beta, eta1, eta2, q, xm, J, g)
    B[0, 0], B[0, 1] = 1 / R[0], L / R[0]
    B[1, 0], B[1, 1] = 1 / R[1], -L / R[1]
    B[2, 0], B[2, 1] = -sin / d, -(d + l1 * cos) / d
    if e[E.radius] != 0.0:
        for w in range(2):
            for i in range(2):
                for j in range(2):
                    J[i, j] += p[P.Ir] * B[w, i] * B[w, j]
    beta_dot = B[2, 0] * eta1 + B[2, 1] * eta2
    bias[0], bias[1] = 0.0, 0.0
    bias[2] = beta_dot * (-cos * eta1 + l1 * sin * eta2) / d
    phi_dot = (B[0, 0] * eta1 + B[0, 1] * eta2, B[1, 0] * eta1 + B[1, 1] * eta2)

    # motors
    command, emf, resistance, voltage = np.empty(2), np.empty(2), np.empty(2), np.empty(2)
    for w in range(2):
        xdot[8 + w] = 0.0
        command[w] = u[w]
        if e[E.lag] > 0.0:
            command[w] = x[8 + w]
            xdot[8 + w] = (u[w] - x[8 + w]) / e[E.lag]
        emf[w] = p[P.KE] * p[P.tr] * phi_dot[w]
        resistance[w] = p[P.Ra] * (1 + e[E.heating] * x[10 + w])
    supply(command, emf, resistance, 2, e, voltage)
    surface = beyond(x[0], x[1], e)
    torque = np.empty(3)
    for w in range(2):
        current = (voltage[w] - emf[w]) / resistance[w]
        xdot[10 + w] = resistance[w] * current * current
        rim = R[w] * phi_dot[w]
        drive = p[P.tr] * p[P.mu] * p[P.KT] * current
        drive = min(max(drive, -e[E.traction] * R[w]), e[E.traction] * R[w])
        torque[w] = drive - viscous(p[P.Cv], phi_dot[w], rim, surface, e)
        torque[w] += e[E.cogging] * np.sin(e[E.periods] * x[6 + w])
        coulomb = p[P.Cs] + p[P.tr] * p[P.mu] * p[P.tau_fr]
        level[0, w] = friction_level(coulomb, e[E.stribeck], rim, 1.0, surface, e)
        level[1, w] = friction_level(coulomb, e[E.stribeck], rim, -1.0, surface, e)
    torque[2] = -p[P.Cv1] * beta_dot
    level[0, 2] = p[P.Cs1]
    level[1, 2] = p[P.Cs1]

    # body forces: gravity on a slope at each body's place, drag, push, attached masses
    right = np.cos(theta) * e[E.slope_x] + np.sin(theta) * e[E.slope_y]
    ahead = -np.sin(theta) * e[E.slope_x] + np.cos(theta) * e[E.slope_y]
    along = -sin * right + cos * ahead  # of the caster wheel's rolling direction
    force = (p[P.M] + 2 * p[P.m]) * ahead + p[P.m1] * along * cos
    moment = p[P.M] * (xm * ahead - p[P.ym] * right) - p[P.m1] * along * l1 * sin
    force += u[2] - e[E.drag] * eta1 * abs(eta1) + attached(eta1, x, xdot, 12, e)
    moment += u[3]
    for k in range(3):
        force += B[k, 0] * torque[k]
        moment += B[k, 1] * torque[k]
    det = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
    force -= g[0]
    moment -= g[1]
    xdot[0], xdot[1], xdot[2], xdot[3] = -np.sin(theta) * eta1, np.cos(theta) * eta1, eta2, beta_dot
    xdot[4] = (J[1, 1] * force - J[0, 1] * moment) / det
    xdot[5] = (J[0, 0] * moment - J[1, 0] * force) / det
    xdot[6], xdot[7] = phi_dot
    for k in range(3):
        G[4, k] = (J[1, 1] * B[k, 0] - J[0, 1] * B[k, 1]) / det
        G[5, k] = (J[0, 0] * B[k, 1] - J[1, 0] * B[k, 0]) / det
    for k in range(2):
        xdot[15 + k] = (x[4 + k] - x[15 + k]) / e[E.sensor_lag] if e[E.sensor_lag] > 0.0 else 0.0


PIONEER = Robot(
    name="pioneer",
    dynamics=dynamics,
    parameters=PARAMETERS,
    inputs=("V2", "V3"),
    speeds=("eta1", "eta2"),
    n_states=len(STATES),
    first=4,
    filtered=15,
    n_axes=3,
    n_forces=2,
    mass="M",
)
