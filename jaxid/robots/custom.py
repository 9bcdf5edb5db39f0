"""A user's own robot: any pure `dynamics(state, input, params)` with a table of parameters.

What the dynamics keep to themselves no effect can reach. So a user declares, beside the dynamics, what effects should act
on: `axes` (where something rubs or drives), `forces` (what a generalised force accelerates), `motor_currents`, `plane` (how
it moves in the plane). A declaration never changes the robot without effects.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from inspect import Parameter as Argument
from inspect import signature
from typing import Any

import jax
import numpy as np

from ..logs import Channels
from ..parameters import Parameter, ParameterError, ParameterTable
from .drive_axis import DriveAxis
from .effect import Levels, Numbers, Scalar, Scalars, State
from .robot import Robot
from .signal_path import overrides
from .trigonometry import sincos
from .user_functions import UserFunctions, check_user_functions

_INSTEAD = "pass `output=` to say how they follow from the state"


@cache
def _takes_friction(dynamics: Callable[..., Any]) -> bool:
    kinds = (Argument.POSITIONAL_ONLY, Argument.POSITIONAL_OR_KEYWORD)
    arguments = signature(dynamics).parameters.values()
    some = any(a.kind == Argument.VAR_POSITIONAL for a in arguments)
    return some or sum(a.kind in kinds and a.default is Argument.empty for a in arguments) >= 4


@cache
def _positions(robot: "Custom", numbers: tuple[tuple[str, float], ...]) -> tuple[tuple[str, str], ...]:
    """(velocity, the state whose derivative it is), as the dynamics show at three states without symmetry."""
    names, inputs, p = robot.state_names, robot.own_channels.inputs, dict(numbers)
    friction = ({axis: 0.0 for axis, _ in robot._axes},) if robot._axes and _takes_friction(robot.dynamics) else ()
    found = {(v, s) for v in robot.velocities for s in names if s != v}
    for probe in np.random.default_rng(1).uniform(0.1, 1.0, (3, len(names) + len(inputs))):
        state = dict(zip(names, probe.tolist(), strict=False))
        given = dict(zip(inputs, probe[len(names) :].tolist(), strict=True))
        rates = robot.dynamics(state, given, p, *friction)
        found = {(v, s) for v, s in found if np.allclose(float(np.asarray(rates[s])), state[v], rtol=1e-6, atol=0.0)}
    return tuple(sorted(found))


@dataclass(frozen=True, kw_only=True)
class Custom(Robot):
    """A robot described by the user's own pure functions of scalars by name.

    - `dynamics(state, input, params) -> {state name: time derivative}`, with `input` by channel name. With axes that rub
      it may take a fourth argument, the friction forces by axis name, positive when they resist positive speed; else these
      act through `forces`.
    - `output(state, input, params) -> {channel: value}`; by default the states named like the output channels.
    - `dry_friction = {axis: (state that is the rubbing speed, parameter that is the Coulomb level)}` makes those axes
      truly stick: short for `axes`.

    What effects need beyond that, each where the robot has it:

    - `axes = {axis: DriveAxis(...)}`.
    - `forces = {velocity: inertia}`, an inertia being a parameter's name, a number or a function `(state, params)`: a
      generalised force on that velocity accelerates it by force over inertia. Or one function
      `(state, forces by velocity, params) -> {velocity: acceleration}` where velocities are coupled.
    - `velocities`: the states that forces accelerate, the one forwards first (default: those of `forces`, else the axes'
      speeds, else the outputs that are states); `turning`: the one that is the yaw rate to the left.
    - `plane = (speed along x, speed along y, yaw rate)` in body axes that are the world's at heading zero, states or ""
      for none; or a function `(state, params)` of the three. `mass`: the parameter that gravity pulls at.
    - `motor_currents(state, input, params) -> {input: current}`, `winding` (parameter: a motor's resistance) and
      `supply_voltage` (number or parameter).
    - `mechanisms = {effect id: parameters}`, such as `{"lateral_com_offset": ("yc",)}`, and `words = {channel: words}`.

    Raises `ParameterError` if outputs, axes or parameters do not fit together, or if `dynamics` and `output`, which are tried
    once on symbols, ask for what does not exist, do not return what they must, or cannot be traced by JAX.
    """

    dynamics: Callable[..., Mapping[str, Scalar]]
    state_names: tuple[str, ...]
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
        for name in (*inertias, *supply, *freed, *(n for n in (self.mass, self.winding) if n)):
            if name not in self.table:
                raise ParameterError(f"{name!r} is not a parameter; use one of {', '.join(self.table)}")
        if self._axes and not _takes_friction(self.dynamics) and not self.forces:
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
                self.state_names,
                self.own_channels.inputs,
                measured,
                tuple(self.table),
                rubbing if rubbing and _takes_friction(self.dynamics) else None,
            )
        )

    # -- what it says about itself -------------------------------------------------------------------------------------
    @property
    def channels(self) -> Channels:  # type: ignore[override]
        """The columns of its logs: `own_channels`."""
        return self.own_channels

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.title

    @property
    def own_states(self) -> tuple[str, ...]:
        return self.state_names

    @property
    def stages(self) -> frozenset[str]:  # type: ignore[override]
        driven = [axis for _, axis in self._axes if axis.driven]
        found = {"dry"} if self._axes else set()
        found |= {"viscous"} if any(axis.viscous for _, axis in self._axes) else set()
        found |= {"torque"} if driven and all(axis.torque is not None for axis in driven) else set()
        found |= {"force"} if self.forces and self.velocities else set()
        found |= {"supply"} if self.motor_currents is not None else set()
        return frozenset(found)

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
        return bool(self.mass and self.forces and isinstance(self.plane, tuple))

    def _unit_of(self, names: tuple[str | None, ...], usual: str) -> str:
        units = [self.table[name].unit for name in names if name]
        return units[0] if units else usual

    @property
    def friction_unit(self) -> str:  # type: ignore[override]
        return self._unit_of(tuple(self._axes[i][1].coulomb for i in self.drive_axes), "N")

    @property
    def torque_unit(self) -> str:  # type: ignore[override]
        return self.friction_unit

    # -- numbers -------------------------------------------------------------------------------------------------------
    def defaults(self) -> ParameterTable:
        return ParameterTable(self.table)

    def initial_state(self) -> dict[str, float]:
        return dict.fromkeys(self.states, 0.0) | dict(self.start)

    def per_unit_inertia(self) -> "Custom":
        """The robot with forces that are accelerations, for what needs no inertia. Needs `velocities`."""
        return self if self.forces else replace(self, forces=tuple((name, 1.0) for name in self.velocities))

    # -- the stages ----------------------------------------------------------------------------------------------------
    def _acts(self, stage: str) -> bool:
        return any(overrides(type(effect), stage) for effect in self.effects)

    def _inputs(self, volts: Scalars) -> State:
        return dict(zip(self.own_channels.inputs, volts, strict=True))

    def _own(self, state: State) -> State:
        return {name: state[name] for name in self.state_names}

    def motor(self, volts: Scalars, state: State, p: Numbers) -> Scalars:
        if self.motor_currents is None:
            return volts
        found = self.motor_currents(self._own(state), self._inputs(volts), p)
        return tuple(found.get(name, 0.0) for name in self.own_channels.inputs)

    def gear(self, currents: Scalars, volts: Scalars, state: State, p: Numbers) -> Scalars:
        """The drive torques as the user gives them; what effects change of them is all that `motion` uses."""
        return self.drive_torques(volts, state, p) if self._acts("torque") else ()

    def drive_torques(self, inputs: Scalars, state: State, p: Numbers) -> Scalars:
        volts = inputs
        if "torque" not in self.stages:
            return ()
        given, own = self._inputs(volts), self._own(state)
        found = (self._axes[i][1].torque for i in self.drive_axes)
        return tuple(torque(own, given, p) for torque in found if torque is not None)

    def rubbing(self, state: State, p: Numbers) -> Scalars:
        return tuple(state[a.speed] if isinstance(a.speed, str) else a.speed(state, p) for _, a in self._axes)

    def own_coulomb(self, state: State, p: Numbers) -> Levels:
        return tuple((p[a.coulomb], p[a.coulomb]) if a.coulomb else (0.0, 0.0) for _, a in self._axes)

    def own_viscous(self, speeds: Scalars, state: State, p: Numbers) -> Scalars:
        """Viscous resistance as the user names it; what effects change of it is all that `motion` uses."""
        if not self._acts("viscous"):
            return (0.0,) * len(speeds)
        return tuple(p[a.viscous] * s if a.viscous else 0.0 * s for (_, a), s in zip(self._axes, speeds, strict=True))

    def rubbing_rates(self, state: State, rates: State, p: Numbers) -> Scalars:
        if all(isinstance(axis.speed, str) for _, axis in self._axes):
            return tuple(rates[axis.speed] for _, axis in self._axes if isinstance(axis.speed, str))
        return super().rubbing_rates(state, rates, p)

    def rim_levers(self, p: Numbers) -> Scalars:
        return tuple(p[axis.lever] if isinstance(axis.lever, str) else float(axis.lever) for _, axis in self._axes)

    def drive_forces(self, torques: Scalars, p: Numbers) -> Scalars:
        levers = self.rim_levers(p)
        return tuple(torque / levers[i] for torque, i in zip(torques, self.drive_axes, strict=True))

    def motion(
        self, state: State, volts: Scalars, torques: Scalars, resisting: Scalars, forces: Scalars, p: Numbers
    ) -> State:
        friction = list(resisting)
        if self._acts("viscous"):  # the dynamics have the axes' own viscous friction
            own = self.own_viscous(self.rubbing(state, p), state, p)
            friction = [r - o for r, o in zip(friction, own, strict=True)]
        for i, changed, own in zip(self.drive_axes, torques, self.gear((), volts, state, p), strict=False):
            friction[i] = friction[i] - (changed - own)
        own_state, given = self._own(state), self._inputs(volts)
        if self._axes and _takes_friction(self.dynamics):
            rates = dict(
                self.dynamics(own_state, given, p, dict(zip([a for a, _ in self._axes], friction, strict=True)))
            )
            pushed = self._acts("force")
        else:
            rates = dict(self.dynamics(own_state, given, p))
            forces = self._with_friction(forces, friction, state, p)
            pushed = self._acts("force") or bool(friction)
        if pushed:
            for name, acceleration in self._accelerations(forces, own_state, p).items():
                rates[name] = rates[name] + acceleration
        return rates

    def _with_friction(self, forces: Scalars, friction: list[Scalar], state: State, p: Numbers) -> Scalars:
        """Generalised forces with the resisting torques of the axes, each by its lever on the velocities."""
        changed = list(forces)
        for (_, axis), resisting in zip(self._axes, friction, strict=True):
            for k, name in enumerate(self.velocities):
                if isinstance(axis.speed, str):
                    changed[k] = changed[k] - resisting if axis.speed == name else changed[k]
                else:
                    speed = axis.speed
                    along = {n: 1.0 if n == name else 0.0 for n in state}
                    primal = {n: 1.0 * v for n, v in state.items()}
                    tangent = {n: along[n] + 0.0 * v for n, v in primal.items()}
                    lever = jax.jvp(lambda s, speed=speed: speed(s, p), (primal,), (tangent,))[1]
                    changed[k] = changed[k] - lever * resisting
        return tuple(changed)

    def _accelerations(self, forces: Scalars, state: State, p: Numbers) -> State:
        by_name = dict(zip(self.velocities, forces, strict=True))
        found: State = {}
        if callable(self.forces):
            coupled: Any = self.forces
            found.update(coupled(state, by_name, p))
            return found
        for name, inertia in self.forces:
            of = p[inertia] if isinstance(inertia, str) else inertia(state, p) if callable(inertia) else inertia
            found[name] = by_name[name] / of
        return found

    def planar(self, state: State, p: Numbers) -> tuple[Scalar, Scalar, Scalar]:
        if callable(self.plane):
            moving: Any = self.plane
            return moving(state, p)
        along, left, turning = (state[name] if name else 0.0 for name in self.plane)
        return along, left, turning

    def angle_rates(self, state: State, p: Numbers) -> Scalars:
        speeds = self.rubbing(state, p)
        return tuple(speeds[i] for i in self.drive_axes)

    def field_force(self, field: tuple[Scalar, Scalar], state: State, p: Numbers) -> Scalars:
        sine, cosine = sincos(state["theta"])
        along = p[self.mass] * (cosine * field[0] + sine * field[1])
        left = p[self.mass] * (cosine * field[1] - sine * field[0])
        by_name = dict(zip(self.plane[:2], (along, left), strict=True))
        return tuple(by_name.get(name, 0.0) for name in self.velocities)

    def observe(self, state: State, inputs: Scalars, p: Numbers) -> Scalars:
        measured = (*self.own_channels.outputs, *self.own_channels.optional)
        if self.output is None:
            return tuple(state[name] for name in measured)
        outputs = self.output(state, self._inputs(inputs), p)
        return tuple(outputs[name] for name in measured)
