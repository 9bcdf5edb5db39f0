"""What a user declares about a robot of their own: its fields, what they must fulfil, and the traits that follow from them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from inspect import Parameter as Argument
from inspect import signature
from typing import Any, ClassVar, Self

import numpy as np

from ..logs import Channels
from ..logs.units import metres_of
from ..parameters import Parameter, ParameterError, ParameterTable
from .drive_axis import DriveAxis
from .effect import Scalar
from .lengths import accelerated
from .own_viscous import ViscousFriction, viscous_times
from .robot import Robot
from .user_functions import UserFunctions, check_user_functions

_MOST_ROBOTS = 256
_INSTEAD = "pass `output=` to say how they follow from the state"


@cache
def takes_friction(dynamics: Callable[..., Any]) -> bool:
    kinds = (Argument.POSITIONAL_ONLY, Argument.POSITIONAL_OR_KEYWORD)
    arguments = signature(dynamics).parameters.values()
    some = any(a.kind == Argument.VAR_POSITIONAL for a in arguments)
    return some or sum(a.kind in kinds and a.default is Argument.empty for a in arguments) >= 4


@lru_cache(_MOST_ROBOTS)
def _positions(robot: "Declared", numbers: tuple[tuple[str, float], ...]) -> tuple[tuple[str, str], ...]:
    """(velocity, the state whose derivative it is), as the dynamics show at three states without symmetry."""
    # NumPy's numbers: a fit may have ended at a mass of zero, and dividing Python's by that raises.
    names, inputs, p = robot.state_names, robot.own_channels.inputs, {name: np.float64(x) for name, x in numbers}
    friction = ({axis: 0.0 for axis, _ in robot._axes},) if robot._axes and takes_friction(robot.dynamics) else ()
    found = {(v, s) for v in robot.velocities for s in names if s != v}
    for probe in np.random.default_rng(1).uniform(0.1, 1.0, (3, len(names) + len(inputs))):
        state = dict(zip(names, probe, strict=False))
        given = dict(zip(inputs, probe[len(names) :], strict=True))
        with np.errstate(all="ignore"):
            rates = robot.dynamics(state, given, p, *friction)
        found = {(v, s) for v, s in found if np.allclose(float(np.asarray(rates[s])), state[v], rtol=1e-6, atol=0.0)}
    return tuple(sorted(found))


@lru_cache(_MOST_ROBOTS)
def _with_angles(own: Channels, angles: tuple[str, ...], unit: str, velocities: tuple[str, ...]) -> Channels:
    """Channels with the wheels' angles, which stand in for the velocities where there are as many."""
    told = tuple(name for name in own.outputs if name in velocities) if len(angles) >= len(velocities) else ()
    return own.with_positions(angles, unit, told)


@dataclass(frozen=True, repr=False, kw_only=True)
class Declared(Robot):
    """A robot's declarations, checked; see `Custom` for what each means."""

    declared: ClassVar[bool] = True
    dynamics: Callable[..., Mapping[str, Scalar]]
    state_names: Sequence[str]
    own_channels: Channels
    table: Mapping[str, Parameter] = field(hash=False, compare=False)
    output: Callable[..., Mapping[str, Scalar]] | None = None
    dry_friction: Mapping[str, tuple[str, str]] | tuple[tuple[str, str, str], ...] = ()
    start: Mapping[str, float] = field(default_factory=dict, hash=False, compare=False)
    title: str = "custom"
    axes: Mapping[str, DriveAxis] | tuple[tuple[str, DriveAxis], ...] = ()
    forces: Any = ()
    velocities: tuple[str, ...] = ()  # type: ignore[misc]
    turning: str = ""  # type: ignore[misc]
    plane: Any = None
    mass: str = ""
    motor_currents: Callable[..., Mapping[str, Scalar]] | None = None
    winding: str = ""  # type: ignore[misc]
    supply_voltage: str | float | None = None  # type: ignore[misc]
    mechanisms: Mapping[str, tuple[str, ...]] = field(default_factory=dict, hash=False)  # type: ignore[misc]
    words: Mapping[str, str] = field(default_factory=dict, hash=False, compare=False)  # type: ignore[misc]
    wheel_angles: bool = False  # type: ignore[misc]

    def __post_init__(self) -> None:
        states = (self.state_names,) if isinstance(self.state_names, str) else tuple(self.state_names)
        object.__setattr__(self, "state_names", states)
        for name, value in self.table.items():
            if not isinstance(value, Parameter):
                raise ParameterError(
                    f"table: {name!r} is a {type(value).__name__}; give a jaxid.Parameter({value!r}, unit)"
                )
        super().__post_init__()
        pairs = self.dry_friction
        if isinstance(pairs, Mapping):
            pairs = tuple((axis, speed, level) for axis, (speed, level) in pairs.items())
        axes = tuple(self.axes.items()) if isinstance(self.axes, Mapping) else tuple(self.axes)
        named = {axis for axis, _ in axes}
        axes = (*((axis, DriveAxis(speed, level)) for axis, speed, level in pairs if axis not in named), *axes)
        forces = tuple(self.forces.items()) if isinstance(self.forces, Mapping) else self.forces
        plane = tuple(self.plane) if isinstance(self.plane, tuple | list) else self.plane
        turning = self.turning or (plane[2] if isinstance(plane, tuple) else "")
        for name, value in (("dry_friction", pairs), ("axes", axes), ("forces", forces), ("plane", plane)):
            object.__setattr__(self, name, value)
        object.__setattr__(self, "velocities", tuple(self.velocities) or self._moved(axes, forces))
        object.__setattr__(self, "turning", turning if turning in self.velocities else "")
        self._check()

    @property
    def _axes(self) -> tuple[tuple[str, DriveAxis], ...]:
        """`axes` as they are kept, whichever way they were given."""
        assert isinstance(self.axes, tuple)
        return self.axes

    def _moved(self, axes, forces) -> tuple[str, ...]:
        """The velocities where the user names none."""
        speeds = dict.fromkeys(axis.speed for _, axis in axes if isinstance(axis.speed, str))
        outputs = (name for name in self.own_channels.outputs if name in self.state_names)
        named = () if callable(forces) else tuple(name for name, _ in forces)
        return named or tuple(speeds) or tuple(outputs)

    def _check(self) -> None:
        measured = (*self.own_channels.outputs, *self.own_channels.optional)
        if self.output is None and not set(measured) <= set(self.state_names):
            missing = ", ".join(sorted(set(measured) - set(self.state_names)))
            raise ParameterError(f"outputs {missing} are not states; {_INSTEAD}")
        for axis, own in self._axes:
            for level in (own.coulomb, own.viscous):
                if (isinstance(own.speed, str) and own.speed not in self.state_names) or level not in (
                    None,
                    *self.table,
                ):
                    raise ParameterError(
                        f"dry friction of axis {axis!r} names speed {own.speed!r} and level {level!r}; "
                        "the first must be a state and the second a parameter"
                    )
        named = (*self.velocities, *(() if callable(self.forces) else (name for name, _ in self.forces)))
        if isinstance(self.plane, tuple):
            named += tuple(name for name in self.plane if name)
        for name in named:
            if name not in self.state_names:
                raise ParameterError(f"velocity {name!r} is not a state; use one of {', '.join(self.state_names)}")
        inertias = () if callable(self.forces) else tuple(i for _, i in self.forces if isinstance(i, str))
        supply = (self.supply_voltage,) if isinstance(self.supply_voltage, str) else ()
        freed = tuple(name for names in self.mechanisms.values() for name in names)
        levers = tuple(own.lever for _, own in self._axes if isinstance(own.lever, str))
        for name in (*inertias, *supply, *freed, *levers, *(n for n in (self.mass, self.winding) if n)):
            if name not in self.table:
                raise ParameterError(f"{name!r} is not a parameter; use one of {', '.join(self.table)}")
        if self._axes and not takes_friction(self.dynamics) and not self.forces:
            raise ParameterError(
                f"friction of {', '.join(axis for axis, _ in self._axes)} has no way into the dynamics; let them take a "
                "fourth argument, the friction forces by axis name, or pass `forces=`"
            )
        angles = tuple(own.angle for _, own in self._axes if own.angle)
        for name in self.start:
            if name not in (*self.state_names, *angles, "x", "y", "theta"):
                raise ParameterError(f"start: {name!r} is no state; the states are {', '.join(self.state_names)}")
        rubbing = tuple(axis for axis, _ in self._axes)
        check_user_functions(
            UserFunctions(
                self.dynamics,
                self.output,
                self.own_states,
                self.own_channels.inputs,
                measured,
                tuple(self.table),
                rubbing if rubbing and takes_friction(self.dynamics) else None,
            )
        )
        _ = self._viscous_times  # raises where the dynamics have no such friction

    @property
    def _viscous_times(self) -> tuple[float, ...]:
        """How many times coefficient and speed the dynamics have as viscous friction of each axis."""
        functions = (self.dynamics, self.forces, self.axes)
        named = tuple((axis, own.viscous or "") for axis, own in self._axes)
        return viscous_times(ViscousFriction(functions, self.own_states, tuple(self.table), named, self))

    # -- what it says about itself -------------------------------------------------------------------------------------
    @property
    def channels(self) -> Channels:  # type: ignore[override]
        """The columns of its logs: `own_channels`, and the wheels' angles where these are measured."""
        angles = self.measured_angles
        return (
            _with_angles(self.own_channels, angles, self.angle_unit, self.velocities) if angles else self.own_channels
        )

    @property
    def measured_angles(self) -> tuple[str, ...]:
        own = self.own_channels.measured  # a robot that has its angles as outputs goes on as it says itself
        return tuple(name for name in super().measured_angles if name not in own)

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.title

    @property
    def own_states(self) -> tuple[str, ...]:
        return tuple(self.state_names)

    @property
    def dry(self) -> bool:
        """Whether any axis has dry friction of its own, which effects may change."""
        return any(axis.coulomb for _, axis in self._axes)

    @property
    def stages(self) -> frozenset[str]:  # type: ignore[override]
        driven = [axis for _, axis in self._axes if axis.driven]
        found = {"dry"} if self._axes else set()
        found |= {"viscous"} if any(axis.viscous for _, axis in self._axes) else set()
        found |= {"torque"} if driven and all(axis.torque is not None for axis in driven) else set()
        found |= {"force"} if self.velocities and (self.forces or self._through_friction) else set()
        found |= {"supply"} if self.motor_currents is not None else set()
        return frozenset(found)

    @property
    def _through_friction(self) -> bool:
        """Whether dynamics that take the axes' friction let a force on any of the velocities in that way, where `forces` says
        no other: friction is one."""
        rubbed = {axis.speed for _, axis in self._axes}
        return not self.forces and takes_friction(self.dynamics) and rubbed >= set(self.velocities)

    @property
    def drive_axes(self) -> tuple[int, ...]:  # type: ignore[override]
        return tuple(i for i, (_, axis) in enumerate(self._axes) if axis.driven)

    @property
    def axis_words(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(self._axes[i][0] for i in self.drive_axes)

    @property
    def angles(self) -> tuple[str, ...]:  # type: ignore[override]
        found = tuple(self._axes[i][1].angle for i in self.drive_axes)
        return tuple(name for name in found if name) if all(found) else ()

    @property
    def positions(self) -> Mapping[str, str]:  # type: ignore[override]
        """Velocity to the state whose derivative it is, as the dynamics show."""
        return dict(_positions(self.structure, tuple(self.parameters.numbers.items())))

    @property
    def in_plane(self) -> bool:  # type: ignore[override]
        return self.plane is not None

    @property
    def weighs(self) -> bool:
        return bool(self.mass and self.forces and self.plane is not None)

    def _unit_of(self, names: tuple[str | None, ...], usual: str) -> str:
        units = [self.table[name].unit for name in names if name]
        return units[0] if units else usual

    @property
    def friction_unit(self) -> str:  # type: ignore[override]
        return self._unit_of(tuple(self._axes[i][1].coulomb for i in self.drive_axes), "N")

    def force_unit(self, name: str) -> str:
        """As the user gives the dry friction that rubs at this velocity, or on the axis of this name, such as mN
        where speeds are in mm/s."""
        rubs = [(called, axis.speed, axis.coulomb) for called, axis in self._axes if axis.coulomb]
        own = [level for _, speed, level in rubs if speed == name] or [
            level for called, _, level in rubs if called == name
        ]
        if own:
            return self.table[own[0]].unit
        return self.friction_unit if name in dict(self._axes) else super().force_unit(name)

    @property
    def torque_unit(self) -> str:  # type: ignore[override]
        return self.friction_unit

    @property
    def _first(self) -> DriveAxis | None:
        """The first drive axis."""
        return self._axes[self.drive_axes[0]][1] if self.drive_axes else None

    @property
    def rim_unit(self) -> str:  # type: ignore[override]
        axis = self._first
        if axis is None or axis.lever != 1.0:
            return f"{self.length_unit}/s"  # a radius makes it one
        speed = self.velocity_unit(axis.speed) if isinstance(axis.speed, str) else ""
        return speed or self._usual_rate

    @property
    def _usual_rate(self) -> str:
        """Unit of a rubbing speed of which no channel says one."""
        turns = any(metres_of(word) for word in self.friction_unit.split())
        return "rad/s" if turns else f"{self.length_unit}/s"

    @property
    def length_unit(self) -> str:  # type: ignore[override]
        """As a speed in the plane is measured; else the length that force over mass accelerates by, such as mm of mN and kg.
        Not as wheels and encoders are read, which may be in another unit than the equations."""
        ways = self.plane[:2] if isinstance(self.plane, tuple) else self.velocities
        units = (self.own_channels.units.get(name, "").split("/")[0] for name in ways)
        said = next((unit for unit in units if metres_of(unit)), "")
        return said or accelerated(self.friction_unit, self._unit_of((self.mass,), ""))

    @property
    def angle_unit(self) -> str:  # type: ignore[override]
        axis = self._first
        measured = self.own_channels.units.get(axis.angle, "") if axis and axis.angle else ""
        if measured or axis is None or axis.lever != 1.0:
            return measured or "rad"
        # Of the channels without the angles, which are given their unit here.
        speed = self.own_channels.units.get(axis.speed, "") if isinstance(axis.speed, str) else ""
        return (speed or self._usual_rate).split("/")[0]

    @property
    def ground_force_unit(self) -> str:  # type: ignore[override]
        axis = self._first
        return "N" if axis is None or axis.lever != 1.0 else self.friction_unit

    def defaults(self) -> ParameterTable:
        return ParameterTable(self.table)

    def initial_state(self) -> dict[str, float]:
        return dict.fromkeys(self.states, 0.0) | dict(self.start)

    def per_unit_inertia(self) -> Self:
        """The robot with forces that are accelerations, for what needs no inertia. Needs `velocities`."""
        return self if self.forces else replace(self, forces=tuple((name, 1.0) for name in self.velocities))
