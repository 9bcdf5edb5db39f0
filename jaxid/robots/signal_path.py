"""The signal path of every robot, written once: what each stage passes on, and where effects act on it.

    command -> driver -> supply -> motor -> gear -> friction, contact, body -> sensor

The robot supplies the physics of the stages; the effects of the model change what passes between them.
"""

from collections.abc import Iterator
from functools import cache, partial
from inspect import signature
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp

from .effect import Effect, EffectError, Levels, Numbers, Scalars, State
from .trigonometry import sincos

if TYPE_CHECKING:
    from .robot import Robot

_LONG = 1e4
"""Seconds for which a first command was held before a log: so long that the mean over them is that command behind any lag."""
POSE_STATES = ("x", "y", "theta")
STAGES = ("supply", "torque", "dry", "viscous", "force")
"""Stages inside the equations of motion, at which an effect can act only where the robot has them."""


@cache
def overrides(kind: type[Effect], stage: str) -> bool:
    """Whether effects of this class act at `stage`."""
    return getattr(kind, stage) is not getattr(Effect, stage)


@cache
def _asks(kind: type[Effect], stage: str, name: str = "robot") -> bool:
    return name in signature(getattr(kind, stage)).parameters


def acting(robot: "Robot", stage: str, **more: Any) -> Iterator[Any]:
    """What each effect that acts at `stage` does there, in the order in which they were added; those that ask for one of the
    things `more` by name are given it."""
    for effect in robot.effects:
        if overrides(type(effect), stage):
            asked = {
                name: value for name, value in {"robot": robot, **more}.items() if _asks(type(effect), stage, name)
            }
            yield partial(getattr(effect, stage), **asked)


def sent(robot: "Robot", signal: Any, time: Any, dt: Any, p: Numbers, held: Any) -> Any:
    """Commands `signal` [T, nu] at `time` [T], held for `dt` [T], after all effects on commands.

    `held` (0 or 1): whether what was commanded before is taken to be the first command, as of a log that begins in motion; else
    there was none.
    """
    first = -_LONG * jnp.ones(1)
    for act in acting(robot, "command"):
        if not act.func.__self__.settles:
            signal = act(signal, time, dt, p)
            continue
        longer = jnp.concatenate([held * signal[:1], signal])
        signal = act(longer, jnp.concatenate([first, time]), jnp.concatenate([-first, dt]), p)[1:]
    return signal


def passed(robot: "Robot", stage: str, signal: Any, *others: Any, **more: Any) -> Any:
    """`signal` after all effects that act at `stage`."""
    for act in acting(robot, stage, **more):
        signal = act(signal, *others)
    return signal


def numbers(robot: "Robot", state: State, p: Numbers) -> Numbers:
    """The parameters as they are in this state."""
    return passed(robot, "numbers", p, state)


def powered(robot: "Robot", inputs: Scalars, state: State, p: Numbers) -> tuple[Scalars, Scalars]:
    """Voltages and currents of the motors at the commanded `inputs`: driver, supply and motor."""
    volts = robot.driver(inputs, state, p)
    currents = robot.motor(volts, state, p)
    for act in acting(robot, "supply"):
        volts = robot.driver(act(volts, currents, state, p), state, p)
        currents = robot.motor(volts, state, p)
    return volts, currents


def coulomb(robot: "Robot", state: State, p: Numbers) -> Levels:
    """(backward, forward) Coulomb levels of the rubbing axes."""
    p = numbers(robot, state, p)
    levels = robot.own_coulomb(state, p)
    if any(overrides(type(effect), "dry") for effect in robot.effects):
        levels = passed(robot, "dry", levels, robot.rubbing(state, p), state, p)
    return levels


def rates(robot: "Robot", state: State, inputs: Scalars, dry: Scalars, p: Numbers) -> State:
    """Time derivative of every state under the given inputs and dry-friction torques (positive resists positive speed)."""
    return rates_with(robot, state, inputs, dry, numbers(robot, state, p))


def rates_with(robot: "Robot", state: State, inputs: Scalars, dry: Scalars, p: Numbers) -> State:
    """The same with parameters that are those of this state already."""
    volts, currents = powered(robot, inputs, state, p)
    driving = robot.gear(currents, volts, state, p)
    torques = passed(robot, "torque", driving, state, p)
    speeds = robot.rubbing(state, p)
    resistance = passed(robot, "viscous", robot.own_viscous(speeds, state, p), speeds, state, p, torques=torques)
    forces = passed(robot, "force", robot.own_forces(state, p), state, p)
    resisting = tuple(r + d for r, d in zip(resistance, dry, strict=True))
    found = dict(robot.motion(state, volts, torques, resisting, forces, p))
    found |= kinematics(robot, state, p)
    return found | _own_rates(robot, state, currents, driving, p)


def kinematics(robot: "Robot", state: State, p: Numbers) -> State:
    """Rates of the pose and of the wheels' angles, where they are integrated beside the robot's own states."""
    found: State = {}
    added = robot.added_states
    if "theta" in added:
        sine, cosine = sincos(state["theta"])
        along, left, turning = robot.planar(state, p)
        x, y = products((cosine, along), (-sine, left)), products((sine, along), (cosine, left))
        found |= {"x": x, "y": y, "theta": turning}
    angles = [name for name in robot.angles if name in added]
    if angles:
        found |= {n: rate for n, rate in zip(robot.angles, robot.angle_rates(state, p), strict=True) if n in angles}
    return found


def products(*pairs: tuple[Any, Any]) -> Any:
    """Sum of products, those with a plain 0.0 left out: a robot's missing sideways speed costs nothing."""
    kept = [a * b for a, b in pairs if not (isinstance(b, float) and b == 0.0)]
    return sum(kept[1:], kept[0]) if kept else 0.0


def _own_rates(robot: "Robot", state: State, currents: Scalars, torques: Scalars, p: Numbers) -> State:
    added: State = {}
    for effect in robot.effects:
        own = effect.states_on(robot)
        asked = {"robot": robot, "torques": torques}
        asked = {name: value for name, value in asked.items() if _asks(type(effect), "rates", name)}
        rates = effect.rates(state, currents, p, **asked)  # type: ignore[call-arg]
        foreign = sorted(set(rates) - set(own))
        if foreign:
            raise EffectError(
                f"the effect {effect.id!r} gives a rate of {', '.join(foreign)}, which is no state of its own; let it act "
                "as a force, a torque or friction, or name the state in its `states`"
            )
        absent = sorted(set(own) - set(rates))
        if absent:
            raise EffectError(f"the effect {effect.id!r} gives no rate of its state {', '.join(absent)}; return one")
        added |= rates
    return added


def names_clash(robot: "Robot", effect: Effect) -> str | None:
    """A state that the effect would bring and that is there already."""
    there = set(robot.states)
    return next((name for name in effect.states_on(robot) if name in there), None)


__all__ = [
    "POSE_STATES", "STAGES", "acting", "coulomb", "kinematics", "names_clash", "numbers", "overrides", "passed", "powered",
    "products", "rates", "rates_with",
]  # fmt: skip
