"""A plain differential drive: two driven wheels on one axle, no caster, no constants of motors or gears.

Right and left side r, l with rim speeds s = v ± b w at half the track b; forces at the rims, speeds at the middle of the
axle, heading 0 is world +x. A command u drives its side with

    F = gain (u - back_emf s),        resisted by Fv s + Fc sgn s,

so that with `back_emf = 0` and `gain = 1` the commands are forces. Of M, `Mr` is no mass but the inertia of what turns with
the wheels, behind gears mostly the motors' rotors: m = M - Mr is what has weight and an offset. With its centre `xc` ahead of
the axle's middle and `yc` to its left, J about it and with what the turning parts add (Newton's laws in the turning frame, no
slip sideways; kinetic energy m |v_c|^2 / 2 + J w^2 / 2 + Mr v^2 / 2):

    M dv/dt - m yc dw/dt - m xc w^2 = F_r + F_l
    (J + m (xc^2 + yc^2)) dw/dt - m yc dv/dt + m xc v w = b (F_r - F_l)
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import ClassVar, Literal, Self

from ..logs import DIFFERENTIAL, DIFFERENTIAL_WAYS, DIFFERENTIAL_WHEELS, DIFFERENTIAL_WHEELS_WAYS, Channels
from ..parameters import ParameterTable, parameter
from .effect import Levels, Numbers, Scalar, Scalars, State
from .robot import Robot
from .trigonometry import sincos


@lru_cache
def _with_yaw_rate(wheels: Channels) -> Channels:
    """The channels of wheels' speeds, and the body's yaw rate."""
    return replace(
        wheels,
        outputs=(*wheels.outputs, "w"),
        units={**wheels.units, "w": DIFFERENTIAL.units["w"]},
        mixing={**wheels.mixing, "w": DIFFERENTIAL.mixing["w"]},
    )


@dataclass(frozen=True, repr=False)
class DifferentialDrive(Robot):
    """Two driven wheels on one axle.

    `measures`: "body" for speed v [m/s] and yaw rate w [rad/s] (to the left) in the logs, "wheels" for the rim speeds
    v_right and v_left [m/s], with `gyro=True` and the yaw rate w. `pose=True` integrates x, y, theta as well,
    `wheel_angles=True` the ways [m] that the wheels' rims have rolled, way_right and way_left, which logs may then hold beside
    or in the place of the speeds. Inputs u_right, u_left in any unit.
    """

    measures: Literal["body", "wheels"] = "body"
    pose: bool = False  # type: ignore[misc]
    wheel_angles: bool = False  # type: ignore[misc]
    gyro: bool = field(default=False, kw_only=True)

    name: ClassVar[str] = "differential"
    in_plane: ClassVar[bool] = True
    drive_axes: ClassVar[tuple[int, ...]] = (0, 1)
    angles: ClassVar[tuple[str, ...]] = ("way_right", "way_left")
    angle_unit: ClassVar[str] = "m"
    torque_unit: ClassVar[str] = "N"
    mechanisms: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {
            "lateral_com_offset": ("yc",),
            "forward_com_offset": ("xc",),
            "wheel_radius_mismatch": ("radius_mismatch",),
            "payload_change": ("M", "J", "xc", "yc"),
        }
    )
    words: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"v": "forward speed", "w": "yaw rate", "v_right": "right wheel's speed", "v_left": "left wheel's speed"}
        | {"way_right": "right wheel's position", "way_left": "left wheel's position"}
    )
    parts: ClassVar[Mapping[str, str]] = MappingProxyType({"Mr": "M"})
    driving_modes: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType(
        {"straight": (1.0, 1.0), "on the spot": (1.0, -1.0), "in curves": (1.0, 0.5)}
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.measures not in ("body", "wheels"):
            raise ValueError(f"measures = {self.measures!r}; use 'body' (v, w) or 'wheels' (v_right, v_left)")

    def for_columns(self, columns: Iterable[str]) -> Self:
        """Wheel speeds where the columns have these and not both of the body's, with the yaw rate if it is there; the wheels'
        ways where they have only these.

        One wheel's speed alone says so, too, so that what is missing is the other's.
        """
        there = set(columns)
        speeds = set(DIFFERENTIAL_WHEELS.outputs)
        body = there & set(DIFFERENTIAL.outputs)
        ways = set(self.angles) <= there
        wheels = (speeds <= there and len(body) < 2) or (bool(speeds & there) and not body and not ways)
        return replace(self, measures="wheels", gyro="w" in body) if wheels else super().for_columns(there)

    def defaults(self) -> ParameterTable:
        start, given = "start value", "give it"
        return ParameterTable(
            {
                "M": parameter(10.0, "kg", "mass, wheels' and motors' inertia included", start, free=True),
                "J": parameter(0.3, "kg m^2", "vertical inertia about the centre of mass", start, free=True),
                "Fv": parameter(5.0, "N s/m", "viscous friction of a side", start, free=True),
                "Fc": parameter(1.0, "N", "Coulomb friction of a side", start, free=True),
                "b": parameter(0.2, "m", "half the track width", given),
                "gain": parameter(1.0, "N per unit of u", "force per unit of command", "commands are forces"),
                "back_emf": parameter(0.0, "unit of u s/m", "command that a side's speed costs", "commands are forces"),
                "xc": parameter(0.0, "m", "centre of mass ahead of the axle", "nominal", positive=False, typical=0.02),
                "yc": parameter(0.0, "m", "centre of mass to the left", "nominal", positive=False, typical=0.02),
                "Mr": parameter(
                    0.0, "kg", "part of M that is what turns with the wheels: no weight, no offset", "nominal"
                ),
                "radius_mismatch": parameter(
                    0.0,
                    "",
                    "right wheel larger, left smaller than nominal by this fraction",
                    "nominal",
                    positive=False,
                    typical=0.02,
                ),
            }
        )

    @property
    def said_of_commands(self) -> str:
        gain = self.parameters["gain"]
        if gain.free or gain.value != 1.0:
            return ""
        return (
            f"{', '.join(self.channels.inputs)}: taken for forces in N. If they are volts or duties, mass, inertia and "
            "friction come out per unit of command, until a --model holds the mass (M) and frees the gain."
        )

    @property
    def _wheels(self) -> bool:
        return self.measures == "wheels"

    @property
    def channels(self) -> Channels:  # type: ignore[override]
        """The columns of its logs: of the body or of the wheels, as `measures` says."""
        if not self._wheels:
            return DIFFERENTIAL_WAYS if self.wheel_angles else DIFFERENTIAL
        own = DIFFERENTIAL_WHEELS_WAYS if self.wheel_angles else DIFFERENTIAL_WHEELS
        return _with_yaw_rate(own) if self.gyro else own

    @property
    def velocities(self) -> tuple[str, ...]:  # type: ignore[override]
        return DIFFERENTIAL_WHEELS.outputs if self._wheels else DIFFERENTIAL.outputs

    @property
    def turning(self) -> str:  # type: ignore[override]
        return "" if self._wheels else "w"

    @property
    def translates(self) -> bool:
        return True

    def along(self, state: State, p: Numbers) -> Scalars:
        return (self.planar(state, p)[0],)

    def pushed(self, forces: Scalars, each: Scalars, p: Numbers) -> Scalars:
        if not self._wheels:
            return super().pushed(forces, each, p)
        # The same power on the wheels' speeds: the body's is linear in them.
        (right, left), (larger, smaller), (push,) = forces, self._radii(p), each
        return right + 0.5 * push * larger, left + 0.5 * push * smaller

    @property
    def turns(self) -> bool:
        return True

    @property
    def largest_yaw_rate(self) -> float:
        """Of wheels, that at which both go as fast as the faster does, one forwards and one backwards."""
        if not self._wheels:
            return super().largest_yaw_rate
        if self.gyro:
            return self.scales.output("w")
        return max(map(self.scales.output, self.velocities)) / self.parameters["b"].value

    @property
    def farthest_yaw_rate(self) -> float:
        if not self._wheels:
            return super().farthest_yaw_rate
        if self.gyro:
            return self.scales.reach("w")
        return max(map(self.scales.reach, self.velocities)) / self.parameters["b"].value

    def yaw_rate(self, state: State, p: Numbers) -> Scalar:
        return self.planar(state, p)[2]

    def turned(self, forces: Scalars, moment: Scalar, p: Numbers) -> Scalars:
        if not self._wheels:
            return super().turned(forces, moment, p)
        # The same power on the wheels' speeds: the yaw rate is linear in them.
        (right, left), (larger, smaller) = forces, self._radii(p)
        each = moment / (2.0 * p["b"])
        return right + each * larger, left - each * smaller

    @property
    def translations(self) -> tuple[str, ...]:
        """The body's speed; speeds of wheels are none of the body's."""
        return () if self._wheels else ("v",)

    @property
    def axis_words(self) -> tuple[str, ...]:  # type: ignore[override]
        return ()

    @property
    def own_states(self) -> tuple[str, ...]:
        return self.velocities

    def _nominal_rims(self, state: State, p: Numbers) -> Scalars:
        """Speeds of the axle's ends, right and left."""
        if self._wheels:
            return self._ends(state["v_right"], state["v_left"], p)
        return state["v"] + p["b"] * state["w"], state["v"] - p["b"] * state["w"]

    @staticmethod
    def _ends(right: Scalar, left: Scalar, p: Numbers) -> Scalars:
        """Speeds of the axle's ends where the wheels, read with the nominal radius, show `right` and `left`."""
        return right * (1.0 + p["radius_mismatch"]), left * (1.0 - p["radius_mismatch"])

    def planar(self, state: State, p: Numbers) -> tuple[Scalar, Scalar, Scalar]:
        if not self._wheels:
            return state["v"], 0.0, state["w"]
        right, left = self._nominal_rims(state, p)
        return 0.5 * (right + left), 0.0, (right - left) / (2.0 * p["b"])

    def _radii(self, p: Numbers) -> Scalars:
        """Radii of the wheels over the nominal one."""
        return 1.0 + p["radius_mismatch"], 1.0 - p["radius_mismatch"]

    def with_larger_wheels(self, numbers: Mapping[str, float], share: float) -> dict[str, float]:
        """Torques are forces at the rim with the nominal radius: a larger wheel pushes less, and turns slower. Not known where
        the wheels' speeds are what is measured."""
        if self._wheels:
            return {}
        powers = {"gain": -1, "back_emf": -1, "Fc": -1, "Fv": -2}
        return {name: numbers[name] * (1.0 + share) ** power for name, power in powers.items()}

    def rubbing(self, state: State, p: Numbers) -> Scalars:
        """Speeds of the wheels, as rim speeds with the nominal radius."""
        if self._wheels:
            return state["v_right"], state["v_left"]
        return tuple(end / r for end, r in zip(self._nominal_rims(state, p), self._radii(p), strict=True))

    def motor(self, volts: Scalars, state: State, p: Numbers) -> Scalars:
        return tuple(u - p["back_emf"] * s for u, s in zip(volts, self.rubbing(state, p), strict=True))

    def gear(self, currents: Scalars, volts: Scalars, state: State, p: Numbers) -> Scalars:
        return tuple(p["gain"] * i for i in currents)

    def own_coulomb(self, state: State, p: Numbers) -> Levels:
        return (p["Fc"], p["Fc"]), (p["Fc"], p["Fc"])

    def own_viscous(self, speeds: Scalars, state: State, p: Numbers) -> Scalars:
        return p["Fv"] * speeds[0], p["Fv"] * speeds[1]

    def drive_forces(self, torques: Scalars, p: Numbers) -> Scalars:
        return tuple(force / r for force, r in zip(torques, self._radii(p), strict=True))

    def rim_levers(self, p: Numbers) -> Scalars:
        return 1.0, 1.0

    def motion(
        self, state: State, volts: Scalars, torques: Scalars, resisting: Scalars, forces: Scalars, p: Numbers
    ) -> State:
        wheels = tuple(t - r for t, r in zip(torques, resisting, strict=True))
        if self._wheels:  # a force on a wheel's speed acts at that wheel
            wheels = tuple(w + f for w, f in zip(wheels, forces, strict=True))
        right, left = self.drive_forces(wheels, p)
        ahead, turn = right + left, p["b"] * (right - left)
        if not self._wheels:
            ahead, turn = ahead + forces[0], turn + forces[1]
        v, _, w = self.planar(state, p)
        carried = p["M"] - p["Mr"]
        dv, dw = self._solve(ahead + carried * p["xc"] * w * w, turn - carried * p["xc"] * v * w, p)
        if not self._wheels:
            return {"v": dv, "w": dw}
        larger, smaller = self._radii(p)
        return {"v_right": (dv + p["b"] * dw) / larger, "v_left": (dv - p["b"] * dw) / smaller}

    def _solve(self, ahead: Scalar, turn: Scalar, p: Numbers) -> tuple[Scalar, Scalar]:
        """Accelerations: [[M, -m yc], [-m yc, J + m (xc² + yc²)]] solved for (ahead, turn)."""
        carried = p["M"] - p["Mr"]
        across = carried / p["M"] * p["yc"]
        inertia = p["J"] + carried * p["xc"] * p["xc"] + across * p["Mr"] * p["yc"]
        dw = (turn + across * ahead) / inertia
        return ahead / p["M"] + across * dw, dw

    def angle_rates(self, state: State, p: Numbers) -> Scalars:
        return self.rubbing(state, p)

    def field_force(self, field: tuple[Scalar, Scalar], state: State, p: Numbers) -> Scalars:
        sine, cosine = sincos(state["theta"])
        carried = p["M"] - p["Mr"]
        along = carried * (cosine * field[0] + sine * field[1])
        across = carried * (cosine * field[1] - sine * field[0])
        turn = p["xc"] * across - p["yc"] * along
        if not self._wheels:
            return along, turn
        return self.turned(self.pushed((0.0, 0.0), (along,), p), turn, p)

    def observe(self, state: State, inputs: Scalars, p: Numbers) -> Scalars:
        if not (self._wheels and self.gyro):
            return tuple(state[name] for name in self.channels.measured)
        return tuple(self.yaw_rate(state, p) if n == "w" else state[n] for n in self.channels.measured)
