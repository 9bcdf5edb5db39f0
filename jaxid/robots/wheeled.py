"""Any robot on driven wheels in the plane, from where its wheels stand and how they roll: kinetic energy and rolling
constraints.

Body axes: x ahead, y to the left of the layout's origin; V, Vn [m/s] along them and W [rad/s] to the left, or v, w where its
wheels keep it from slipping sideways. The motions that the wheels allow are (V, Vn, W) = S eta and a wheel turns at
phi' = A eta / r (`wheels.py`). With m = M, centre of mass (xc, yc), J about it and `Iw` of every wheel with what turns with it,

    T = m |v_c|^2 / 2 + J W^2 / 2 + Iw |phi'|^2 / 2

    (S^T B S + Iw A^T A / r^2) d eta/dt = S^T (W py, -W px, Vn px - V py) + A^T (tau - friction) / r + forces

by Lagrange and d'Alembert, with the body's matrix B about the origin and its momentum (px, py) = m (V - W yc, Vn + W xc); the
wheels' own turns with nothing. Torques tau of a wheel by its motor, u in volts and held to the supply,

    tau = gear K (u - gear K phi') / Ra,

or without motors tau = gain (u - back_emf phi'). Friction of a wheel: viscous phi' + coulomb sgn phi'; of wheels that
scrub when the robot turns, together: Bw W + Cw sgn W.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Literal, Self

import jax.numpy as jnp

from ..logs import Channels
from ..parameters import Parameter, ParameterTable, parameter
from .effect import Levels, Numbers, Scalar, Scalars, State
from .robot import Robot
from .signal_path import products
from .trigonometry import sincos
from .wheel_channels import Shown, channels_of
from .wheels import LayoutError, Wheel, rim_rows, twists


@dataclass(frozen=True, repr=False, kw_only=True)
class Wheeled(Robot):
    """A robot on the driven `wheels`; casters are left out.

    `title`: its name. `motors=True`: commands are the voltages of its motors, whose constants are K, Ra and gear; else
    torques of the wheels [N m], or by `gain` whatever else. `measures`: "body" for speeds of the body in the logs, V, Vn and W
    or v and w, "wheels" for `speed_<wheel>` [rad/s], with `gyro=True` and the yaw rate of the body. `pose=True` integrates x,
    y, theta as well, `wheel_angles=True` the angles `angle_<wheel>` [rad], which logs may then hold beside or in the place of
    the speeds.

    Raises `LayoutError` for wheels that cannot move it.
    """

    wheels: tuple[Wheel, ...]
    title: str = "wheeled"
    motors: bool = False
    measures: Literal["body", "wheels"] = "body"
    gyro: bool = False
    pose: bool = False  # type: ignore[misc]
    wheel_angles: bool = False  # type: ignore[misc]

    in_plane: ClassVar[bool] = True
    friction_unit: ClassVar[str] = "N m"
    wheel_radius: ClassVar[str] = "r"
    wheel_inertia: ClassVar[str] = "Iw"
    wheel_sides: ClassVar[tuple[str, str]] = ("wheels on the right", "wheels on the left")

    def __post_init__(self) -> None:
        object.__setattr__(self, "wheels", tuple(self.wheels))
        if not self.wheels:
            raise LayoutError("a robot without driven wheels does not move; give at least one")
        names = [wheel.name for wheel in self.wheels]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise LayoutError(f"two wheels are called {twice}; give each its own name")
        if self.measures not in ("body", "wheels"):
            raise ValueError(
                f"measures = {self.measures!r}; use 'body' (speeds of the body) or 'wheels' (of the wheels)"
            )
        _ = self.motions
        super().__post_init__()

    # -- what it says about itself -------------------------------------------------------------------------------------
    @property
    def name(self) -> str:  # type: ignore[override]
        """What sentences call it."""
        return self.title

    @property
    def motions(self) -> tuple[tuple[float, float, float], ...]:
        """S, a row (V, Vn, W) per velocity."""
        return twists(self.wheels)

    @property
    def velocities(self) -> tuple[str, ...]:  # type: ignore[override]
        """V, Vn and W, or v and w where its wheels keep it from slipping sideways."""
        return ("V", "Vn", "W") if len(self.motions) == 3 else ("v", "w")

    @property
    def turning(self) -> str:  # type: ignore[override]
        """The yaw rate."""
        return self.velocities[-1]

    @property
    def channels(self) -> Channels:  # type: ignore[override]
        """The columns of its logs: of the body or of the wheels, as `measures` says, with the wheels' angles where wanted."""
        return channels_of(self.wheels, self.motors, self._shown, self.wheel_angles)

    @property
    def _shown(self) -> Shown:
        return "body" if self.measures == "body" else "wheels and yaw rate" if self.gyro else "wheels"

    @property
    def angles(self) -> tuple[str, ...]:  # type: ignore[override]
        """The wheels' angles."""
        return tuple(f"angle_{wheel.name}" for wheel in self.wheels)

    @property
    def drive_axes(self) -> tuple[int, ...]:  # type: ignore[override]
        """All its wheels."""
        return tuple(range(len(self.wheels)))

    @property
    def axis_words(self) -> tuple[str, ...]:  # type: ignore[override]
        """The wheels' names in words."""
        return tuple(wheel.name.replace("_", " ") for wheel in self.wheels)

    @property
    def winding(self) -> str:  # type: ignore[override]
        """The resistance of each motor's winding, of a robot with motors."""
        return "Ra" if self.motors else ""

    @property
    def supply_voltage(self) -> str | None:  # type: ignore[override]
        """The parameter that is the supply's voltage, of a robot with motors."""
        return "supply" if self.motors else None

    @property
    def scrubs(self) -> bool:  # type: ignore[override]
        return any(wheel.kind == "skid" for wheel in self.wheels)

    @property
    def mechanisms(self) -> Mapping[str, tuple[str, ...]]:  # type: ignore[override]
        """Effect id -> the robot's own parameters that are this mechanism."""
        centre = {"lateral_com_offset": ("yc", "xc")}
        if len(self.motions) == 2:
            centre = {"forward_com_offset": ("xc",), "lateral_com_offset": ("yc",)}
        found = centre | {
            "effective_track": ("track",),
            "payload_change": ("M", "J", "xc", "yc"),
        }
        if len({wheel.side for wheel in self.wheels} - {0.0}) == 2:
            found["wheel_radius_mismatch"] = ("radius_mismatch",)
        return MappingProxyType(found)

    @property
    def wheel_radii(self) -> tuple[str, ...]:  # type: ignore[override]
        """One for every wheel of three or more."""
        return tuple(f"mismatch_{wheel.name}" for wheel in self.wheels) if len(self.wheels) > 2 else ()

    @property
    def words(self) -> Mapping[str, str]:  # type: ignore[override]
        """Channel -> what it measures, in words."""
        wheels = zip(self.wheels, self.axis_words, strict=True)
        found = {"v": "forward speed", "w": "yaw rate", "V": "forward speed", "Vn": "sideways speed", "W": "yaw rate"}
        for wheel, word in wheels:
            found |= {f"speed_{wheel.name}": f"speed of wheel {word}", f"angle_{wheel.name}": f"angle of wheel {word}"}
        return found

    @property
    def driving_modes(self) -> Mapping[str, tuple[float, ...]]:  # type: ignore[override]
        """Ahead, sideways, on the spot and all at once: the commands by which the wheels turn as in that motion."""
        rows, inputs = self._rows(self.parameters.numbers or self.defaults().numbers), self.channels.inputs
        ways = ("forwards", "sideways", "on the spot") if len(self.motions) == 3 else ("forwards", "on the spot")
        found = {}
        single = {way: tuple(float(k == i) for k in range(len(ways))) for i, way in enumerate(ways)}
        for way, motion in single.items():
            wheels = [sum(a * m for a, m in zip(row, motion, strict=True)) for row in rows]
            found[way] = {wheel.input: turned for wheel, turned in zip(self.wheels, wheels, strict=True)}
        each = {way: max(map(abs, of.values())) or 1.0 for way, of in found.items()}
        shares = {"forwards": 1.0, "sideways": 0.7, "on the spot": 0.4}
        found["along and turning"] = {
            name: sum(shares[way] * of[name] / each[way] for way, of in found.items()) for name in inputs
        }
        largest = {way: max(map(abs, of.values())) or 1.0 for way, of in found.items()}
        return {way: tuple(of[name] / largest[way] for name in inputs) for way, of in found.items()}

    @property
    def said_of_commands(self) -> str:
        if self.motors or self.parameters["gain"].free or self.parameters["gain"].value != 1.0:
            return ""
        return (
            f"{', '.join(self.channels.inputs)}: taken for torques of the wheels in N m. For volts give the motors' constants "
            "(K, Ra, gear) in the robot's file; else mass, inertia and friction come out per unit of command."
        )

    def for_columns(self, columns: Iterable[str]) -> Self:
        """Wheel speeds where the columns have these and not all of the body's, with the yaw rate if it is there; the wheels'
        angles where they have only these."""
        there = set(columns)
        wheels = {f"speed_{wheel.name}" for wheel in self.wheels}
        body = there & set(self.velocities)
        if wheels <= there and len(body) < len(self.velocities):
            return replace(self, measures="wheels", gyro=self.turning in body)
        return super().for_columns(there)

    def defaults(self) -> ParameterTable:
        start, given, nominal = "start value", "give it", "nominal"
        signed = {"positive": False, "typical": 0.02}
        table = {
            "M": parameter(10.0, "kg", "mass, wheels included", start, free=True),
            "J": parameter(0.3, "kg m^2", "vertical inertia about the centre of mass", start, free=True),
            "viscous": parameter(0.01, "N m s/rad", "viscous friction of a wheel", start, free=True),
            "coulomb": parameter(0.05, "N m", "Coulomb friction of a wheel", start, free=True),
        }
        if self.scrubs:
            table |= {
                "Bw": parameter(0.1, "N m s", "viscous friction of turning", start, free=True),
                "Cw": parameter(1.0, "N m", "Coulomb friction of turning", start, free=True),
            }
        table["r"] = parameter(0.05, "m", "wheel radius", given)
        if self.motors:
            table |= {
                "K": parameter(0.02, "N m/A", "torque constant, and back-EMF constant in V s/rad", given),
                "Ra": parameter(1.0, "ohm", "armature resistance", given),
                "gear": parameter(1.0, "", "gear reduction", given),
                "supply": parameter(24.0, "V", "supply voltage: the largest motor voltage", given),
            }
        else:
            table |= {
                "gain": parameter(1.0, "N m per unit of u", "torque per unit of command", "commands are torques"),
                "back_emf": parameter(
                    0.0, "unit of u s/rad", "command that a wheel's speed costs", "commands are torques"
                ),
            }
        return ParameterTable(table | self._nominal(signed, nominal))

    def _nominal(self, signed, nominal: str) -> dict[str, Parameter]:
        """What a layout says by itself, until something is found of it."""
        return {
            "Iw": parameter(0.0, "kg m^2", "inertia of a wheel with what turns with it, rotor by gear^2", nominal),
            "xc": parameter(0.0, "m", "centre of mass ahead of the origin", nominal, **signed),
            "yc": parameter(0.0, "m", "centre of mass to the left of the origin", nominal, **signed),
            "track": parameter(1.0, "", "arms at which the wheels turn the robot, over those of the layout", nominal),
            "radius_mismatch": parameter(
                0.0, "", "wheels on the right larger, on the left smaller than r by this fraction", nominal, **signed
            ),
        } | {name: parameter(0.0, "", "this wheel larger than r", nominal, **signed) for name in self.wheel_radii}

    # -- geometry ------------------------------------------------------------------------------------------------------
    def _rows(self, p: Numbers) -> tuple[Scalars, ...]:
        """Rates [rad/s] of every wheel per velocity, A / r."""
        found = []
        for wheel, row in zip(self.wheels, rim_rows(self.wheels), strict=True):
            per_radius = 1.0 / self._radius(wheel, p)
            along = tuple(per_radius * number if number else 0.0 for number in row[:-1])
            found.append((*along, per_radius * p["track"] * row[-1] if row[-1] else 0.0))
        return tuple(found)

    def _radius(self, wheel: Wheel, p: Numbers) -> Scalar:
        side = wheel.side
        usual = p["r"] * (1.0 + side * p["radius_mismatch"]) if side else p["r"]
        return usual * (1.0 + p[f"mismatch_{wheel.name}"]) if self.wheel_radii else usual

    def _twist(self, state: State) -> tuple[Scalar, Scalar, Scalar]:
        """(V, Vn, W)."""
        speeds = [state[name] for name in self.velocities]
        along, left, turning = (
            products(*((row[k], speed) for row, speed in zip(self.motions, speeds, strict=True))) for k in range(3)
        )
        return along, left, turning

    def _onto(self, force: tuple[Scalar, Scalar, Scalar]) -> Scalars:
        """Generalised forces S^T of a force along x and y and a moment."""
        return tuple(products(*zip(row, force, strict=True)) for row in self.motions)

    def planar(self, state: State, p: Numbers) -> tuple[Scalar, Scalar, Scalar]:
        return self._twist(state)

    @property
    def own_states(self) -> tuple[str, ...]:
        return self.velocities

    @property
    def translations(self) -> tuple[str, ...]:
        return self.velocities[:-1]

    @property
    def largest_yaw_rate(self) -> float:
        return self._yaw_rate_of(self.scales.output)

    @property
    def farthest_yaw_rate(self) -> float:
        return self._yaw_rate_of(self.scales.reach)

    def _yaw_rate_of(self, size) -> float:
        """Of wheels that are measured, that at which the one that turning turns most goes as fast as the fastest."""
        if self.turning in self.channels.outputs:
            return size(self.turning)
        arms = [abs(float(row[-1])) for row in self._rows(self.parameters.numbers)]
        return max(map(size, self.channels.outputs)) / max(arms)

    # -- stages --------------------------------------------------------------------------------------------------------
    def rubbing(self, state: State, p: Numbers) -> Scalars:
        """Rates [rad/s] of the wheels, and the yaw rate where they scrub."""
        wheels = self._speeds(state, p)
        return (*wheels, state[self.turning]) if self.scrubs else wheels

    def _speeds(self, state: State, p: Numbers) -> Scalars:
        """Rates [rad/s] of the wheels."""
        speeds = [state[name] for name in self.velocities]
        return tuple(products(*zip(row, speeds, strict=True)) for row in self._rows(p))

    def driver(self, volts: Scalars, state: State, p: Numbers) -> Scalars:
        return tuple(jnp.clip(u, -p["supply"], p["supply"]) for u in volts) if self.motors else volts

    @property
    def motors_behind(self) -> tuple[int, ...]:
        """How many wheels' motors share each command."""
        shared = [wheel.input for wheel in self.wheels]
        return tuple(shared.count(name) for name in self.channels.inputs)

    def motor(self, volts: Scalars, state: State, p: Numbers) -> Scalars:
        """Current [A] of each command's motors, the mean where several wheels share it; without motors what the commands have
        left of their speeds."""
        emf, winding = self._motor_constants(p)
        speeds = self._of_commands(self._speeds(state, p))
        return tuple((u - emf * speed) / winding for u, speed in zip(volts, speeds, strict=True))

    def gear(self, currents: Scalars, volts: Scalars, state: State, p: Numbers) -> Scalars:
        torque = p["gear"] * p["K"] if self.motors else p["gain"]
        if len(currents) < len(self.wheels):  # of wheels that share a command a faster one has less
            emf, winding = self._motor_constants(p)
            speeds = self._speeds(state, p)
            of_each = zip(currents, self._of_commands(speeds), strict=True)
            mean = dict(zip(self.channels.inputs, of_each, strict=True))
            own = ((*mean[wheel.input], speed) for wheel, speed in zip(self.wheels, speeds, strict=True))
            currents = tuple(current + emf * (usual - speed) / winding for current, usual, speed in own)
        return tuple(torque * current for current in currents)

    def _motor_constants(self, p: Numbers) -> tuple[Scalar, Scalar]:
        """The command that a wheel's speed takes [V s/rad], and the motor's resistance [ohm]; without motors one."""
        return (p["gear"] * p["K"], p["Ra"]) if self.motors else (p["back_emf"], 1.0)

    def _of_commands(self, of_wheels: Scalars) -> Scalars:
        """The mean of each command's wheels."""
        own = [
            [x for wheel, x in zip(self.wheels, of_wheels, strict=True) if wheel.input == n]
            for n in self.channels.inputs
        ]
        return tuple(each[0] if len(each) == 1 else sum(each) / len(each) for each in own)

    def own_coulomb(self, state: State, p: Numbers) -> Levels:
        levels = ((p["coulomb"], p["coulomb"]),) * len(self.wheels)
        return (*levels, (p["Cw"], p["Cw"])) if self.scrubs else levels

    def own_viscous(self, speeds: Scalars, state: State, p: Numbers) -> Scalars:
        wheels = tuple(p["viscous"] * speed for speed in speeds[: len(self.wheels)])
        return (*wheels, p["Bw"] * speeds[-1]) if self.scrubs else wheels

    def rim_levers(self, p: Numbers) -> Scalars:
        wheels = tuple(self._radius(wheel, p) for wheel in self.wheels)
        return (*wheels, max(abs(row[-1]) for row in rim_rows(self.wheels))) if self.scrubs else wheels

    def drive_forces(self, torques: Scalars, p: Numbers) -> Scalars:
        return tuple(torque / self._radius(wheel, p) for wheel, torque in zip(self.wheels, torques, strict=True))

    def motion(
        self, state: State, volts: Scalars, torques: Scalars, resisting: Scalars, forces: Scalars, p: Numbers
    ) -> State:
        V, Vn, W = self._twist(state)
        ahead, left = products((1.0, V), (-p["yc"], W)), products((1.0, Vn), (p["xc"], W))  # of the centre of mass
        m = p["M"]
        turned = self._onto((m * left * W, -m * ahead * W, m * products((Vn, ahead), (-1.0 * left, V))))
        wheels = tuple(t - r for t, r in zip(torques, resisting, strict=False))
        rows, count = self._rows(p), len(self.velocities)
        driving = [products(*((row[k], w) for row, w in zip(rows, wheels, strict=True))) for k in range(count)]
        if self.scrubs:
            driving[-1] = driving[-1] - resisting[-1]
        Q = tuple(d + t + f for d, t, f in zip(driving, turned, forces, strict=True))
        return dict(zip(self.velocities, self._solved(Q, rows, p), strict=True))

    def _inertia(self, rows: tuple[Scalars, ...], p: Numbers) -> list[list[Scalar]]:
        """S^T B S + Iw A^T A / r^2."""
        m, xc, yc = p["M"], p["xc"], p["yc"]
        body = ((m, 0.0, -m * yc), (0.0, m, m * xc), (-m * yc, m * xc, p["J"] + m * (xc * xc + yc * yc)))
        count, S = len(self.velocities), self.motions
        of_body = [self._onto(tuple(products(*zip(line, row, strict=True)) for line in body)) for row in S]  # type: ignore[arg-type]
        of_wheels = [[products(*((row[i], row[k]) for row in rows)) for k in range(count)] for i in range(count)]
        return [[of_body[i][k] + p["Iw"] * of_wheels[i][k] for k in range(count)] for i in range(count)]

    def _solved(self, Q: Scalars, rows: tuple[Scalars, ...], p: Numbers) -> Scalars:
        """Accelerations of generalised forces, by elimination: the matrix is symmetric and positive."""
        A, found = self._inertia(rows, p), list(Q)
        for k in range(len(found)):
            for i in range(k + 1, len(found)):
                share = A[i][k] / A[k][k]
                A[i] = [0.0 if j <= k else A[i][j] - share * A[k][j] for j in range(len(found))]
                found[i] = found[i] - share * found[k]
        for k in reversed(range(len(found))):
            known = ((A[k][j], found[j]) for j in range(k + 1, len(found)))
            found[k] = (found[k] - products(*known)) / A[k][k]
        return tuple(found)

    def compliance(self, state: State, p: Numbers) -> tuple[Scalars, ...]:
        rows, count = self._rows(p), len(self.velocities)
        lines = (*rows, (*(0.0,) * (count - 1), 1.0)) if self.scrubs else rows
        moved = [self._solved(line, rows, p) for line in lines]
        return tuple(tuple(products(*zip(line, own, strict=True)) for own in moved) for line in lines)

    def rubbing_rates(self, state: State, rates: State, p: Numbers) -> Scalars:
        return self.rubbing(rates, p)

    def angle_rates(self, state: State, p: Numbers) -> Scalars:
        return self._speeds(state, p)

    def field_force(self, field: tuple[Scalar, Scalar], state: State, p: Numbers) -> Scalars:
        sine, cosine = sincos(state["theta"])
        along = p["M"] * (cosine * field[0] + sine * field[1])
        across = p["M"] * (cosine * field[1] - sine * field[0])
        return self._onto((along, across, p["xc"] * across - p["yc"] * along))

    def observe(self, state: State, inputs: Scalars, p: Numbers) -> Scalars:
        speeds = self._speeds(state, p) if self.measures == "wheels" else ()
        seen = (*speeds, *(state[name] for name in self.velocities if name in self.channels.outputs))
        return (*seen, *(state[name] for name in self.measured_angles))
