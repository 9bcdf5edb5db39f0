"""The numbers that the omni paper prints.

A. Scolari Conceição, A. P. Moreira, P. J. Costa, "Dynamic parameters identification of an omni-directional mobile
robot", ICINCO 2006, pages 565-570, Tables 1-6 and section 3. Axes are "V", "Vn" [m/s; N] and "W" [rad/s; N m].
"""

from types import MappingProxyType
from typing import Literal

Axis = Literal["V", "Vn", "W"]
AXES: tuple[Axis, ...] = ("V", "Vn", "W")
VISCOUS = MappingProxyType({"V": "Bv", "Vn": "Bvn", "W": "Bw"})
COULOMB = MappingProxyType({"V": "Cv", "Vn": "Cvn", "W": "Cw"})

MASS = 35.0  # kg, section 3
GRAVITY = 9.8  # m/s^2, below eq. 21
DISC_RADIUS = 0.25  # m, below eq. 21

TABLE_1 = MappingProxyType(
    {
        "V": ((0.6, 0.8, 1.0, 1.2), (30.585, 31.459, 31.874, 32.765)),
        "Vn": ((0.6, 0.8, 1.0, 1.2), (30.285, 30.814, 31.174, 32.106)),
        "W": ((0.6, 0.8, 1.0, 1.2), (5.556, 5.730, 5.842, 6.009)),
    }
)
"""Method 1's measurements: axis -> (speeds, forces or torques)."""

TABLE_2 = MappingProxyType({"V": (3.45, 28.55), "Vn": (2.90, 28.46), "W": (0.73, 5.12)})
"""Method 1's result: axis -> (viscous, Coulomb)."""

TABLE_3 = MappingProxyType({"V": (0.11, 0.86, 4.01, 30.35), "Vn": (0.10, 0.87, 3.77, 30.76)})
"""Method 2's result: axis -> (B/M [1/s], C/M [m/s^2], B, C), the signs of eqs. 16-17 restored."""

TABLE_4 = ((1.2495, 0.9126, 1.3691), (1.2495, 0.8942, 1.3974), (1.2495, 0.8947, 1.3965), (2.4500, 1.7512, 1.3990))
"""Method 3: (torque [N m], angular acceleration [rad/s^2], J [kg m^2]) of each experiment."""

HANGING_MASSES = (0.510, 0.510, 0.510, 1.0)  # kg, section 3.3

TABLE_5 = MappingProxyType({"Bv": 3.73, "Bvn": 3.34, "Bw": 0.73, "Cv": 29.45, "Cvn": 29.61, "Cw": 5.12})
"""Mean frictions of methods 1 and 2 (W: method 1 alone)."""

TABLE_6 = MappingProxyType({"Methods 1+2": 1.358, "Method 3 (mean)": 1.390, "Mean": 1.374})
"""Moments of inertia [kg m^2]."""
