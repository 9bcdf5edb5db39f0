"""The three robots with other laws: the plain equations, whose motors are switched off where a law replaces them, and what
the law adds.

The plain equations also give G = J^-1 B^T, the answer of the speeds to forces at the rubbing axes; whatever a law adds at
those axes goes the same way. The floor's laws are put into the plain equations' own slope and surface at each place, the
effective track into their constants at each yaw rate.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from reference import axis, omni, pioneer
from reference.compiled import compiled
from reference.effects import E
from reference.law_forces import (
    bristles,
    drag_along,
    dry,
    filtered,
    gripped,
    ground,
    motor_drives,
    payload,
    rippled,
    track_factor,
    turning_moment,
    viscous_more,
)
from reference.law_vector import K
from reference.robot import Robot
from reference.stick_slip import DYNAMICS

_plain_pioneer, _plain_omni, _plain_axis = (robot.dynamics.callee for robot in (pioneer, omni, axis))
_P, _O, _A = pioneer.P, omni.P, axis.P
_FROM_PIONEER, _FROM_OMNI, _FROM_AXIS = len(pioneer.STATES), omni.N_STATES, len(axis.STATES)


def _more_states(motors: int, speeds: int) -> int:
    return 4 * motors + 2 + 2 * speeds + 3


@compiled(DYNAMICS)
def pioneer_dynamics(t, x, u, p, e, xdot, G, B, bias, level):
    """As `reference.pioneer.dynamics`."""
    place = _FROM_PIONEER
    for i in range(place, xdot.size):
        xdot[i] = 0.0
    here, q = ground(x[0], x[1], e), p
    track = p[_P.L] * track_factor(x[5], e)
    if e[K.track] != 0.0 or e[K.own_motors] != 0.0 or e[K.payload] != 0.0:
        q = p.copy()
        q[_P.M] += payload(t, e)
        if e[K.track_kind] == 0.0:
            q[_P.L] = track
        if e[K.own_motors] != 0.0:
            q[_P.KT] = 0.0
    _plain_pioneer(t, x, u, q, here, xdot, G, B, bias, level)
    rate, drive, extra = np.empty(3), np.zeros(3), np.zeros(3)
    for k in range(3):
        rate[k] = B[k, 0] * x[4] + B[k, 1] * x[5]
    if e[K.own_motors] != 0.0:
        gain = p[_P.tr] * p[_P.mu] * p[_P.KT]
        turning = (track - q[_P.L]) * x[5] / p[_P.R]  # where the track changes with the yaw rate, by the drive alone
        driven = np.array((rate[0] + turning, rate[1] - turning))
        motor_drives(u, driven, p[_P.KE] * p[_P.tr], p[_P.Ra], gain, p[_P.R], 2, x, xdot, place, e, drive)
        for w in range(2):
            drive[w] = gripped(rippled(drive[w], x[6 + w], e) / p[_P.R], w, e) * p[_P.R]
    coulomb = p[_P.Cs] + p[_P.tr] * p[_P.mu] * p[_P.tau_fr]
    for k in range(3):
        s = rate[k] * (p[_P.R] if k < 2 else p[_P.d])
        extra[k] = drive[k] - viscous_more(p[_P.Cv] if k < 2 else p[_P.Cv1], rate[k], s, k, e)
        dry(coulomb if k < 2 else p[_P.Cs1], s, drive[k], k, 1.0 if k < 2 else 0.0, e, level)
        if k < 2:
            extra[k] -= bristles(coulomb, s, k, x, xdot, place + 14, e, level)
    force = drag_along(x[4], 0, e)
    moment = drag_along(x[5], 1, e) + turning_moment(x[4], x[5], e)
    moment += (drive[0] - drive[1]) / p[_P.R] * (track - q[_P.L])
    # torques of the wheels that do the body's force and moment
    det = B[0, 0] * B[1, 1] - B[1, 0] * B[0, 1]
    extra[0] += (B[1, 1] * force - B[1, 0] * moment) / det
    extra[1] += (B[0, 0] * moment - B[0, 1] * force) / det
    for i in range(2):
        for k in range(3):
            xdot[4 + i] += G[4 + i, k] * extra[k]
    filtered(x, xdot, 4, 2, place + 10, e)


@compiled(DYNAMICS)
def omni_dynamics(t, x, u, p, e, xdot, G, B, bias, level):
    """As `reference.omni.dynamics`; La must be 0 where the motors are the law's."""
    place = _FROM_OMNI
    for i in range(place, xdot.size):
        xdot[i] = 0.0
    here, q = ground(x[0], x[1], e), p
    own = e[K.own_motors] != 0.0
    if own or e[K.payload] != 0.0:
        q = p.copy()
        q[_O.M] += payload(t, e)
        if own:
            q[_O.Kt] = 0.0
    _plain_omni(t, x, u, q, here, xdot, G, B, bias, level)
    V, Vn, W, b = x[3], x[4], x[5], p[_O.b]
    f, drive = np.zeros(4), np.zeros(3)
    if own:
        rate = np.empty(4)
        omni.wheel_speeds(V, Vn, W, b, rate)
        rate /= p[_O.r]
        motor_drives(u, rate, p[_O.Kv] * p[_O.l], p[_O.Ra], p[_O.l] * p[_O.Kt], p[_O.r], 4, x, xdot, place, e, f)
        for w in range(4):
            f[w] = gripped(rippled(f[w], x[6 + w], e) / p[_O.r], w, e)
        drive[0], drive[1], drive[2] = f[3] - f[1], f[0] - f[2], b * (f[0] + f[1] + f[2] + f[3])
    extra = np.empty(3)
    for k in range(3):
        lever = b if k == 2 else 1.0
        s = lever * x[3 + k]
        extra[k] = drive[k] - viscous_more(p[_O.Bv + k], x[3 + k], s, k, e) + drag_along(x[3 + k], k, e)
        dry(p[_O.Cv + k], s, drive[k], k, lever, e, level)
        extra[k] -= bristles(p[_O.Cv + k], s, k, x, xdot, place + 24, e, level)
    extra[2] += turning_moment(np.sqrt(V * V + Vn * Vn), W, e)
    for i in range(3):
        for k in range(3):
            xdot[3 + i] += G[3 + i, k] * extra[k]
    filtered(x, xdot, 3, 3, place + 18, e)


@compiled(DYNAMICS)
def axis_dynamics(t, x, u, p, e, xdot, G, B, bias, level):
    """As `reference.axis.dynamics`; the motor has no back-EMF, and its angle is 2 pi times the position."""
    place = _FROM_AXIS
    for i in range(place, xdot.size):
        xdot[i] = 0.0
    q, v = p, x[1]
    drive = np.zeros(1)
    if e[K.own_motors] != 0.0 or e[K.payload] != 0.0:
        q = p.copy()
        q[_A.J] += payload(t, e)
        if e[K.own_motors] != 0.0:
            q[_A.k] = 0.0
    _plain_axis(t, x, u, q, e, xdot, G, B, bias, level)
    if e[K.own_motors] != 0.0:
        motor_drives(u, x[1:2], 0.0, 1.0, p[_A.k], 1.0, 1, x, xdot, place, e, drive)
        drive[0] = gripped(rippled(drive[0], 2.0 * np.pi * x[0], e), 0, e)
    dry(p[_A.Cs], v, drive[0], 0, 1.0, e, level)
    extra = drive[0] - viscous_more(p[_A.Cv], v, v, 0, e) + drag_along(v, 0, e)
    extra -= bristles(p[_A.Cs], v, 0, x, xdot, place + 8, e, level)
    xdot[1] += extra / q[_A.J]
    filtered(x, xdot, 1, 1, place + 6, e)


Full = Mapping[str, Mapping[str, float]]
_DYNAMICS = {"pioneer": pioneer_dynamics, "omni": omni_dynamics, "axis": axis_dynamics}
_REPLACED = (E.sag, E.lag, E.heating, E.cogging, E.traction, E.radius)


def with_other_constants(robot: Robot, e: np.ndarray, full: Full) -> tuple[Robot, np.ndarray]:
    """The robot and the vector of effects with the constants that laws change: the radius of one wheel of the Pioneer."""
    values = full.get("wheel_radius_mismatch/one_wheel")
    if values is None:
        return robot, e
    e, mismatch = e.copy(), values["mismatch"]
    e[E.radius] = (1.0 if values["wheel"] == 1.0 else -1.0) * mismatch / (1.0 + 0.5 * mismatch)
    return robot.with_parameters(R=robot.parameters["R"] * (1.0 + 0.5 * mismatch)), e


def with_laws(robot: Robot, e: np.ndarray, laws: np.ndarray) -> tuple[Robot, np.ndarray]:
    """The robot with the equations that read the laws' vector too, and both vectors in one.

    Raises ValueError for effects of the motors beside a law that replaces the motors.
    """
    together = np.concatenate((e, laws))
    if together[K.own_motors] != 0.0:
        plain = [0.0] * len(_REPLACED)
        plain[_REPLACED.index(E.traction)] = 1e30
        clash = [place.name for place, value in zip(_REPLACED, plain, strict=True) if e[place] != value]
        if clash or robot.parameters.get("La", 0.0) > 0.0 or robot.parameters.get("current_limit", 1e30) < 1e30:
            raise ValueError(f"A law of the motors replaces the plain ones; leave {clash or 'La, current_limit'} out.")
    more = _more_states(len(robot.inputs), len(robot.speeds))
    return replace(robot, dynamics=_DYNAMICS[robot.name], n_states=robot.n_states + more, currents=None), together


def filter_states(robot: Robot) -> int:
    """Index of the first state of the laws' sensor filters, for the plain robot."""
    return robot.n_states + 4 * len(robot.inputs) + 2
