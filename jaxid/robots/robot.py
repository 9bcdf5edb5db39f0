"""The interface between robots and everything that simulates or identifies them.

A robot is a set of pure functions of state, input and parameters plus a table of parameters. States, inputs and
parameters are scalars by name, so that the same code runs on one number, on a batch of lanes, and under `jax.jvp`, and
compiles into a single fused loop.
"""

import html
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, ClassVar, Self

import jax

from ..logs import Channels
from ..logs.units import metres_of
from ..parameters import ParameterTable
from . import signal_path
from .effect import Effect, EffectError, Levels, Numbers, Scalar, Scalars, State, in_words
from .scales import Scales
from .traits import refusal, traits_of
from .wheel_angles import with_angles_of

_EMPTY = ParameterTable({})
ANGLES = ("rad", "mrad", "deg", "rev", "turn", "turns")
"""Units of angles."""
_OWN: Any = None
"""In place of what `__post_init__` then takes from the robot itself."""


@dataclass(frozen=True, repr=False)
class Robot:
    """Base of all robots.

    `parameters` is the table of physical parameters (None: the robot's defaults) and `effects` what was added to the
    robot's own physics. `robot + effect` adds one; `robot.with_values(Cs=0.3)` and `robot.with_parameters(table)` change
    the numbers.

    A subclass gives `channels`, `own_states`, `defaults()`, `observe()` and the physics of the signal path's stages:
    `motor()` and `gear()` where they do anything, `motion()`, and where something rubs `rubbing()`, `own_coulomb()` and
    `own_viscous()`. `rates()` and `coulomb()`, in which effects act, follow from these and are not written again. What a
    robot says about itself beyond that are traits: whoever lacks one does without the effects that need it.
    """

    parameters: ParameterTable = field(default=_OWN)
    effects: tuple[Effect, ...] = ()
    scales: Scales = field(default=_OWN, compare=False, repr=False, kw_only=True)
    """Orders of magnitude of what it does (None: nominal ones): first guesses of effects are shares of them."""
    longest_step: float = field(default=math.inf, compare=False, repr=False, kw_only=True)
    """Integration step [s] that a fit found necessary for these numbers, where that is shorter than `max_step`."""

    name: ClassVar[str] = "robot"
    channels: ClassVar[Channels]
    combinations: ClassVar[dict[str, Any]] = {}
    """Functions of the parameters (name -> (function of numbers, unit, meaning)) that data determine when single
    parameters are not."""

    # -- traits: what the robot says about itself --------------------------------------------------------------------
    stages: ClassVar[frozenset[str]] = frozenset(signal_path.STAGES)
    """Stages of the signal path at which effects can act."""
    velocities: ClassVar[tuple[str, ...]] = ()
    """States to which the generalised forces belong, in their order; the first is the one forwards."""
    turning: ClassVar[str] = ""
    """The velocity that is the yaw rate to the left."""
    scrubs: ClassVar[bool] = False
    """Whether wheels slip sideways when it turns."""
    positions: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Velocity -> the state whose derivative it is."""
    ambiguous: ClassVar[tuple[str, ...]] = ()
    """Angles [rad] that are states of no sensor, and whose start the outputs tell in many ways: a search has minima."""
    along_line: ClassVar[bool] = False
    """Whether its only velocity moves it along a line."""
    in_plane: ClassVar[bool] = False
    """Whether `planar()` says how it moves in the plane, so that x, y, theta can be integrated."""
    drive_axes: ClassVar[tuple[int, ...]] = ()
    """Rubbing axes that belong to the drivetrain."""
    axis_words: ClassVar[tuple[str, ...]] = ()
    """Names of the drive axes where each is told apart in words; empty where they are alike."""
    friction_unit: ClassVar[str] = "N"
    """Unit of the friction of a drive axis."""
    torque_unit: ClassVar[str] = "N m"
    """Unit of a drive torque."""
    rim_unit: ClassVar[str] = "m/s"
    """Unit of the speed of a drive axis at the rim."""
    length_unit: ClassVar[str] = "m"
    """Unit of lengths, of x and y and in speeds."""
    angle_unit: ClassVar[str] = "rad"
    """Unit of `angles`."""
    ground_force_unit: ClassVar[str] = "N"
    """Unit of `drive_forces`."""
    angles: ClassVar[tuple[str, ...]] = ()
    """States that are the angles of the driving wheels, one per drive torque, integrated where an effect needs them."""
    pose: ClassVar[bool] = False
    """Whether x, y, theta are integrated even where no effect needs them."""
    wheel_angles: ClassVar[bool] = False
    """Whether `angles` are integrated even where no effect needs them, and may be measured (counts of encoders)."""
    winding: ClassVar[str] = ""
    """The parameter that is the resistance of each motor's winding."""
    supply_voltage: ClassVar[str | float | None] = None
    """The supply's voltage [V], or the parameter that is it."""
    mechanisms: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType({})
    """Effect id -> the robot's own parameters that are this mechanism, which the effect frees (of a payload: those that it
    changes, the mass first)."""
    parts: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Parameters that are parts of another, which may be none of it: part -> whole."""
    wheel_radius: ClassVar[str] = ""
    """The parameter that is the radius which `wheel_radius_mismatch` makes larger on the first of `wheel_sides` and smaller on
    the second."""
    wheel_inertia: ClassVar[str] = ""
    """The parameter that is the inertia of each wheel with all that turns with it, the motor's rotor by the gear squared."""
    wheel_sides: ClassVar[tuple[str, str]] = ("right wheel", "left wheel")
    wheel_radii: ClassVar[tuple[str, ...]] = ()
    """Parameters by which fraction each wheel's radius is another than `wheel_radius`, of a robot of three wheels or more."""
    declared: ClassVar[bool] = False
    """Whether a user declares what effects may act on, so that what it lacks may only be unsaid."""
    expressed: ClassVar[frozenset[str]] = frozenset()
    """Ids of effects that the robot's own parameters already are, by another name."""
    words: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Channel -> what it measures, in words, for sentences."""
    driving_modes: ClassVar[Mapping[str, tuple[float, ...]]] = MappingProxyType({})
    """Directions of driving by name ("straight"), one gain per input; empty: each input on its own."""
    nominal: ClassVar[Scales] = Scales()
    """Orders of magnitude where no log says them."""
    prior_spreads: ClassVar[Mapping[str, float]] = MappingProxyType({})
    """Prior standard deviations of initial states that no sensor shows, such as a caster's angle [rad], about their usual
    value, by state."""
    steps_per_time_constant: ClassVar[float] = 13.0
    """Integration steps in the shortest time constant for which the integrator's error stays below usual sensor noise."""
    controlled: ClassVar[bool] = False
    """Whether a controller drives it, which answers what the model lacks before it shows; `alone` is the plant then."""
    max_step: ClassVar[float | None] = None
    """Longest integration step in the logs' unit of time, where the robot's time constants do not say it."""

    def __post_init__(self) -> None:
        if self.parameters is None:
            object.__setattr__(self, "parameters", self.defaults())
        if self.scales is None:
            object.__setattr__(self, "scales", self.nominal)

    def _sentence(self) -> str:
        """Inputs, outputs and effects."""
        units = self.channels.units

        def listed(names: Iterable[str]) -> str:
            return ", ".join(f"{name} [{units[name]}]" if units.get(name) else name for name in names)

        text = f"{self.name}: inputs {listed(self.channels.inputs)}; outputs {listed(self.channels.outputs)}"
        added = ", ".join(in_words(effect.id) for effect in self.effects)
        return f"{text}; with {added}" if added else text

    def __repr__(self) -> str:
        return f"{self._sentence()}\n{self.parameters!r}"

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(self._sentence())}</p>{self.parameters._repr_html_()}"

    @property
    def traits(self) -> frozenset[str]:
        """The traits that the robot has, by the names of `traits.TRAITS`."""
        return traits_of(self)

    def for_columns(self, columns: Iterable[str]) -> Self:
        """The robot that measures what logs with these columns hold: its wheels' angles, where these stand for speeds."""
        return with_angles_of(self, columns)

    @property
    def measured_angles(self) -> tuple[str, ...]:
        """Those of `angles` that logs may hold beside or in the place of speeds. Each log has its own zero of them."""
        return self.angles if self.wheel_angles else ()

    @property
    def alone(self) -> "Robot":
        """The robot without the controller that drives it, where it is `controlled`."""
        return self

    @property
    def translations(self) -> tuple[str, ...]:
        """The velocities that are not the yaw rate."""
        return tuple(name for name in self.velocities if name != self.turning)

    @property
    def translates(self) -> bool:
        """Whether it says how it moves along, so that what resists that can act on it."""
        return bool(self.translations)

    def along(self, state: State, p: Numbers) -> Scalars:
        """The speeds of a robot that `translates`."""
        return tuple(state[name] for name in self.translations)

    def pushed(self, forces: Scalars, each: Scalars, p: Numbers) -> Scalars:
        """The generalised forces on its `velocities` with one along each of these speeds added."""
        added = dict(zip(self.translations, each, strict=True))
        return tuple(f + added[n] if n in added else f for n, f in zip(self.velocities, forces, strict=True))

    def showing(self, names: tuple[str, ...]) -> "Robot | None":
        """The robot without effects that measures these states of its own, and nothing else; None where it cannot."""
        return None

    def with_larger_wheels(self, numbers: Mapping[str, float], share: float) -> dict[str, float]:
        """What differs from the `numbers` of its parameters where all driving wheels are larger by a share; nothing where that
        is not known."""
        if self.wheel_radius not in self.parameters:
            return {}
        return {self.wheel_radius: numbers[self.wheel_radius] * (1.0 + share)}

    @property
    def turns(self) -> bool:
        """Whether it says what its yaw rate is, so that a moment can act on it."""
        return self.turning in self.velocities

    @property
    def largest_yaw_rate(self) -> float:
        """About the largest yaw rate of its logs."""
        return self.scales.output(self.turning)

    @property
    def farthest_yaw_rate(self) -> float:
        """How far a curve over the yaw rate has to reach."""
        return self.scales.reach(self.turning)

    def yaw_rate(self, state: State, p: Numbers) -> Scalar:
        """The yaw rate of a robot that `turns`."""
        return state[self.turning]

    def turned(self, forces: Scalars, moment: Scalar, p: Numbers) -> Scalars:
        """The generalised forces on its `velocities` with a moment on the yaw rate added."""
        return tuple(f + moment if name == self.turning else f for name, f in zip(self.velocities, forces, strict=True))

    def velocity_unit(self, name: str) -> str:
        """Unit of a velocity: its channel's, or by that of the measured position which it changes; empty where neither says."""
        units = self.channels.units
        place = units.get(self.positions.get(name, ""), "")
        return units.get(name, "") or (f"{place}/s" if place else "")

    def force_unit(self, name: str) -> str:
        """Unit of the generalised force on a velocity: a torque where it is angular, as the yaw rate is."""
        unit = self.velocity_unit(name)
        angular = unit.split("/")[0] in ANGLES or (not unit and name == self.turning)
        return "N m" if angular else "N"

    @property
    def metre(self) -> float:
        """A metre in the robot's unit of length, in which accelerations are, too."""
        return 1.0 / (metres_of(self.length_unit) or 1.0)

    @property
    def drive_inputs(self) -> tuple[int, ...]:
        """Places of the inputs that drive: those in the unit of the first."""
        units = [self.channels.units.get(name, "") for name in self.channels.inputs]
        return tuple(i for i, unit in enumerate(units) if unit == units[0])

    @property
    def motors_behind(self) -> tuple[int, ...]:
        """How many motors each input drives, each with the current and the winding that `motor` and `winding` say."""
        return (1,) * len(self.channels.inputs)

    @property
    def said_of_commands(self) -> str:
        """A sentence on what the robot takes its commands for, where their columns may hold something else; mostly empty."""
        return ""

    @property
    def weighs(self) -> bool:
        """Whether `field_force` says how weight pulls at it in the plane."""
        return type(self).field_force is not Robot.field_force

    # -- states ------------------------------------------------------------------------------------------------------
    @property
    def own_states(self) -> tuple[str, ...]:
        """Names of the states of the robot's own physics."""
        raise NotImplementedError

    @property
    def added_states(self) -> tuple[str, ...]:
        """Pose and wheel angles, where wanted and no states of the robot's own already."""
        wanted = signal_path.POSE_STATES if self.in_plane and (self.pose or self.needs("pose")) else ()
        wanted += self.angles if self.wheel_angles or self.needs("wheel_angles") else ()
        own = self.own_states
        return tuple(name for name in wanted if name not in own)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of all states that are integrated."""
        return (*self.own_states, *self.added_states, *self.extra_states)

    @property
    def estimated_states(self) -> tuple[str, ...]:
        """Names of the states whose initial values can be estimated from the outputs."""
        return tuple(dict.fromkeys((*self.own_states, *self.measured_angles)))

    def defaults(self) -> ParameterTable:
        """The table of parameters with their published or assumed values."""
        raise NotImplementedError

    def initial_state(self) -> dict[str, float]:
        """The state at the start of a log that does not say otherwise: at rest at the origin."""
        return dict.fromkeys(self.states, 0.0)

    # -- the physics, one method a stage -----------------------------------------------------------------------------
    def driver(self, volts: Scalars, state: State, p: Numbers) -> Scalars:
        """What the motors' driver makes of commanded voltages, such as limiting them."""
        return volts

    def motor(self, volts: Scalars, state: State, p: Numbers) -> Scalars:
        """Motor currents [A] at these voltages, of each input that of one of its motors; for a robot without motors the inputs
        themselves."""
        return volts

    def gear(self, currents: Scalars, volts: Scalars, state: State, p: Numbers) -> Scalars:
        """Drive torques at the wheels (forces of a linear axis) of the motors' currents."""
        return currents

    def rubbing(self, state: State, p: Numbers) -> Scalars:
        """Speeds at which dry friction acts, one per rubbing axis."""
        return ()

    def own_coulomb(self, state: State, p: Numbers) -> Levels:
        """(backward, forward) Coulomb levels of the rubbing axes, both positive."""
        return tuple((0.0, 0.0) for _ in self.rubbing(state, p))

    def own_viscous(self, speeds: Scalars, state: State, p: Numbers) -> Scalars:
        """Viscous resistance of the rubbing axes."""
        return tuple(0.0 for _ in speeds)

    def own_forces(self, state: State, p: Numbers) -> Scalars:
        """Generalised forces of the robot's own, one per velocity."""
        return (0.0,) * len(self.velocities)

    def motion(
        self, state: State, volts: Scalars, torques: Scalars, resisting: Scalars, forces: Scalars, p: Numbers
    ) -> State:
        """Rates of the robot's own states.

        `volts` as they reach the motors, drive `torques`, `resisting` torques of the rubbing axes (viscous and dry),
        generalised `forces`.
        """
        raise NotImplementedError

    def planar(self, state: State, p: Numbers) -> tuple[Scalar, Scalar, Scalar]:
        """(speed along x, speed along y, yaw rate) in body axes that are the world's at heading zero."""
        raise NotImplementedError

    def angle_rates(self, state: State, p: Numbers) -> Scalars:
        """Rates of `angles`."""
        raise NotImplementedError

    def observe(self, state: State, inputs: Scalars, p: Numbers) -> Scalars:
        """Outputs in the order of the channels (measured ones first, then optional ones)."""
        raise NotImplementedError

    # -- what follows from the stages and the effects ----------------------------------------------------------------
    def coulomb(self, state: State, p: Numbers) -> Levels:
        """(backward, forward) Coulomb levels of the rubbing axes, effects included."""
        return signal_path.coulomb(self, state, p)

    def currents(self, state: State, inputs: Scalars, p: Numbers) -> Scalars:
        """Motor currents [A] at the commanded inputs, effects on the supply included."""
        return signal_path.powered(self, inputs, state, p)[1]

    def rates(self, state: State, inputs: Scalars, dry: Scalars, p: Numbers) -> State:
        """Time derivative of every state under the given inputs and dry-friction torques (positive resists positive speed)."""
        return signal_path.rates(self, state, inputs, dry, p)

    def drive_torques(self, inputs: Scalars, state: State, p: Numbers) -> Scalars:
        """Drive torques at these inputs, effects apart."""
        volts = self.driver(inputs, state, p)
        return self.gear(self.motor(volts, state, p), volts, state, p) if "torque" in self.traits else ()

    def compliance(self, state: State, p: Numbers) -> tuple[Scalars, ...]:
        """The Delassus matrix: -d(rubbing acceleration i) / d(dry-friction torque j), positive semidefinite. `p` are the
        parameters as they are in this state."""
        no_input = (0.0,) * len(self.channels.inputs)

        def speeds_after(dry: Scalars) -> Scalars:
            if type(self).rates is not Robot.rates:  # a robot that states its rates itself
                return self.rubbing_rates(state, self.rates(state, no_input, dry, p), p)
            rates = signal_path.rates_with(self, state, no_input, dry, p)
            return self.rubbing_rates(state, rates, p)

        axes = len(self.rubbing(state, p))
        zero = (0.0,) * axes
        columns = []
        for j in range(axes):
            unit = tuple(1.0 if i == j else 0.0 for i in range(axes))
            columns.append(jax.jvp(speeds_after, (zero,), (unit,))[1])
        return tuple(tuple(-columns[j][i] for j in range(axes)) for i in range(axes))

    def rubbing_rates(self, state: State, rates: State, p: Numbers) -> Scalars:
        """Time derivative of the rubbing speeds along `rates` of the velocities."""
        return jax.jvp(lambda s: self.rubbing(s, p), (state,), (rates,))[1]

    def rim_levers(self, p: Numbers) -> Scalars:
        """What each rubbing speed is multiplied with to be one at the wheels' rims [m/s], where axes compare."""
        return (1.0,) * len(self.rubbing(dict.fromkeys(self.states, 0.0), p))

    def rim_speeds(self, speeds: Scalars, p: Numbers) -> Scalars:
        """Rubbing speeds [m/s] at the wheels' rims, where friction laws of different axes can be compared."""
        return tuple(s if _one(lever) else lever * s for lever, s in zip(self.rim_levers(p), speeds, strict=True))

    def drive_forces(self, torques: Scalars, p: Numbers) -> Scalars:
        """Forces at the ground [N] of the drive torques as the `torque` stage passes them."""
        return torques

    def axis_drives(self, torques: Scalars, p: Numbers) -> Scalars:
        """What drives each rubbing axis, of drive `torques`, where these axes are not the motors' own; else nothing."""
        return ()

    def field_force(self, field: tuple[Scalar, Scalar], state: State, p: Numbers) -> Scalars:
        """Generalised forces of an acceleration field [m/s²] along the world's (x, y) that pulls at every body's mass."""
        return (0.0,) * len(self.velocities)

    def effective_inputs(self, state: State, inputs: Scalars, h: Scalar, p: Numbers) -> Scalars:
        """Inputs to hold over a step of `h` seconds; robots with stiff electrical states put their mean effect in here."""
        return inputs

    def settle(self, before: State, after: State, inputs: Scalars, h: Scalar, p: Numbers) -> State:
        """The state after a step, with stiff states advanced exactly."""
        return after

    def per_unit_inertia(self) -> "Robot":
        """The robot with accelerations in the place of forces, where it does not say what a force accelerates."""
        return self

    # -- building models -------------------------------------------------------------------------------------------
    def __add__(self, effect: Effect) -> Self:
        """The robot with one more effect. Raises `EffectError` where it cannot have it, saying why."""
        if not isinstance(effect, Effect):
            raise EffectError(
                f"{effect!r:.60} is no effect; add one of jaxid.catalogue(robot), or an Effect of your own"
            )
        why = refusal(effect, self)
        if why is not None:
            raise EffectError(why)
        clash = signal_path.names_clash(self, effect)
        if clash is not None and not any(type(own) is type(effect) for own in self.effects):
            raise EffectError(
                f"the effect {effect.id!r} brings a state {clash!r}, which the robot {self.name!r} already has; name it "
                "otherwise"
            )
        known = dict(self.parameters)
        added = {k: v for k, v in effect.parameters(self).items() if k not in known}
        freed = {name: replace(known[name], free=True) for name in effect.frees(self)}
        return replace(self, parameters=self.parameters.merge(added | freed), effects=(*self.effects, effect))

    def with_parameters(self, table: ParameterTable) -> Self:
        """The same robot with another table of parameters."""
        return replace(self, parameters=table)

    def with_values(self, **values: float) -> Self:
        """The same robot with other numbers, for example `Pioneer().with_values(M=16.0, Cs=0.3)`."""
        return replace(self, parameters=self.parameters.with_values(values))

    def change(self, parameter: str, **fields: Any) -> Self:
        """The same robot with fields of one parameter changed, for example `change("M", free=True)`."""
        return replace(self, parameters=self.parameters.change(parameter, **fields))

    @property
    def structure(self) -> Self:
        """The robot without its numbers: what a compiled program depends on."""
        return replace(self, parameters=_EMPTY)

    def needs(self, trait: str) -> bool:
        """Whether any effect asks for the named trait, such as "pose"."""
        return any(trait in effect.needs for effect in self.effects)

    @property
    def extra_states(self) -> tuple[str, ...]:
        """States that effects brought along."""
        return tuple(dict.fromkeys(name for effect in self.effects for name in effect.states_on(self)))


def _one(lever: Scalar) -> bool:
    return isinstance(lever, float) and bool(lever == 1.0)


__all__ = ["Effect", "EffectError", "Robot", "Scalar", "State"]
