"""A robot with its controller: the reference goes in, the measured motion and the controller's commands come out.

What a free simulation of the plant cannot follow, because it integrates or is unstable, the closed loop can: there nothing
drifts. And its input, the reference, knows nothing of noise and disturbances, which the commands do (direct
identification from them is biased: Van den Hof, Annual Reviews in Control 22, 1998).

The controller is a digital one: it reads the outputs at a sample and holds its commands to the next.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import jax.numpy as jnp
import numpy as np

from ..logs import Channels, Log, LogError, LogSet
from ..parameters import Parameter, ParameterError, ParameterTable
from .effect import Effect, Levels, Numbers, Scalar, Scalars, State
from .robot import Robot
from .traits import IN_NO_LOOP, on_whole_signals

SAMPLE = "sample"
"""Input channel with the number of the sample: the controller runs once where it changes."""
_LAST = "last sample"

Law = Callable[[Mapping[str, Scalar], Mapping[str, Scalar], Mapping[str, Scalar], Numbers], Any]


@dataclass(frozen=True)
class Controller:
    """A control law at the sampling rate.

    - `law(reference, measured, state, params) -> {input: command}`, or with states of its own `({input: command},
      {state: value for the next sample})`: pure functions of scalars by name. `measured` are the robot's output channels,
      `params` its parameters and the controller's.
    - `reference`: the log's columns that are the law's reference, in its unit.
    - `states`: names of the controller's states (an integral, the last measurement), and `start`: their first values,
      zero by default.
    - `parameters`: gains by symbol; free ones are estimated.
    - `fitted`: whether the logged commands are outputs to be followed beside the motion; False where what was logged is not
      to the last digit what the law commanded.
    """

    law: Law
    reference: tuple[str, ...]
    states: tuple[str, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict, hash=False, compare=False)
    parameters: Mapping[str, Parameter] = field(default_factory=dict, hash=False, compare=False)
    fitted: bool = True


class _Commands(tuple[Scalar, ...]):
    """Inputs of the plant, not of the loop."""


def _held(name: str) -> str:
    return f"held {name}"


@dataclass(frozen=True, repr=False, kw_only=True)
class ClosedLoop(Robot):
    """`plant` with `controller`; `closed_loop` makes one, with its logs. Effects are the plant's."""

    plant: Robot
    controller: Controller

    controlled: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.plant.effects != self.effects:  # of a loop that was copied with others
            object.__setattr__(self, "plant", replace(self.plant, effects=self.effects))

    @property
    def channels(self) -> Channels:  # type: ignore[override]
        own = self.plant.channels
        inputs = (*self.controller.reference, SAMPLE)
        outputs = (*own.outputs, *own.inputs) if self.controller.fitted else own.outputs
        return Channels(inputs, outputs, own.optional, own.units, substitutes=own.substitutes)

    @property
    def name(self) -> str:  # type: ignore[override]
        return f"{self.plant.name} in closed loop"

    @property
    def max_step(self) -> float | None:  # type: ignore[override]
        return self.plant.max_step

    @property
    def steps_per_time_constant(self) -> float:  # type: ignore[override]
        return self.plant.steps_per_time_constant

    @property
    def combinations(self) -> dict[str, Any]:  # type: ignore[override]
        return self.plant.combinations

    @property
    def prior_spreads(self) -> Mapping[str, float]:  # type: ignore[override]
        return self.plant.prior_spreads

    @property
    def ambiguous(self) -> tuple[str, ...]:  # type: ignore[override]
        return self.plant.ambiguous

    @property
    def words(self) -> Mapping[str, str]:  # type: ignore[override]
        return self.plant.words

    # What effects ask for, but for pose and wheel angles.
    @property
    def stages(self) -> frozenset[str]:  # type: ignore[override]
        return self.plant.stages

    @property
    def drive_inputs(self) -> tuple[int, ...]:
        return self.plant.drive_inputs

    @property
    def motors_behind(self) -> tuple[int, ...]:
        return self.plant.motors_behind

    @property
    def velocities(self) -> tuple[str, ...]:  # type: ignore[override]
        return self.plant.velocities

    @property
    def turning(self) -> str:  # type: ignore[override]
        return self.plant.turning

    @property
    def translations(self) -> tuple[str, ...]:
        return self.plant.translations

    @property
    def drive_axes(self) -> tuple[int, ...]:  # type: ignore[override]
        return self.plant.drive_axes

    @property
    def axis_words(self) -> tuple[str, ...]:  # type: ignore[override]
        return self.plant.axis_words

    @property
    def length_unit(self) -> str:  # type: ignore[override]
        return self.plant.length_unit

    @property
    def friction_unit(self) -> str:  # type: ignore[override]
        return self.plant.friction_unit

    @property
    def torque_unit(self) -> str:  # type: ignore[override]
        return self.plant.torque_unit

    @property
    def rim_unit(self) -> str:  # type: ignore[override]
        return self.plant.rim_unit

    @property
    def ground_force_unit(self) -> str:  # type: ignore[override]
        return self.plant.ground_force_unit

    @property
    def winding(self) -> str:  # type: ignore[override]
        return self.plant.winding

    @property
    def supply_voltage(self) -> str | float | None:  # type: ignore[override]
        return self.plant.supply_voltage

    @property
    def mechanisms(self) -> Mapping[str, tuple[str, ...]]:  # type: ignore[override]
        return self.plant.mechanisms

    @property
    def wheel_radius(self) -> str:  # type: ignore[override]
        return self.plant.wheel_radius

    @property
    def wheel_inertia(self) -> str:  # type: ignore[override]
        return self.plant.wheel_inertia

    def with_larger_wheels(self, numbers: Mapping[str, float], share: float) -> dict[str, float]:
        return self.plant.with_larger_wheels(numbers, share)

    @property
    def wheel_sides(self) -> tuple[str, str]:  # type: ignore[override]
        return self.plant.wheel_sides

    @property
    def expressed(self) -> frozenset[str]:  # type: ignore[override]
        return self.plant.expressed

    @property
    def _added(self) -> tuple[str, ...]:
        return (*self.controller.states, *(_held(name) for name in self.plant.channels.inputs), _LAST)

    @property
    def own_states(self) -> tuple[str, ...]:
        return (*self.plant.own_states, *self._added)

    @property
    def states(self) -> tuple[str, ...]:
        return (*self.plant.states, *self._added)

    @property
    def estimated_states(self) -> tuple[str, ...]:
        return self.plant.estimated_states

    def defaults(self) -> ParameterTable:
        return ParameterTable({**self.plant.defaults(), **self.controller.parameters})

    def initial_state(self) -> dict[str, float]:
        added = dict.fromkeys(self._added, 0.0) | {name: float(v) for name, v in self.controller.start.items()}
        return self.plant.initial_state() | added | {_LAST: -1.0}

    def _acting(self, state: State, inputs: Scalars, p: Numbers) -> tuple[Scalars, State]:
        """Commands that act, and the controller's states after them."""
        names = self.plant.channels.inputs
        given = dict(zip(self.channels.inputs, inputs, strict=True))
        fresh = jnp.asarray(given[SAMPLE]) != state[_LAST]
        before = tuple(state[_held(name)] for name in names)
        measured = dict(zip(self.plant.channels.measured, self.plant.observe(state, before, p), strict=True))
        own = {name: state[name] for name in self.controller.states}
        found = self.controller.law({name: given[name] for name in self.controller.reference}, measured, own, p)
        commands, after = found if isinstance(found, tuple) else (found, {})
        acting = tuple(jnp.where(fresh, commands[name], old) for name, old in zip(names, before, strict=True))
        kept = {name: jnp.where(fresh, after[name], own[name]) for name in own}
        held = {_held(name): u for name, u in zip(names, acting, strict=True)}
        return acting, {**kept, **held, _LAST: jnp.where(fresh, given[SAMPLE], state[_LAST])}

    def effective_inputs(self, state: State, inputs: Scalars, h: Scalar, p: Numbers) -> Scalars:
        return _Commands(self.plant.effective_inputs(state, self._acting(state, inputs, p)[0], h, p))

    def rates(self, state: State, inputs: Scalars, dry: Scalars, p: Numbers) -> State:
        if not isinstance(inputs, _Commands):
            raise ParameterError(
                f"{self.name} has equations of motion at its commands only; linear methods take the plant and its logs"
            )
        return dict(self.plant.rates(state, tuple(inputs), dry, p)) | dict.fromkeys(self._added, 0.0)

    def settle(self, before: State, after: State, inputs: Scalars, h: Scalar, p: Numbers) -> State:
        acting, own = self._acting(before, inputs, p)
        return {**self.plant.settle(before, after, acting, h, p), **own}

    def observe(self, state: State, inputs: Scalars, p: Numbers) -> Scalars:
        acting, _ = self._acting(state, inputs, p)
        seen, own = self.plant.observe(state, acting, p), self.plant.channels
        commands = acting if self.controller.fitted else ()
        return (*seen[: len(own.outputs)], *commands, *seen[len(own.outputs) :])

    def rubbing(self, state: State, p: Numbers) -> Scalars:
        return self.plant.rubbing(state, p)

    def coulomb(self, state: State, p: Numbers) -> Levels:
        return self.plant.coulomb(state, p)

    def compliance(self, state: State, p: Numbers) -> tuple[Scalars, ...]:
        return self.plant.compliance(self._of_plant(state), p)

    def rubbing_rates(self, state: State, rates: State, p: Numbers) -> Scalars:
        return self.plant.rubbing_rates(self._of_plant(state), self._of_plant(rates), p)

    def _of_plant(self, state: State) -> State:
        """Without the states that the loop adds, where a plant takes its own as they are."""
        return {name: state[name] for name in self.plant.states}

    # What is looked for asks the robot for; in a simulation the plant's own answer.
    def own_coulomb(self, state: State, p: Numbers) -> Levels:
        return self.plant.own_coulomb(state, p)

    def own_viscous(self, speeds: Scalars, state: State, p: Numbers) -> Scalars:
        return self.plant.own_viscous(speeds, state, p)

    def along(self, state: State, p: Numbers) -> Scalars:
        return self.plant.along(state, p)

    def pushed(self, forces: Scalars, each: Scalars, p: Numbers) -> Scalars:
        return self.plant.pushed(forces, each, p)

    def yaw_rate(self, state: State, p: Numbers) -> Scalar:
        return self.plant.yaw_rate(state, p)

    def turned(self, forces: Scalars, moment: Scalar, p: Numbers) -> Scalars:
        return self.plant.turned(forces, moment, p)

    def rim_levers(self, p: Numbers) -> Scalars:
        return self.plant.rim_levers(p)

    def rim_speeds(self, speeds: Scalars, p: Numbers) -> Scalars:
        return self.plant.rim_speeds(speeds, p)

    def __add__(self, effect: Effect) -> Self:
        plant = self.plant.with_parameters(self.parameters) + effect
        _check_effects(plant)
        return replace(self, parameters=plant.parameters, effects=plant.effects, plant=plant.structure)

    @property
    def alone(self) -> Robot:
        """The plant without its controller, with the loop's numbers."""
        own = {name: p for name, p in self.parameters.items() if name not in self.controller.parameters}
        return replace(self.plant.with_parameters(ParameterTable(own)), scales=self.scales)


def _check_effects(plant: Robot) -> None:
    for effect in plant.effects:
        if on_whole_signals(effect):
            raise ParameterError(f"the effect {effect.id!r} {IN_NO_LOOP}")


def _check_law(plant: Robot, controller: Controller) -> None:
    """Raise `ParameterError` for a law that does not give every command and state."""
    numbers = {**plant.parameters.numbers, **{name: p.value for name, p in controller.parameters.items()}}
    named = (controller.reference, plant.channels.measured, controller.states)
    reference, measured, state = (dict.fromkeys(names, 0.0) for names in named)
    try:
        found = controller.law(reference, measured, state, numbers)
    except KeyError as error:
        raise ParameterError(
            f"the controller asks for {error.args[0]!r}; it is given the reference {list(controller.reference)}, the measured "
            f"{list(plant.channels.measured)}, its states {list(controller.states)} and the parameters"
        ) from None
    commands, after = found if isinstance(found, tuple) else (found, {})
    for what, names, given in (("command", plant.channels.inputs, commands), ("state", controller.states, after)):
        absent = [name for name in names if name not in given]
        if absent:
            raise ParameterError(
                f"the controller returns no {what} {absent[0]!r}; return one for each of {list(names)}"
            )
    clash = set(controller.states) & set(plant.states) or set(controller.parameters) & set(plant.parameters)
    if clash:
        raise ParameterError(f"the controller's {sorted(clash)[0]!r} is the robot's name, too; choose another")


def _looped(log: Log, robot: ClosedLoop) -> Log:
    references = {}
    for name in robot.controller.reference:
        if name not in log.extra.columns:
            raise LogError(
                f"{log.name} has no column {name!r}, the controller's reference; log it, or name another column."
            )
        values = np.asarray(log.extra[name], dtype=float)
        if not np.isfinite(values).all():
            raise LogError(
                f"{log.name}: the reference {name!r} is not a number everywhere; fill it in or cut the log there."
            )
        references[name] = values
    inputs = {**references, SAMPLE: np.arange(1.0, len(log) + 1.0)}
    outputs = {name: log.output(name) for name in log.channels.measured}
    outputs |= {name: log.input(name) for name in log.channels.inputs} if robot.controller.fitted else {}
    return Log.from_arrays(log.name, log.time, inputs, outputs, robot.channels, log.extra, log.source)


def at_commands(loop: Robot, logs: LogSet) -> LogSet:
    """The logs of a loop as logs of its plant, at the commands that stand in them. Raises `LogError` where none do."""
    plant, own = loop.alone, []
    for log in logs:
        lacking = [name for name in plant.channels.inputs if name not in log.channels.measured]
        if lacking:
            raise LogError(f"{log.name} has no commands {lacking[0]!r}, since the controller says fitted=False.")
        inputs = {name: np.nan_to_num(log.output(name)) for name in plant.channels.inputs}
        outputs = {name: log.output(name) for name in plant.channels.measured}
        own.append(Log.from_arrays(log.name, log.time, inputs, outputs, plant.channels, log.extra, log.source))
    return LogSet(own)


def _numeric(logs: LogSet) -> tuple[str, ...]:
    """Columns that all logs have beside their channels and the pose, and that are numbers."""
    common = set.intersection(*(set(log.extra.select_dtypes("number").columns) for log in logs))
    return tuple(name for name in logs[0].extra.columns if name in common - {"x", "y", "theta", "beta"})


def closed_loop(robot: Robot, logs: LogSet, controller: Controller | Law) -> tuple[ClosedLoop, LogSet]:
    """`robot` with its controller, and its logs as logs of that: reference in, measured motion and commands out.

    `logs` are those of the robot, with the reference among their further columns (`Log.extra`). A plain function is a law
    without states whose reference is every such column. What comes back goes into `output_error`, `simulate`, `compare`
    and `explain` like any robot and its logs.

    Raises `ParameterError` for a law that does not fit the robot, and for effects on commands and sensors, and `LogError`
    for logs without the reference.
    """
    if not isinstance(controller, Controller):
        controller = Controller(controller, _numeric(logs))
    if not controller.reference:
        raise LogError(f"{logs[0].name} has no further columns, and a controller needs its reference; log it.")
    _check_effects(robot)
    _check_law(robot, controller)
    table = robot.parameters.merge(dict(controller.parameters))
    loop = ClosedLoop(parameters=table, effects=robot.effects, plant=robot.structure, controller=controller)
    return loop, LogSet(_looped(log, loop) for log in logs)
