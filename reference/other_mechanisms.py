"""Robots that were no part of anything when the package was written: a belt drive, a unicycle with lagging speeds, a cart on
a slope. Right-hand sides for `reference.stick_slip`, as in `reference.mechanisms`.

The vector `e` holds what a user's model may lack, indexed by `F`: a drag [force / speed^power], a rise of dry friction towards
standstill, a constant force, and a dry friction that changes with the position: level (1 + ripple sin(position / period)).
"""

from enum import IntEnum

import numpy as np
from numba import njit

from reference.mechanisms import Mechanism
from reference.stick_slip import DYNAMICS

F = IntEnum("F", "drag power stribeck stribeck_speed slope ripple period", start=0)
NOTHING = np.array([0.0, 2.0, 0.0, 1.0, 0.0, 0.0, 1.0])


@njit(cache=True)
def _drag(s, e):
    return e[F.drag] * s * abs(s) ** (e[F.power] - 1.0) if s != 0.0 else 0.0


@njit(cache=True)
def _level(coulomb, s, position, e):
    rise = e[F.stribeck] * np.exp(-((s / e[F.stribeck_speed]) ** 2)) if e[F.stribeck] != 0.0 else 0.0
    return coulomb * (1.0 + e[F.ripple] * np.sin(position / e[F.period])) + rise


Belt = IntEnum("Belt", "J1 J2 s d b Tc k", start=0)


@njit(DYNAMICS, cache=True)
def belt(t, x, u, p, e, xdot, G, B, bias, level):
    """A motor that turns a load by a belt; the motor rubs; x = (q1, q2, w1, w2), u = (input, torque)."""
    w1, w2 = x[2], x[3]
    through = p[Belt.s] * (x[0] - x[1]) + p[Belt.d] * (w1 - w2)
    torque = p[Belt.k] * u[0] + u[1] - p[Belt.b] * w1 - through + e[F.slope] - _drag(w1, e)
    xdot[0], xdot[1] = w1, w2
    xdot[2], xdot[3] = torque / p[Belt.J1], through / p[Belt.J2]
    G[2, 0], G[3, 0] = 1 / p[Belt.J1], 0.0
    B[0, 0], B[0, 1], bias[0] = 1.0, 0.0, 0.0
    level[0, 0] = level[1, 0] = _level(p[Belt.Tc], w1, x[0], e)


Unicycle = IntEnum("Unicycle", "Tv Kv Tw Kw", start=0)


@njit(DYNAMICS, cache=True)
def unicycle(t, x, u, p, e, xdot, G, B, bias, level):
    """Commanded speeds that lag, and the pose they lead to; x = (X, Y, heading, v, w), u = (v, w commanded, disturbances)."""
    v, w = x[3], x[4]
    xdot[0], xdot[1], xdot[2] = v * np.cos(x[2]), v * np.sin(x[2]), w
    xdot[3] = (p[Unicycle.Kv] * u[0] - v + u[2] + e[F.slope] - _drag(v, e)) / p[Unicycle.Tv]
    xdot[4] = (p[Unicycle.Kw] * u[1] - w + u[3]) / p[Unicycle.Tw]
    G[3, 0], G[4, 0] = 1 / p[Unicycle.Tv], 0.0
    B[0, 0], B[0, 1], bias[0] = 1.0, 0.0, 0.0
    level[0, 0] = level[1, 0] = e[F.stribeck]


Cart = IntEnum("Cart", "m k b c Fc a g", start=0)


@njit(DYNAMICS, cache=True)
def cart(t, x, u, p, e, xdot, G, B, bias, level):
    """m v' = k u - b v - c v |v|^(1/2) - m g sin a - Fc sgn v; x = (q, v), u = (input, force)."""
    v = x[1]
    force = p[Cart.k] * u[0] + u[1] - p[Cart.b] * v - p[Cart.c] * v * np.sqrt(abs(v)) + e[F.slope] - _drag(v, e)
    xdot[0], xdot[1] = v, force / p[Cart.m] - p[Cart.g] * np.sin(p[Cart.a])
    G[1, 0], B[0, 0], bias[0] = 1 / p[Cart.m], 1.0, 0.0
    level[0, 0] = level[1, 0] = _level(p[Cart.Fc], v, x[0], e)


BELT = Mechanism(belt, Belt, 4, 2, 2, 1, 1, 1)
UNICYCLE = Mechanism(unicycle, Unicycle, 5, 3, 2, 1, 2, 2)
CART = Mechanism(cart, Cart, 2, 1, 1, 1, 1, 1)
