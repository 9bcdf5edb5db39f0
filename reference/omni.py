"""Omni robot with four wheels (Conceicao, Moreira & Costa 2006), coupled in the turning frame.

Body axes V and Vn, yaw rate W. Wheel speeds v1 = Vn + b W, v2 = -V + b W, v3 = -Vn + b W, v4 = V + b W; a wheel's
traction force f_i does work f_i v_i, which gives Fv = f4 - f2, Fvn = f1 - f3, Gamma = b (f1 + f2 + f3 + f4). Newton's
law for a centre of mass at (cx, cy) in the body: the acceleration of the origin is (V' - W Vn, Vn' + W V), that of
the centre of mass has W' z x c - W^2 c more. Friction acts along V, Vn and about W. Motors: u = Ra i + La di/dt + Kv
l v_i / r, f_i = l Kt i / r (eq. 7-9, torque at the wheel).
"""

from enum import IntEnum

import numpy as np
from numba import njit

from reference.compiled import compiled
from reference.effects import E, attached, beyond, friction_level, supply, viscous
from reference.robot import Robot
from reference.stick_slip import DYNAMICS

P = IntEnum("P", "M J b r l Kt Kv Ra La Bv Bvn Bw Cv Cvn Cw current_limit", start=0)
PARAMETERS = {
    "M": 35.0,
    "J": 1.374,
    "b": 0.195,
    "r": 0.05,
    "l": 12.0,
    "Kt": 0.025,
    "Kv": 0.025,
    "Ra": 0.6,
    "La": 0.0,
    "Bv": 3.73,
    "Bvn": 3.34,
    "Bw": 0.73,
    "Cv": 29.45,
    "Cvn": 29.61,
    "Cw": 5.12,
    "current_limit": 1e30,
}
assert list(PARAMETERS) == [p.name for p in P]
# x, y, theta, V, Vn, W; from 6 wheel angles, 10 lagged voltages, 14 currents, 18 heat, 22 sprung mass and bend,
# 25 filtered speeds
N_STATES = 28


@njit
def wheel_speeds(V, Vn, W, b, out):
    """Rim speeds of the four wheels [m/s]."""
    out[0], out[1], out[2], out[3] = Vn + b * W, -V + b * W, -Vn + b * W, V + b * W


@compiled(DYNAMICS)
def dynamics(t, x, u, p, e, xdot, G, B, bias, level):
    """Right-hand side; u = (u1..u4, push force along V, push moment), axes: V, Vn, W."""
    theta, V, Vn, W = x[2], x[3], x[4], x[5]
    rim = np.empty(4)
    wheel_speeds(V, Vn, W, p[P.b], rim)
    command, emf, resistance, voltage, f = np.empty(4), np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    for w in range(4):
        r = p[P.r] * (1 + (0.5 if w < 2 else -0.5) * e[E.radius])
        xdot[6 + w] = rim[w] / r
        xdot[10 + w] = 0.0
        command[w] = u[w]
        if e[E.lag] > 0.0:
            command[w] = x[10 + w]
            xdot[10 + w] = (u[w] - x[10 + w]) / e[E.lag]
        emf[w] = p[P.Kv] * p[P.l] * rim[w] / r
        resistance[w] = p[P.Ra] * (1 + e[E.heating] * x[18 + w])
    if p[P.La] > 0.0 and e[E.sag] > 0.0:  # the currents are states: the supply equation is explicit
        total = 0.0
        for w in range(4):
            total += command[w] / e[E.nominal] * x[14 + w]
        for w in range(4):
            voltage[w] = command[w] * (1 - e[E.sag] * total / e[E.nominal])
    else:
        supply(command, emf, resistance, 4, e, voltage)
    for w in range(4):
        r = p[P.r] * (1 + (0.5 if w < 2 else -0.5) * e[E.radius])
        current = (voltage[w] - emf[w]) / resistance[w]
        xdot[14 + w] = 0.0
        if p[P.La] > 0.0:
            current = x[14 + w]
            xdot[14 + w] = (voltage[w] - emf[w] - resistance[w] * current) / p[P.La]
        current = min(max(current, -p[P.current_limit]), p[P.current_limit])
        xdot[18 + w] = resistance[w] * current * current
        f[w] = p[P.l] * p[P.Kt] * current / r
        f[w] += e[E.cogging] * np.sin(e[E.periods] * x[6 + w]) / r
        f[w] = min(max(f[w], -e[E.traction]), e[E.traction])

    M, cx, cy = p[P.M], 0.0, e[E.com]
    c, s = np.cos(theta), np.sin(theta)
    slope_v, slope_n = M * (c * e[E.slope_x] + s * e[E.slope_y]), M * (-s * e[E.slope_x] + c * e[E.slope_y])
    surface = beyond(x[0], x[1], e)
    speed = np.sqrt(V * V + Vn * Vn)
    b = p[P.b]
    Q = np.empty(3)
    Q[0] = (
        f[3]
        - f[1]
        - viscous(p[P.Bv], V, V, surface, e)
        + slope_v
        - e[E.drag] * V * speed
        + u[4]
        + attached(V, x, xdot, 22, e)
    )
    Q[1] = f[0] - f[2] - viscous(p[P.Bvn], Vn, Vn, surface, e) + slope_n - e[E.drag] * Vn * speed
    Q[2] = b * (f[0] + f[1] + f[2] + f[3]) - viscous(p[P.Bw], W, b * W, surface, e) + cx * slope_n - cy * slope_v + u[5]
    if e[E.uncoupled] == 0.0:  # the turning frame's own terms
        ax, ay = -W * Vn - W * W * cx, W * V - W * W * cy
        Q[0] -= M * ax
        Q[1] -= M * ay
        Q[2] -= M * (cx * ay - cy * ax)
    # [[M, 0, -M cy], [0, M, M cx], [-M cy, M cx, J]] with J about the origin
    inverse = np.zeros((3, 3))
    about_com = p[P.J] - M * (cx * cx + cy * cy)
    lever = (cy, -cx)
    for i in range(2):
        inverse[i, i] = 1 / M
        inverse[i, 2] = lever[i] / about_com
        inverse[2, i] = lever[i] / about_com
        for j in range(2):
            inverse[i, j] += lever[i] * lever[j] / about_com
    inverse[2, 2] = 1 / about_com
    xdot[0], xdot[1], xdot[2] = V * c - Vn * s, V * s + Vn * c, W
    coulomb, amplitude = (p[P.Cv], p[P.Cvn], p[P.Cw]), (e[E.stribeck], e[E.stribeck], b * e[E.stribeck])
    rubbing = (V, Vn, b * W)
    for i in range(3):
        xdot[3 + i] = 0.0
        bias[i] = 0.0
        for j in range(3):
            xdot[3 + i] += inverse[i, j] * Q[j]
            G[3 + i, j] = inverse[i, j]
            B[i, j] = 1.0 if i == j else 0.0
        level[0, i] = friction_level(coulomb[i], amplitude[i], rubbing[i], 1.0, surface, e)
        level[1, i] = friction_level(coulomb[i], amplitude[i], rubbing[i], -1.0, surface, e)
        xdot[25 + i] = (x[3 + i] - x[25 + i]) / e[E.sensor_lag] if e[E.sensor_lag] > 0.0 else 0.0


def currents(states: np.ndarray, inputs: np.ndarray, p: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Motor currents [A] (N, 4) just after the samples, from states (N, 28) and the voltages (N, >= 4) applied then."""
    if p[P.La] > 0:
        return states[:, 14:18]
    out = np.empty((len(states), 4))
    rim, voltage = np.empty(4), np.empty(4)
    radius = p[P.r] * (1 + np.array([0.5, 0.5, -0.5, -0.5]) * e[E.radius])
    for k, x in enumerate(states):
        wheel_speeds(x[3], x[4], x[5], p[P.b], rim)
        emf, resistance = p[P.Kv] * p[P.l] * rim / radius, p[P.Ra] * (1 + e[E.heating] * x[18:22])
        command = x[10:14] if e[E.lag] > 0 else inputs[k]
        supply(command, emf, resistance, 4, e, voltage)
        out[k] = np.clip((voltage - emf) / resistance, -p[P.current_limit], p[P.current_limit])
    return out


OMNI = Robot(
    name="omni",
    dynamics=dynamics,
    parameters=PARAMETERS,
    inputs=("u1", "u2", "u3", "u4"),
    speeds=("V", "Vn", "W"),
    n_states=N_STATES,
    first=3,
    filtered=25,
    n_axes=3,
    n_forces=2,
    mass="M",
    currents=currents,
)
