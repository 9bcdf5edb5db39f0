"""Forces that a model may lack: what a robot looks like with them, at nothing, and what a residual that asks for one says.

Which one it asks for, output error (`output_error/neglected.py`) and the linear methods (`linear/neglected.py`) find each from
what they leave.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ..effects.drivetrain import risen
from ..logs import LogSet
from ..parameters import Parameter
from ..robots.effect import Effect, Levels, Numbers, Scalars, State
from ..robots.robot import Robot
from ..robots.traits import refusal
from ..simulation.scaled import scales_of
from .result import Fit

FALSE_ALARM = 0.001
"""How often a fit that lacks nothing is called poor for a force that it may lack."""
HINT, _MATTERS = 0.01, 2.0
"""The same of a note, for what would also move a parameter by that many standard errors."""
_SHARES = (0.05, 0.2)
"""Speeds, in shares of the largest, below which friction may rise towards standstill."""
_WHOLE = "whole_drag"
WAYS = {
    "inputs.late": "inputs that act later or earlier than logged",
    "inputs.dead_zone": "a dead zone of the inputs",
}
_RISE, _DRAG = "friction that rises towards standstill", "drag that grows with the square of"
_ONE_WAY = "friction that is larger one way than the other in"
_HAD = {
    "actuator_dead_zone": WAYS["inputs.dead_zone"],
    "asymmetric_viscous_friction": _ONE_WAY,
    "input_delay": WAYS["inputs.late"],
    "quadratic_drag": _DRAG,
    "sensor_delay": WAYS["inputs.late"],
    "stribeck_friction": _RISE,
}
"""How the words for a force begin that is in a model which has this effect, by one of its laws."""
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Forces(Effect):
    """On every velocity a constant force, one that grows with the speed's square, and one that grows with its size, whichever
    way it moves; and one that grows with the square of the speed against the whole translation."""

    id: ClassVar[str] = "neglected_force"
    where: ClassVar[str] = "body"
    formula: ClassVar[str] = "Q' = Q + constant - drag v |v| - oneway |v|"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        names = [f"{kind}_{v}" for v in robot.velocities for kind in ("constant", "drag", "oneway")]
        names += [_WHOLE] if len(robot.translations) > 1 else []
        return {self.key(name): Parameter(0.0, free=True) for name in names}

    def force(self, forces: Scalars, state: State, p: Numbers, robot: Robot) -> Scalars:
        changed, linear = [], robot.translations
        # The small number keeps the derivative of the root finite at standstill.
        speed = jnp.sqrt(sum(state[v] ** 2 for v in linear) + 1e-300) if len(linear) > 1 else 0.0
        for force, v in zip(forces, robot.velocities, strict=True):
            drag = p[self.key(f"drag_{v}")] * state[v] * jnp.abs(state[v])
            drag = drag + p[self.key(_WHOLE)] * speed * state[v] if len(linear) > 1 and v in linear else drag
            drag = drag + p[self.key(f"oneway_{v}")] * jnp.abs(state[v])
            changed.append(force + p[self.key(f"constant_{v}")] - drag)
        return tuple(changed)


@dataclass(frozen=True)
class RiseTowardsStandstill(Effect):
    """Dry friction that rises towards standstill, below either of two speeds."""

    id: ClassVar[str] = "neglected_friction"
    where: ClassVar[str] = "drivetrain"
    formula: ClassVar[str] = "C' = C + rise exp(-(s / speed)^2)"

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        found = {}
        for k, share in enumerate(_SHARES):
            found[self.key(f"rise_{k}")] = Parameter(0.0, free=True)
            found[self.key(f"speed_{k}")] = Parameter(share * robot.scales.speed)
        return found

    def dry(self, levels: Levels, speeds: Scalars, state: State, p: Numbers, robot: Robot) -> Levels:
        axes = robot.drive_axes or tuple(range(len(levels)))
        for k in range(len(_SHARES)):
            rise, speed = p[self.key(f"rise_{k}")], p[self.key(f"speed_{k}")]
            levels = risen(levels, axes, speeds, p, robot, rise, speed)
        return levels


class Neglected(NamedTuple):
    """A force that the residual asks for.

    What it is in `words`; how many standard deviations of chance it stands out by, `z`, and how likely chance is to bring
    as much among all that were looked at, `p_value`; the change `shift` [n] of the fitted parameters to first order, were it
    in the model.
    """

    words: str
    z: float
    p_value: float
    shift: NDArray[np.float64]

    def _moves(self, fit: Fit) -> Array:
        """How far each free parameter would move, in its standard errors; zero where it has none."""
        errors = np.array([fit[name].std_error for name in fit.free_names])
        known = np.isfinite(errors) & (errors > 0)
        return np.where(known, np.abs(self.shift) / np.where(known, errors, 1.0), 0.0)

    def moves(self, fit: Fit) -> float:
        """By how many of its standard errors it would move the parameter of `fit` that it moves most."""
        return float(self._moves(fit).max())

    def worth_a_note(self, fit: Fit) -> bool:
        """Whether this, which may be chance, would change what `fit` says of a parameter."""
        return self.moves(fit) > _MATTERS

    def sentence(self, fit: Fit) -> str:
        """What that means for the parameters of `fit`."""
        moves = self._moves(fit)
        most = int(np.argmax(moves))
        then = f": with it {fit.free_names[most]} would move by {moves[most]:.2g} of its standard errors"
        sure = self.p_value < FALSE_ALARM
        found = "holds the mark of" if sure else "hints at"
        had = any(self.words.startswith(_HAD.get(effect.id, "-")) for effect in fit.robot.effects)
        lacks = "of another form or size than the model's" if had else "which the model does not have"
        return (
            f"What is left {found} {self.words} (p = {self.p_value:.1g}{'' if sure else ': it may be chance'}), {lacks}"
            f"{then if moves[most] > 1.0 else ''}."
        )


def probed(robot: Robot, logs: LogSet) -> tuple[Robot, tuple[str, ...]]:
    """The robot with everything in it that it may lack, at nothing, and the names of those parameters."""
    robot = replace(robot, scales=scales_of(robot, logs))
    own = robot.parameters
    if "force" not in robot.traits and robot.velocities:
        robot = robot.per_unit_inertia()
    for effect in (Forces(), RiseTowardsStandstill()):
        if refusal(effect, robot) is None:
            robot = robot + effect
    added = [name for name in robot.parameters if name not in own and robot.parameters[name].free]
    return robot, tuple(added)


def ways_of(robot: Robot) -> tuple[str, ...]:
    """What may happen to commands on their way that `robot` is asked for: no delay of these where its own free numbers are one
    already. What both differ by is the motion between rows, and in a loop the noise, which a command holds a row later."""
    free = [f"{effect.id}." for effect in robot.effects if _HAD.get(effect.id) == WAYS["inputs.late"]]
    shifted = any(name.startswith(tuple(free)) for name in robot.parameters.free_names) if free else False
    return tuple(way for way in WAYS if way != "inputs.late" or not shifted)


def words_of(name: str) -> str:
    """What the added parameter of that name stands for."""
    if name in WAYS:
        return WAYS[name]
    kind, _, of = name.partition(".")[2].partition("_")
    if kind == "rise":
        return _RISE
    if kind == "oneway":
        return f"{_ONE_WAY} {of}"
    return f"a constant force on {of}" if kind == "constant" else f"{_DRAG} {'the speed' if kind == 'whole' else of}"
