"""The four-wheel omni (Conceição et al.): forces, motors and kinematics, equations 1-12 with the lost signs restored.

State V, Vn [m/s] along and across the body, W yaw rate [rad/s]; pose x, y [m], theta [rad] where wanted (heading 0 is
world +x); motor currents i1..i4 [A] with `inductance=True`. Inputs u1..u4 [V].

    M (dV/dt  - c W Vn) = f4 - f2 - Bv  V  - Cv  sgn V
    M (dVn/dt + c W V ) = f1 - f3 - Bvn Vn - Cvn sgn Vn
    J dW/dt = b (f1 + f2 + f3 + f4) - Bw W - Cw sgn W

with c = `coriolis`: 1 for the turning frame's own terms (default), 0 for equations 1-3 as printed. Of M, `Mr` is no mass but
the inertia of what turns with the wheels, behind gears mostly the motors' rotors: only m = M - Mr has weight, an offset and,
in c W V and c W Vn, a momentum that turns with the robot (kinetic energy
m |v_c|^2 / 2 + J W^2 / 2 + Mr (V^2 + Vn^2) / 2).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import jax.numpy as jnp

from ..logs import OMNI, OMNI_ANGLES, Channels
from ..parameters import ParameterTable, parameter
from .class_channels import on_class_too
from .effect import Levels, Numbers, Scalar, Scalars, State
from .robot import Robot
from .scales import Scales
from .trigonometry import sincos


def wheel_speeds(state: State, p: Numbers) -> Scalars:
    """Rim speeds v1..v4 [m/s] of the wheels (eq. 12, signs restored)."""
    V, Vn, spin = state["V"], state["Vn"], p["b"] * state["W"]
    return Vn + spin, -V + spin, -Vn + spin, V + spin


def _radii(p: Numbers) -> Scalars:
    """Radii [m] of the four wheels."""
    large, small = p["r"] * (1.0 + p["radius_mismatch"]), p["r"] * (1.0 - p["radius_mismatch"])
    return large, large, small, small


def body_forces(f: Scalars, p: Numbers) -> Scalars:
    """Fv, Fvn [N] and Gamma [N m] of the wheels' traction forces f1..f4 [N] (eqs. 4-6, signs restored)."""
    return f[3] - f[1], f[0] - f[2], p["b"] * (f[0] + f[1] + f[2] + f[3])


@dataclass(frozen=True, repr=False)
class Omni(Robot):
    """Four-wheel omni-directional robot. `pose=True` integrates x, y, theta; `inductance=True` the motor currents;
    `wheel_angles=True` the angles phi1 ... phi4 [rad] of the wheels, which logs may then hold beside or in the place of the
    speeds."""

    pose: bool = False  # type: ignore[misc]
    inductance: bool = False
    wheel_angles: bool = False  # type: ignore[misc]

    name: ClassVar[str] = "omni"
    velocities: ClassVar[tuple[str, ...]] = ("V", "Vn", "W")
    drive_axes: ClassVar[tuple[int, ...]] = (0, 1, 2)
    angles: ClassVar[tuple[str, ...]] = ("phi1", "phi2", "phi3", "phi4")
    axis_words: ClassVar[tuple[str, ...]] = ("V", "Vn", "W")
    turning: ClassVar[str] = "W"
    in_plane: ClassVar[bool] = True
    winding: ClassVar[str] = "Ra"
    supply_voltage: ClassVar[str] = "supply"
    nominal: ClassVar[Scales] = Scales(
        input=12.0, speed=1.0, torque=6.0, friction=240.0, force=118.0, time=0.14, acceleration=6.0
    )
    mechanisms: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {
            "lateral_com_offset": ("yc", "xc"),
            "wheel_radius_mismatch": ("radius_mismatch",),
            "coriolis_coupling": ("coriolis",),
            "effective_track": ("b",),
            "payload_change": ("M", "J", "xc", "yc"),
        }
    )
    parts: ClassVar[Mapping[str, str]] = MappingProxyType({"Mr": "M"})
    wheel_radius: ClassVar[str] = "r"
    wheel_sides: ClassVar[tuple[str, str]] = ("wheels 1 and 2", "wheels 3 and 4")
    words: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"V": "forward speed", "Vn": "sideways speed", "W": "yaw rate"}
        | {f"phi{k}": f"angle of wheel {k}" for k in range(1, 5)}
    )
    driving_modes: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType(
        {
            "forwards": (0.0, -1.0, 0.0, 1.0),
            "sideways": (1.0, 0.0, -1.0, 0.0),
            "on the spot": (0.5, 0.5, 0.5, 0.5),
            "along and turning": (0.3, -0.7, 0.3, 1.0),
        }
    )

    def defaults(self) -> ParameterTable:
        paper, assumed = "Tables 5 and 6", "assumed (not printed in the paper)"
        return ParameterTable(
            {
                "M": parameter(35.0, "kg", "mass", "section 3 (weighed)"),
                "J": parameter(1.374, "kg m^2", "vertical inertia", paper, free=True),
                "Bv": parameter(3.73, "N s/m", "viscous friction along V", paper, free=True),
                "Bvn": parameter(3.34, "N s/m", "viscous friction along Vn", paper, free=True),
                "Bw": parameter(0.73, "N m s", "viscous friction of turning", paper, free=True),
                "Cv": parameter(29.45, "N", "Coulomb friction along V", paper, free=True),
                "Cvn": parameter(29.61, "N", "Coulomb friction along Vn", paper, free=True),
                "Cw": parameter(5.12, "N m", "Coulomb friction of turning", paper, free=True),
                "b": parameter(0.195, "m", "centre to wheels", assumed),
                "r": parameter(0.05, "m", "wheel radius", assumed),
                "l": parameter(12.0, "", "gear reduction", assumed),
                "Kt": parameter(0.025, "N m/A", "torque constant", assumed),
                "Kv": parameter(0.025, "V s/rad", "back-EMF constant", assumed),
                "Ra": parameter(0.6, "ohm", "armature resistance", assumed),
                "La": parameter(1.0e-4, "H", "armature inductance", assumed),
                "supply": parameter(24.0, "V", "supply voltage: the largest motor voltage", assumed),
                "Mr": parameter(
                    0.0, "kg", "part of M that is what turns with the wheels: no weight, no offset", "nominal"
                ),
                "coriolis": parameter(1.0, "", "1: turning frame's own terms, 0: equations 1-3 as printed", "derived"),
                "radius_mismatch": parameter(
                    0.0,
                    "",
                    "wheels 1, 2 larger and 3, 4 smaller than r by this fraction",
                    "nominal",
                    positive=False,
                    typical=0.02,
                ),
                "xc": parameter(
                    0.0, "m", "centre of mass ahead of the centre", "nominal", positive=False, typical=0.02
                ),
                "yc": parameter(
                    0.0, "m", "centre of mass to the left of the centre", "nominal", positive=False, typical=0.02
                ),
            }
        )

    def uncoupled(self) -> "Omni":
        """The robot with the paper's equations 1-3 as printed."""
        return self.with_values(coriolis=0.0)

    @on_class_too(OMNI)
    def channels(self) -> Channels:  # type: ignore[override]
        """The columns of its logs, with the wheels' angles where these are measured."""
        return OMNI_ANGLES if self.wheel_angles else OMNI

    @property
    def own_states(self) -> tuple[str, ...]:
        return ("V", "Vn", "W", *(("i1", "i2", "i3", "i4") if self.inductance else ()))

    @property
    def estimated_states(self) -> tuple[str, ...]:
        return "V", "Vn", "W", *self.measured_angles

    def driver(self, volts: Scalars, state: State, p: Numbers) -> Scalars:
        return tuple(jnp.clip(u, -p["supply"], p["supply"]) for u in volts)

    def motor(self, volts: Scalars, state: State, p: Numbers) -> Scalars:
        """Currents [A] of the motors at `volts`, the inductance neglected (eq. 9)."""
        emf = p["Kv"] * p["l"]
        rims = zip(volts, wheel_speeds(state, p), _radii(p), strict=True)
        return tuple((u - emf * v / r) / p["Ra"] for u, v, r in rims)

    def gear(self, currents: Scalars, volts: Scalars, state: State, p: Numbers) -> Scalars:
        return tuple(p["l"] * p["Kt"] * i for i in currents)

    def rubbing(self, state: State, p: Numbers) -> Scalars:
        return state["V"], state["Vn"], state["W"]

    def own_coulomb(self, state: State, p: Numbers) -> Levels:
        return tuple((p[name], p[name]) for name in ("Cv", "Cvn", "Cw"))

    def own_viscous(self, speeds: Scalars, state: State, p: Numbers) -> Scalars:
        return p["Bv"] * speeds[0], p["Bvn"] * speeds[1], p["Bw"] * speeds[2]

    def motion(
        self, state: State, volts: Scalars, torques: Scalars, resisting: Scalars, forces: Scalars, p: Numbers
    ) -> State:
        V, Vn, W = state["V"], state["Vn"], state["W"]
        driving = body_forces(self.drive_forces(torques, p), p)
        Q = [driving[i] + forces[i] - resisting[i] for i in range(3)]
        # The momentum of what is carried turns with the robot; that of rotors does not. A centre of mass at (xc, yc) adds its
        # centrifugal terms and couples the accelerations.
        c, carried, xc, yc = p["coriolis"], p["M"] - p["Mr"], p["xc"], p["yc"]
        a, b, turn = self._solve(
            Q[0] + carried * W * (c * Vn + xc * W),
            Q[1] - carried * W * (c * V - yc * W),
            Q[2] - c * carried * W * (xc * V + yc * Vn),
            p,
        )
        currents = dict.fromkeys(("i1", "i2", "i3", "i4"), 0.0) if self.inductance else {}  # advanced by `settle`
        return {"V": a, "Vn": b, "W": turn} | currents

    def planar(self, state: State, p: Numbers) -> tuple[Scalar, Scalar, Scalar]:
        return state["V"], state["Vn"], state["W"]

    def angle_rates(self, state: State, p: Numbers) -> Scalars:
        return tuple(v / r for v, r in zip(wheel_speeds(state, p), _radii(p), strict=True))

    def drive_forces(self, torques: Scalars, p: Numbers) -> Scalars:
        return tuple(torque * (1.0 / r) for torque, r in zip(torques, _radii(p), strict=True))

    def axis_drives(self, torques: Scalars, p: Numbers) -> Scalars:
        return body_forces(self.drive_forces(torques, p), p)

    def _solve(self, Q1, Q2, Q3, p: Numbers):
        """Accelerations: [[M, 0, -m yc], [0, M, m xc], [-m yc, m xc, J + m (xc² + yc²)]] solved for (Q1, Q2, Q3)."""
        # Schur complement: the inertia about the centre of mass is J by definition, where all of M is carried.
        share = (p["M"] - p["Mr"]) / p["M"]
        ahead, left = share * p["xc"], share * p["yc"]
        turn = (Q3 + left * Q1 - ahead * Q2) / (p["J"] + p["Mr"] * (ahead * p["xc"] + left * p["yc"]))
        return Q1 / p["M"] + left * turn, Q2 / p["M"] - ahead * turn, turn

    def compliance(self, state: State, p: Numbers) -> tuple[Scalars, ...]:
        columns = [self._solve(*unit, p) for unit in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
        return tuple(tuple(columns[j][i] for j in range(3)) for i in range(3))

    def rim_levers(self, p: Numbers) -> Scalars:
        return 1.0, 1.0, p["b"]

    def field_force(self, field, state: State, p: Numbers) -> Scalars:
        sin_t, cos_t = sincos(state["theta"])
        carried = p["M"] - p["Mr"]
        along = carried * (cos_t * field[0] + sin_t * field[1])
        across = carried * (cos_t * field[1] - sin_t * field[0])
        return along, across, p["xc"] * across - p["yc"] * along

    def rubbing_rates(self, state: State, rates: State, p: Numbers) -> Scalars:
        return rates["V"], rates["Vn"], rates["W"]

    # -- inductance: time constant La/Ra far below any step, so its transient is integrated exactly ------------------
    def effective_inputs(self, state: State, inputs: Scalars, h, p: Numbers) -> Scalars:
        """Voltages whose quasi-static currents equal the true currents' mean over a step of `h` seconds (eq. 9)."""
        if not self.inductance:
            return inputs
        decay_mean = _decay_mean(h * p["Ra"] / p["La"])
        quasi = self.currents(state, inputs, p)
        limited = (jnp.clip(u, -p["supply"], p["supply"]) for u in inputs)
        return tuple(
            u + p["Ra"] * (state[f"i{i + 1}"] - q) * decay_mean
            for i, (u, q) in enumerate(zip(limited, quasi, strict=True))
        )

    def settle(self, before: State, after: State, inputs: Scalars, h, p: Numbers) -> State:
        """The state after a step with the currents' exact exponential approach to their quasi-static values."""
        if not self.inductance:
            return after
        decay = jnp.exp(-h * p["Ra"] / p["La"])
        start = self.currents(before, inputs, p)
        end = self.currents(after, inputs, p)
        currents = {f"i{i + 1}": end[i] + (before[f"i{i + 1}"] - start[i]) * decay for i in range(4)}
        return {**after, **currents}

    def observe(self, state: State, inputs: Scalars, p: Numbers) -> Scalars:
        if self.inductance:
            currents: Scalars = tuple(state[f"i{i}"] for i in range(1, 5))
        else:
            currents = self.currents(state, inputs, p)
        return state["V"], state["Vn"], state["W"], *currents, *(state[name] for name in self.measured_angles)


def _decay_mean(x):
    """Mean of exp(-t) over 0..x, for x > 0."""
    return -jnp.expm1(-x) / x
