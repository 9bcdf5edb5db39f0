"""Robots that were no part of anything when the package was written: a belt drive, a unicycle with lagging speeds, a cart on
a slope. Right-hand sides for `reference.stick_slip`, as in `reference.mechanisms`.
"""

from dataclasses import replace
from enum import IntEnum

import numpy as np

from reference.compiled import compiled
from reference.mechanisms import TWO_MASSES, E, Mechanism, drag, dry_level
from reference.stick_slip import DYNAMICS

Unicycle = IntEnum("Unicycle", "Tv Kv Tw Kw", start=0)


@compiled(DYNAMICS)
def unicycle(t, x, u, p, e, xdot, G, B, bias, level):
    """Commanded speeds that lag, and the pose they lead to; x = (X, Y, heading, v, w), u = (v, w commanded, disturbances)."""
    v, w = x[3], x[4]
    xdot[0], xdot[1], xdot[2] = v * np.cos(x[2]), v * np.sin(x[2]), w
    xdot[3] = (p[Unicycle.Kv] * u[0] - v + u[2] + e[E.slope] - drag(v, e)) / p[Unicycle.Tv]
    xdot[4] = (p[Unicycle.Kw] * u[1] - w + u[3]) / p[Unicycle.Tw]
    G[3, 0], G[4, 0] = 1 / p[Unicycle.Tv], 0.0
    B[0, 0], B[0, 1], bias[0] = 1.0, 0.0, 0.0
    level[0, 0] = level[1, 0] = e[E.stribeck]


Cart = IntEnum("Cart", "m k b c Fc a g", start=0)


@compiled(DYNAMICS)
def cart(t, x, u, p, e, xdot, G, B, bias, level):
    """m v' = k u - b v - c v |v|^(1/2) - m g sin a - Fc sgn v; x = (q, v), u = (input, force)."""
    v = x[1]
    force = p[Cart.k] * u[0] + u[1] - p[Cart.b] * v - p[Cart.c] * v * np.sqrt(abs(v)) + e[E.slope] - drag(v, e)
    xdot[0], xdot[1] = v, force / p[Cart.m] - p[Cart.g] * np.sin(p[Cart.a])
    G[1, 0], B[0, 0], bias[0] = 1 / p[Cart.m], 1.0, 0.0
    level[0, 0] = level[1, 0] = dry_level(p[Cart.Fc], v, x[0], e)


# A motor that turns a load by a belt, and rubs: two masses with a spring between them.
BELT = replace(TWO_MASSES, symbols=IntEnum("Belt", "J1 J2 s d b Tc k", start=0))
UNICYCLE = Mechanism(unicycle, Unicycle, 5, 3, 2, 1, 2, 2)
CART = Mechanism(cart, Cart, 2, 1, 1, 1, 1, 1)
