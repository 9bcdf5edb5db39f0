"""The Pioneer: a differential drive with a caster (Innocenti et al.), coupled dynamics and motors.

Body frame: x to the right, y forward. Wheel 2 is the right driving wheel, wheel 3 the left, wheel 1 the caster. State
beta [rad], eta1 forward speed [m/s], eta2 yaw rate [rad/s]; pose x, y [m], theta [rad] and wheel angles phi2, phi3 [rad]
where they are wanted. Heading 0 is world +y. Inputs V2, V3 [V].

This is the fast closed form of equation 8 with the motors of equation 28; the matrices as the paper names them are in
`papers/pioneer/equations.py`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

from ..logs import PIONEER, PIONEER_ANGLES, Channels
from ..parameters import ParameterTable, parameter
from .class_channels import on_class_too
from .effect import Levels, Numbers, Scalar, Scalars, State
from .pioneer_closed_form import bias, reduced_inertia
from .robot import Robot
from .scales import Scales
from .trigonometry import sincos


def _inertia(state: State, p: Numbers):
    """J11, J12, J22 at this caster angle, with driving wheels of unequal radius, and its sine and cosine."""
    sin_b, cos_b = sincos(state["beta"])
    J11, J12, J22 = reduced_inertia(cos_b, sin_b, p)
    spin = p["Ir"] / p["R"] ** 2
    right, left = spin / (1.0 + p["radius_mismatch"]) ** 2, spin / (1.0 - p["radius_mismatch"]) ** 2
    J11 = J11 + (right + left - 2.0 * spin)
    J12 = J12 + p["L"] * (right - left)
    J22 = J22 + p["L"] ** 2 * (right + left - 2.0 * spin)
    return J11, J12, J22, sin_b, cos_b


def _wheel_levers(p: Numbers):
    """Speeds (phi2', phi3') of the driving wheels per unit of (eta1, eta2)."""
    right, left = p["R"] * (1.0 + p["radius_mismatch"]), p["R"] * (1.0 - p["radius_mismatch"])
    return (1.0 / right, p["L"] / right), (1.0 / left, -p["L"] / left)


def _levers(sin_b, cos_b, p: Numbers):
    """Rows of B: rubbing speeds (phi2', phi3', beta') per unit of (eta1, eta2)."""
    return (*_wheel_levers(p), (-sin_b / p["d"], -(p["d"] + p["l1"] * cos_b) / p["d"]))


def straight_inertia(p: Numbers):
    """1/a11 of equation 34 [kg]: J11 with the caster trailing."""
    return p["M"] + 2 * p["m"] + p["m1"] + p["Ir1"] / p["R1"] ** 2 + 2 * p["Ir"] / p["R"] ** 2


def turning_inertia(p: Numbers):
    """1/a22 of equation 35 [kg m²]: J22 with the caster across (beta = -90°), with l1² where the paper prints I_r²."""
    return (
        p["M"] * (p["xm"] ** 2 + p["ym"] ** 2)
        + p["I0"]
        + 2 * p["Ip"]
        + 2 * p["m"] * p["L"] ** 2
        + p["m1"] * p["l1"] ** 2
        + p["l1"] ** 2 * p["Ir1"] / p["R1"] ** 2
        + 2 * p["L"] ** 2 * p["Ir"] / p["R"] ** 2
    )


@dataclass(frozen=True, repr=False)
class Pioneer(Robot):
    """Differential-drive robot with a caster. `pose=True` integrates the pose x, y, theta as well, `wheel_angles=True` the
    angles phi2, phi3 [rad] of the driving wheels, which logs may then hold beside or in the place of the speeds."""

    pose: bool = False  # type: ignore[misc]
    wheel_angles: bool = False  # type: ignore[misc]

    name: ClassVar[str] = "pioneer"
    velocities: ClassVar[tuple[str, ...]] = ("eta1", "eta2")
    drive_axes: ClassVar[tuple[int, ...]] = (0, 1)
    angles: ClassVar[tuple[str, ...]] = ("phi2", "phi3")
    friction_unit: ClassVar[str] = "N m"
    turning: ClassVar[str] = "eta2"
    in_plane: ClassVar[bool] = True
    winding: ClassVar[str] = "Ra"
    supply_voltage: ClassVar[str] = "supply"
    steps_per_time_constant: ClassVar[float] = 19.0  # the caster turns faster than the speeds change
    nominal: ClassVar[Scales] = Scales(
        input=10.0, speed=1.0, torque=4.7, friction=5.0, force=56.0, time=0.19, acceleration=6.0
    )
    mechanisms: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {
            "lateral_com_offset": ("xm",),
            "wheel_radius_mismatch": ("radius_mismatch",),
            "effective_track": ("L",),
            "payload_change": ("M", "I0", "xm", "ym"),
        }
    )
    wheel_radius: ClassVar[str] = "R"
    words: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"eta1": "forward speed", "eta2": "yaw rate", "phi2": "right wheel's angle", "phi3": "left wheel's angle"}
    )
    driving_modes: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType(
        {"straight": (1.0, 1.0), "on the spot": (1.0, -1.0), "in curves": (1.0, 0.5)}
    )
    prior_spreads: ClassVar[Mapping[str, float]] = MappingProxyType({"beta": 0.5})
    ambiguous: ClassVar[tuple[str, ...]] = ("beta",)
    combinations: ClassVar[dict] = {
        "1/a11": (straight_inertia, "kg", "inertia against straight motion (eq. 34)"),
        "1/a22": (turning_inertia, "kg m^2", "inertia against turning on the spot (eq. 35)"),
    }

    def defaults(self) -> ParameterTable:
        maker, measured, table5 = "Table 2 (manufacturer)", "section 4 (measured)", "Table 5"
        physical = {
            "M": parameter(15.5, "kg", "mass of the body", measured),
            "m": parameter(0.35, "kg", "mass of a driving wheel", measured),
            "m1": parameter(0.35, "kg", "mass of the caster wheel", measured),
            "R": parameter(0.0825, "m", "radius of the driving wheels", measured),
            "R1": parameter(0.035, "m", "radius of the caster wheel", measured),
            "L": parameter(0.1689, "m", "half the track width", measured + "; printed 16.89 m"),
            "l1": parameter(0.18, "m", "axle to caster pivot", measured),
            "d": parameter(0.03, "m", "trail of the caster", measured),
            "xm": parameter(
                0.0, "m", "centre of mass to the right of the axis of symmetry", measured, positive=False, typical=0.02
            ),
            "ym": parameter(-0.07, "m", "centre of mass ahead of the axle", measured, positive=False),
            "I0": parameter(0.3, "kg m^2", "vertical inertia of the body about its centre of mass", table5, free=True),
            "Ir1": parameter(2.144e-4, "kg m^2", "spin inertia of the caster wheel", table5, free=True),
            "Ir": parameter(0.0012, "kg m^2", "spin inertia of a driving wheel", table5, free=True),
            "Ip1": parameter(1.072e-4, "kg m^2", "vertical inertia of the caster wheel", table5, free=True),
            "Ip": parameter(5.95e-4, "kg m^2", "vertical inertia of a driving wheel", table5),
            "Cs1": parameter(0.004536, "N m", "Coulomb friction of the caster's pivot", table5, free=True),
            "Cv1": parameter(0.000429, "N m s", "viscous friction of the caster's pivot", table5, free=True),
            "Cs": parameter(0.3184, "N m", "Coulomb friction of a driving wheel", table5, free=True),
            "Cv": parameter(0.0444, "N m s", "viscous friction of a driving wheel", table5, free=True),
            "KT": parameter(0.023, "N m/A", "torque constant", maker),
            "KE": parameter(0.023, "V s/rad", "back-EMF constant", maker),
            "Ra": parameter(0.71, "ohm", "armature resistance", maker),
            "tr": parameter(19.7, "", "gear ratio", maker),
            "mu": parameter(0.73, "", "gearbox efficiency", maker),
            "tau_fr": parameter(5.6e-3, "N m", "friction torque of the motor", maker),
            "supply": parameter(12.0, "V", "supply voltage: that of the battery", maker),
            "radius_mismatch": parameter(
                0.0,
                "",
                "right driving wheel larger, left smaller than R by this fraction",
                "nominal",
                positive=False,
                typical=0.02,
            ),
        }
        return ParameterTable(physical)

    @on_class_too(PIONEER)
    def channels(self) -> Channels:  # type: ignore[override]
        """The columns of its logs, with the wheels' angles where these are measured."""
        return PIONEER_ANGLES if self.wheel_angles else PIONEER

    @property
    def own_states(self) -> tuple[str, ...]:
        return ("beta", "eta1", "eta2")

    def motor(self, volts: Scalars, state: State, p: Numbers) -> Scalars:
        emf = p["KE"] * p["tr"]
        return tuple((u - emf * w) / p["Ra"] for u, w in zip(volts, self.angle_rates(state, p), strict=True))

    def gear(self, currents: Scalars, volts: Scalars, state: State, p: Numbers) -> Scalars:
        return tuple(p["tr"] * p["mu"] * p["KT"] * i for i in currents)

    def rubbing(self, state: State, p: Numbers) -> Scalars:
        sin_b, cos_b = sincos(state["beta"])
        return tuple(b1 * state["eta1"] + b2 * state["eta2"] for b1, b2 in _levers(sin_b, cos_b, p))

    def own_coulomb(self, state: State, p: Numbers) -> Levels:
        wheel = p["Cs"] + p["tr"] * p["mu"] * p["tau_fr"]  # the motor's own friction, eq. 28, rubs at the same speed
        return ((wheel, wheel), (wheel, wheel), (p["Cs1"], p["Cs1"]))

    def own_viscous(self, speeds: Scalars, state: State, p: Numbers) -> Scalars:
        return p["Cv"] * speeds[0], p["Cv"] * speeds[1], p["Cv1"] * speeds[2]

    def motion(
        self, state: State, volts: Scalars, torques: Scalars, resisting: Scalars, forces: Scalars, p: Numbers
    ) -> State:
        eta1, eta2 = state["eta1"], state["eta2"]
        J11, J12, J22, sin_b, cos_b = _inertia(state, p)
        levers = _levers(sin_b, cos_b, p)
        axes = (torques[0] - resisting[0], torques[1] - resisting[1], -resisting[2])
        g1, g2 = bias(cos_b, sin_b, eta1, eta2, p)
        Q1 = forces[0] - g1 + sum(b[0] * t for b, t in zip(levers, axes, strict=True))
        Q2 = forces[1] - g2 + sum(b[1] * t for b, t in zip(levers, axes, strict=True))
        scale = 1.0 / (J11 * J22 - J12 * J12)
        return {
            "beta": levers[2][0] * eta1 + levers[2][1] * eta2,
            "eta1": (J22 * Q1 - J12 * Q2) * scale,
            "eta2": (J11 * Q2 - J12 * Q1) * scale,
        }

    def planar(self, state: State, p: Numbers) -> tuple[Scalar, Scalar, Scalar]:
        return 0.0, state["eta1"], state["eta2"]

    def angle_rates(self, state: State, p: Numbers) -> Scalars:
        return tuple(b1 * state["eta1"] + b2 * state["eta2"] for b1, b2 in _wheel_levers(p))

    def compliance(self, state: State, p: Numbers) -> tuple[Scalars, ...]:
        J11, J12, J22, sin_b, cos_b = _inertia(state, p)
        levers = _levers(sin_b, cos_b, p)
        scale = 1.0 / (J11 * J22 - J12 * J12)
        moved = tuple(((J22 * b1 - J12 * b2) * scale, (J11 * b2 - J12 * b1) * scale) for b1, b2 in levers)
        return tuple(tuple(b1 * m1 + b2 * m2 for m1, m2 in moved) for b1, b2 in levers)

    def rim_levers(self, p: Numbers) -> Scalars:
        return p["R"], p["R"], p["d"]

    def drive_forces(self, torques: Scalars, p: Numbers) -> Scalars:
        return tuple(torque / p["R"] for torque in torques)

    def field_force(self, field, state: State, p: Numbers) -> Scalars:
        """Body, driving wheels and caster are pulled each at its place; the caster gives way along its rolling direction."""
        sin_t, cos_t = sincos(state["theta"])
        sin_b, cos_b = sincos(state["beta"])
        ahead, right = -sin_t * field[0] + cos_t * field[1], cos_t * field[0] + sin_t * field[1]
        rolling = p["m1"] * (cos_b * ahead - sin_b * right)
        forwards = (p["M"] + 2.0 * p["m"]) * ahead + rolling * cos_b
        return forwards, p["M"] * (p["xm"] * ahead - p["ym"] * right) - rolling * p["l1"] * sin_b

    def rubbing_rates(self, state: State, rates: State, p: Numbers) -> Scalars:
        sin_b, cos_b = sincos(state["beta"])
        return tuple(b1 * rates["eta1"] + b2 * rates["eta2"] for b1, b2 in _levers(sin_b, cos_b, p))

    def observe(self, state: State, inputs: Scalars, p: Numbers) -> Scalars:
        return state["eta1"], state["eta2"], *(state[name] for name in self.measured_angles)
