"""Drive axis: J v' = k u - Cv v - Cs sgn v + offset, q' = v. Forces in newtons, u in newtons or volts (k converts)."""

from enum import IntEnum

import numpy as np

from reference.compiled import compiled
from reference.effects import E, attached, beyond, friction_level, viscous
from reference.robot import Robot
from reference.stick_slip import DYNAMICS

P = IntEnum("P", "J k Cv Cs offset", start=0)
PARAMETERS = {"J": 1.0, "k": 1.0, "Cv": 2.0, "Cs": 0.5, "offset": 0.0}
STATES = ("q", "v", "u_lagged", "stretch", "sprung_speed", "bend", "v_filtered")


@compiled(DYNAMICS)
def dynamics(t, x, u, p, e, xdot, G, B, bias, level):
    """Right-hand side; u = (input, push force)."""
    v = x[1]
    command = u[0]
    xdot[2] = 0.0
    if e[E.lag] > 0.0:
        command = x[2]
        xdot[2] = (u[0] - x[2]) / e[E.lag]
    drive = min(max(p[P.k] * command, -e[E.traction]), e[E.traction])
    surface = beyond(x[0], 0.0, e)
    force = drive + p[P.offset] + u[1] - viscous(p[P.Cv], v, v, surface, e) - e[E.drag] * v * abs(v)
    force += e[E.cogging] * np.sin(2 * np.pi * e[E.periods] * x[0]) + p[P.J] * e[E.slope_x] + attached(v, x, xdot, 3, e)
    xdot[0], xdot[1] = v, force / p[P.J]
    xdot[6] = (v - x[6]) / e[E.sensor_lag] if e[E.sensor_lag] > 0.0 else 0.0
    G[1, 0], B[0, 0], bias[0] = 1 / p[P.J], 1.0, 0.0
    level[0, 0] = friction_level(p[P.Cs], e[E.stribeck], v, 1.0, surface, e)
    level[1, 0] = friction_level(p[P.Cs], e[E.stribeck], v, -1.0, surface, e)


AXIS = Robot(
    name="axis",
    dynamics=dynamics,
    parameters=PARAMETERS,
    inputs=("u",),
    speeds=("v",),
    n_states=len(STATES),
    first=1,
    filtered=6,
    n_axes=1,
    n_forces=1,
    mass="J",
)
