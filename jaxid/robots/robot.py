"""The interface between robots and everything that simulates or identifies them.

A robot is a set of pure functions of state, input and parameters plus a table of parameters. States, inputs and
parameters are scalars by name, so that the same code runs on one number, on a batch of lanes, and under `jax.jvp`, and
compiles into a single fused loop.
"""

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import jax

from ..logs import Channels
from ..parameters import Parameter, ParameterTable
from .effect import Effect, Levels, Numbers, Path, Scalar, State

_EMPTY = ParameterTable({})


@dataclass(frozen=True)
class Robot:
    """Base of all robots.

    `parameters` is the table of physical parameters (None: the robot's defaults) and `effects` what was added to the
    robot's own physics. `robot + effect` adds one; `robot.with_values(Cs=0.3)` and `robot.with_parameters(table)` change
    the numbers.

    A subclass gives `channels`, `states`, `defaults()`, `rates()`, `observe()` and, where something rubs, `rubbing()`
    and `coulomb()`.
    """

    parameters: ParameterTable = field(default=None)  # type: ignore[assignment]
    effects: tuple[Effect, ...] = ()

    name: ClassVar[str] = "robot"
    channels: ClassVar[Channels]
    combinations: ClassVar[dict[str, Any]] = {}
    """Functions of the parameters (name -> (function of numbers, unit, meaning)) that data determine when single
    parameters are not."""
    velocities: ClassVar[tuple[str, ...]] = ()
    """States to which the generalised forces belong, in their order."""
    drive_axes: ClassVar[tuple[int, ...]] = ()
    """Rubbing axes that belong to the drivetrain."""
    angles: ClassVar[tuple[str, ...]] = ()
    """States that are the angles of the driving wheels, integrated where an effect needs them."""
    max_step: ClassVar[float] = 0.01
    """Longest integration step [s] for which the default integrator's error stays below usual sensor noise."""

    def __post_init__(self) -> None:
        if self.parameters is None:
            object.__setattr__(self, "parameters", self.defaults())

    # -- the physics, one method a stage ---------------------------------------------------------------------------
    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states that are integrated."""
        raise NotImplementedError

    @property
    def estimated_states(self) -> tuple[str, ...]:
        """Names of the states whose initial values can be estimated from the outputs."""
        return self.states

    def defaults(self) -> ParameterTable:
        """The table of parameters with their published or assumed values."""
        raise NotImplementedError

    def initial_state(self) -> dict[str, float]:
        """The state at the start of a log that does not say otherwise: at rest at the origin."""
        return dict.fromkeys(self.states, 0.0)

    def rubbing(self, state: State, p: Numbers) -> Path:
        """Speeds at which dry friction acts, one per rubbing axis."""
        return ()

    def coulomb(self, state: State, p: Numbers) -> Levels:
        """(backward, forward) Coulomb levels of the rubbing axes, both positive."""
        return ()

    def rates(self, state: State, inputs: Path, dry: Path, p: Numbers) -> State:
        """Time derivative of every state under the given inputs and dry-friction torques (positive resists positive speed)."""
        raise NotImplementedError

    def compliance(self, state: State, p: Numbers) -> tuple[Path, ...]:
        """The Delassus matrix: -d(rubbing acceleration i) / d(dry-friction torque j), positive semidefinite."""
        no_input = (0.0,) * len(self.channels.inputs)

        def speeds_after(dry: Path) -> Path:
            rates = self.rates(state, no_input, dry, p)
            return self.rubbing_rates(state, rates, p)

        axes = len(self.rubbing(state, p))
        zero = (0.0,) * axes
        columns = []
        for j in range(axes):
            unit = tuple(1.0 if i == j else 0.0 for i in range(axes))
            columns.append(jax.jvp(speeds_after, (zero,), (unit,))[1])
        return tuple(tuple(-columns[j][i] for j in range(axes)) for i in range(axes))

    def rim_speeds(self, speeds: Path, p: Numbers) -> Path:
        """Rubbing speeds in m/s at the wheels' rims, where friction laws of different axes can be compared."""
        return speeds

    def drive_forces(self, torques: Path, p: Numbers) -> Path:
        """Forces at the ground [N] of the motors' torques (or forces) as the `torque` stage passes them."""
        return torques

    def field_force(self, field: tuple[Scalar, Scalar], state: State, p: Numbers) -> Path:
        """Generalised forces of an acceleration field [m/s²] along the world's (x, y) that pulls at every body's mass."""
        return (0.0,) * len(self.velocities)

    def rubbing_rates(self, state: State, rates: State, p: Numbers) -> Path:
        """Time derivative of the rubbing speeds along `rates` of the velocities."""
        return jax.jvp(lambda s: self.rubbing(s, p), (state,), (rates,))[1]

    def observe(self, state: State, inputs: Path, p: Numbers) -> Path:
        """Outputs in the order of the channels (measured ones first, then optional ones)."""
        raise NotImplementedError

    def effective_inputs(self, state: State, inputs: Path, h: Scalar, p: Numbers) -> Path:
        """Inputs to hold over a step of `h` seconds; robots with stiff electrical states put their mean effect in here."""
        return inputs

    def settle(self, before: State, after: State, inputs: Path, h: Scalar, p: Numbers) -> State:
        """The state after a step, with stiff states advanced exactly."""
        return after

    # -- building models -------------------------------------------------------------------------------------------
    def __add__(self, effect: Effect) -> Self:
        known = dict(self.parameters)
        added = {k: v for k, v in effect.parameters(self).items() if k not in known}
        freed = {name: replace(known[name], free=True) for name in effect.frees}
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

    def needs(self, group: str) -> bool:
        """Whether any effect reads the named group of states."""
        return any(group in effect.needs for effect in self.effects)

    @property
    def extra_states(self) -> tuple[str, ...]:
        """States that effects brought along."""
        return tuple(name for effect in self.effects for name in effect.states)


def parameter(
    value: float,
    unit: str,
    meaning: str,
    source: str,
    *,
    positive: bool = True,
    free: bool = False,
    typical: float | None = None,
) -> Parameter:
    """A robot's parameter; positive ones are bounded below by zero."""
    lower = 0.0 if positive else -float("inf")
    return Parameter(value, unit, free=free, lower=lower, typical=typical, source=source, meaning=meaning)


__all__ = ["Effect", "Robot", "Scalar", "State", "parameter"]
