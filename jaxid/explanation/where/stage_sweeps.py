"""What a stage of the signal path does as one variable moves, everything else at rest or typical.

A sweep is a robot's own stages with its effects, asked at many values of one thing: friction at many speeds, a sensor's reading
at many true values. Nothing here knows any effect by name, so that a user's own one is asked the same way.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ...robots.effect import Effect, Numbers, Scalars, State
from ...robots.robot import Robot
from ...robots.scales import Scales
from ...robots.signal_path import overrides, passed, powered
from ...robots.traits import axes_in_words

Grid = NDArray[np.float64]

SIDE = 30
POINTS = SIDE * SIDE
"""Values of every sweep, as many as a map of `SIDE` by `SIDE` places has: one shape for all is compiled once."""
_BEYOND = 1.1
"""Share of the usual largest value up to which a variable is moved."""


@dataclass(frozen=True)
class Sweep:
    """One variable moved over `values` [N] in the unit `of`: `response(robot, p)` [n, N] is the `quantity` of each of the
    `parts` [n] in their `units`.

    Sweeps of one `family` differ only in which of several like things is moved. `kind` says how measured motion compares with
    it: as "friction" or "force", "place" where `values` [N, 2] are of the floor, "" where it does not; `moved` is the velocity
    that is swept, where it is one.
    """

    quantity: str
    parts: tuple[str, ...]
    units: tuple[str, ...]
    variable: str
    of: str
    values: Grid
    response: Callable[[Robot, Numbers], NDArray | object]
    family: str
    kind: str = ""
    moved: str = ""


def both_ways(largest: float) -> Grid:
    """Values from below zero to above it, without zero itself, closer together near it."""
    half = _BEYOND * largest * np.linspace(0.0, 1.0, POINTS // 2 + 1)[1:] ** 2
    return np.concatenate([-half[::-1], half])


def _said(robot: Robot, name: str) -> str:
    """A channel or velocity in the robot's words, with its symbol."""
    said = robot.words.get(name, "")
    return f"{said} {name}" if said else name


def _numbered(words: str, count: int) -> tuple[str, ...]:
    """Parts by their number; one alone needs none."""
    return tuple(f"{words} {k + 1}" for k in range(count)) if count > 1 else ("",)


def _of_wheels(robot: Robot, count: int) -> tuple[str, ...]:
    """Parts by the wheels that drive: by the words for the drive axes where there are as many."""
    words = axes_in_words(robot)
    return tuple(f"of {n}" for n in words) if count == len(words) > 1 else _numbered("of wheel", count)


def _rows(values: Scalars, count: int):
    """Numbers or arrays [N] as one array [n, N]."""
    return jnp.stack([jnp.broadcast_to(jnp.asarray(v, float), (count,)) for v in values])


def _idle(robot: Robot) -> tuple[float, ...]:
    return (0.0,) * len(robot.channels.inputs)


def _driven(robot: Robot, value) -> Scalars:
    """The same `value` on every input that drives."""
    return tuple(value if k in robot.drive_inputs else 0.0 for k in range(len(robot.channels.inputs)))


def _state(robot: Robot, **moved) -> State:
    """The robot at rest at the start, but for what is moved."""
    rest = dict.fromkeys(robot.states, 0.0) | robot.initial_state()
    return rest | {name: value for name, value in moved.items() if name in rest}


# -- the quantities ------------------------------------------------------------------------------------------------
def rubbing_torques(robot: Robot, speeds: Scalars, state: State, p: Numbers) -> list:
    """Dry and viscous friction of every rubbing axis, positive against positive speed."""
    levels = passed(robot, "dry", robot.own_coulomb(state, p), speeds, state, p)
    viscous = passed(robot, "viscous", robot.own_viscous(speeds, state, p), speeds, state, p)
    found = []
    for speed, (backward, forward), more in zip(speeds, levels, viscous, strict=True):
        found.append(jnp.where(speed > 0, forward, jnp.where(speed < 0, -backward, 0.0)) + more)
    return found


def _friction(robot: Robot, rims, state: State, p: Numbers, count: int):
    """Friction [n, N] of the drive axes that move with `rims` at the wheels' rims."""
    speeds = tuple(rims / lever for lever in robot.rim_levers(p))
    found = rubbing_torques(robot, speeds, state, p)
    return _rows(tuple(found[axis] for axis in robot.drive_axes), count)


def _forces(robot: Robot, state: State, p: Numbers, count: int):
    """All but the drive's generalised forces [n, N], friction with them."""
    speeds, forces = robot.rubbing(state, p), list(passed(robot, "force", robot.own_forces(state, p), state, p))
    if speeds:
        torques = rubbing_torques(robot, speeds, state, p)
        none = _state(robot)
        for i, name in enumerate(robot.velocities):
            per = robot.rubbing(none | {name: 1.0}, p)
            rest = robot.rubbing(none, p)
            for torque, one, zero in zip(torques, per, rest, strict=True):
                forces[i] = forces[i] - (one - zero) * torque
    return _rows(tuple(forces), count)


def _drive(robot: Robot, inputs: Scalars, state: State, p: Numbers, count: int):
    """Drive torques [n, N] at commands that reach the motors as they are."""
    volts, currents = powered(robot, inputs, state, p)
    return _rows(passed(robot, "torque", robot.gear(currents, volts, state, p), state, p), count)


# -- the sweeps of each stage, the most particular variable first ---------------------------------------------------
def _turned(robot: Robot, scales: Scales, along: bool = False) -> Iterator[tuple[str, str, str, str, Grid]]:
    """States other than velocities that a stage may depend on: (family, state, in words, unit, values).

    `along`: an angle that has a way goes all of it, instead of once round.
    """
    if "theta" in robot.states:
        yield "heading", "theta", "heading", "rad", np.linspace(-np.pi, np.pi, POINTS)
    for name in robot.angles:
        if name in robot.states:
            begin, end = (scales.way if along else None) or (0.0, 2 * np.pi * scales.angle)
            words = f"way {name}" if along and scales.way else f"angle {name}"
            yield "angle", name, words, robot.angle_unit, np.linspace(begin, end, POINTS)


def _own_states(effect: Effect, robot: Robot, largest: dict[str, float]) -> Iterator[tuple[str, str, str, str, Grid]]:
    for name in effect.states_on(robot):
        if largest.get(name, 0.0) > 0.0:
            yield "state", name, name.replace("_", " "), "", np.linspace(0.0, largest[name], POINTS)


def _rubbing_sweeps(robot: Robot, scales: Scales, floor: Grid) -> Iterator[Sweep]:
    words = robot.axis_words if len(robot.axis_words) == len(robot.drive_axes) else ()
    several = bool(words) or len(robot.drive_axes) > 1
    parts = tuple(f"of {n}" for n in axes_in_words(robot)) if several else ("",)
    units = tuple(robot.force_unit(n) for n in words) if words else (robot.friction_unit,) * len(parts)
    named = ("friction", parts, units)
    if len(floor) and "x" in robot.states:

        def there(r: Robot, p: Numbers):
            return _friction(r, 0.5 * scales.speed, _state(r, x=floor[:, 0], y=floor[:, 1]), p, len(floor))

        yield Sweep(*named, "place", robot.length_unit, floor, there, "place", "place")
    for family, state, variable, of, values in _turned(robot, scales, along=True):
        response = lambda r, p, s=state, v=values: _friction(r, 0.5 * scales.speed, _state(r, **{s: v}), p, len(v))  # noqa: E731
        yield Sweep(*named, variable, of, values, response, family)
    rims = both_ways(scales.speed)
    whole = lambda r, p: _friction(r, rims, _state(r), p, len(rims))  # noqa: E731
    yield Sweep(*named, "speed", robot.rim_unit, rims, whole, "speed", "friction")


def _force_sweeps(robot: Robot, scales: Scales, floor: Grid) -> Iterator[Sweep]:
    names = robot.velocities
    named = (
        "force",
        tuple(f"on the {_said(robot, name)}" for name in names),
        tuple(robot.force_unit(name) for name in names),
    )
    if len(floor) and "x" in robot.states:

        def there(r: Robot, p: Numbers):
            return _forces(r, _state(r, x=floor[:, 0], y=floor[:, 1]), p, len(floor))

        yield Sweep(*named, "place", robot.length_unit, floor, there, "place", "place")
    for family, state, variable, of, values in _turned(robot, scales):
        response = lambda r, p, s=state, v=values: _forces(r, _state(r, **{s: v}), p, len(v))  # noqa: E731
        yield Sweep(*named, variable, of, values, response, family, "force" if family == "heading" else "")
    for name in names:
        values = both_ways(scales.output(name))
        response = lambda r, p, s=name, v=values: _forces(r, _state(r, **{s: v}), p, len(v))  # noqa: E731
        yield Sweep(*named, _said(robot, name), robot.velocity_unit(name), values, response, "speed", "force", name)


def _drive_sweeps(effect: Effect, robot: Robot, scales: Scales, largest: dict[str, float]) -> Iterator[Sweep]:
    count = len(robot.drive_torques(_idle(robot), _state(robot), robot.parameters.numbers))
    parts, of = _of_wheels(robot, count), robot.channels.units.get(robot.channels.inputs[0], "")
    pull = "force" if robot.torque_unit == "N" else "torque"
    named = (f"drive {pull}", parts, (robot.torque_unit,) * count)
    volts = both_ways(scales.input)
    for family, state, variable, unit, values in [*_own_states(effect, robot, largest), *_turned(robot, scales)]:
        half = _driven(robot, 0.5 * scales.input)
        response = lambda r, p, s=state, v=values, u=half: _drive(r, u, _state(r, **{s: v}), p, len(v))  # noqa: E731
        yield Sweep(*named, variable, unit, values, response, family)
    if not overrides(type(effect), "supply"):
        demanded = both_ways(scales.torque)
        moving = {name: 0.5 * scales.output(name) for name in robot.translations[:1]}

        def transmitted(r: Robot, p: Numbers):
            return _rows(passed(r, "torque", (demanded,) * count, _state(r, **moving), p), len(demanded))

        yield Sweep(
            f"transmitted {pull}", *named[1:], f"{pull} demanded", robot.torque_unit, demanded, transmitted, "torque"
        )
        return
    commanded = lambda r, p: _drive(r, _driven(r, volts), _state(r), p, len(volts))  # noqa: E731
    yield Sweep(*named, "command of all motors, standing", of, volts, commanded, "command")
    for name in robot.translations[:1]:
        values = both_ways(scales.output(name))
        coasting = lambda r, p, s=name, v=values: _drive(r, _idle(r), _state(r, **{s: v}), p, len(v))  # noqa: E731
        yield Sweep(*named, f"{_said(robot, name)}, no command", robot.velocity_unit(name), values, coasting, "speed")


def _command_sweeps(robot: Robot, scales: Scales, places: Sequence[int]) -> Iterator[Sweep]:
    """Of the inputs at `places`, all moved alike; the others rest."""
    names, units = [robot.channels.inputs[k] for k in places], robot.channels.units
    drives = set(places) <= set(robot.drive_inputs)
    named = (
        "what reaches the motor" if drives else "what arrives",
        tuple(f"of {name}" for name in names),
        tuple(units.get(name, "") for name in names),
    )
    largest, at = scales.input if drives else scales.input_of(names[0]), np.array(places)
    moved = np.zeros(len(robot.channels.inputs))
    moved[at] = 1.0
    size = both_ways(largest)

    def static(r: Robot, p: Numbers):
        # Held for long, one value after another: what a lag or a delay does is over at each.
        ages = 1e4 * r.scales.time * jnp.arange(len(size), dtype=float)
        inputs = jnp.asarray(size)[:, None] * moved
        return passed(r, "command", inputs, ages, jnp.full(len(size), ages[1]), p).T[at]

    yield Sweep(*named, "command", units.get(names[0], ""), size, static, "command")
    time = np.linspace(0.0, 6.0 * scales.time, POINTS)

    def stepped(r: Robot, p: Numbers):
        inputs = jnp.full((len(time), 1), 0.5 * largest) * moved
        steps = jnp.full(len(time), time[1] - time[0])
        return passed(r, "command", inputs, jnp.asarray(time), steps, p).T[at]

    yield Sweep(*named, "time since a step of the command", "s", time, stepped, "step")


def _sensor_sweeps(robot: Robot, scales: Scales) -> Iterator[Sweep]:
    names, units = robot.channels.outputs, robot.channels.units
    shown, width = len(names), len(robot.observe(_state(robot), _idle(robot), robot.parameters.numbers))
    named = (
        "reading",
        tuple(f"of the {_said(robot, name)}" for name in names),
        tuple(units.get(name, "") for name in names),
    )
    time = np.linspace(0.0, scales.duration, POINTS)
    still = lambda r, p: passed(r, "measure", jnp.zeros((len(time), width)), jnp.asarray(time), p).T[:shown]  # noqa: E731
    yield Sweep("reading at rest", *named[1:], "time", "s", time, still, "time")
    for i, name in enumerate(names):
        values = both_ways(scales.output(name))

        def read(r: Robot, p: Numbers, i=i, values=values):
            true = jnp.zeros((len(values), width)).at[:, i].set(jnp.asarray(values))
            ages = 1e4 * scales.time * jnp.arange(len(values), dtype=float)
            return passed(r, "measure", true, ages, p).T[:shown]

        yield Sweep(*named, f"true {_said(robot, name)}", units.get(name, ""), values, read, "reading")
    later = np.linspace(-1.0 * scales.time, 6.0 * scales.time, POINTS)

    def stepped(r: Robot, p: Numbers):
        size = jnp.asarray([0.5 * scales.output(name) for name in names] + [0.0] * (width - shown))
        true = (later > 0)[:, None] * size
        return passed(r, "measure", jnp.asarray(true), jnp.asarray(later), p).T[:shown]

    yield Sweep(*named, "time since a step of the speed", "s", later, stepped, "step")


def sweeps(effect: Effect, robot: Robot, scales: Scales, floor: Grid, largest: dict[str, float]) -> list[list[Sweep]]:
    """The sweeps of every quantity that `effect` may change on `robot`, which carries it, the most particular first.

    `floor` [N, 2] m are the places that the robot drove over (none: not known), `largest` the values that the effect's own
    states reach.
    """
    acts = {stage for stage in ("command", "supply", "torque", "dry", "viscous", "force", "measure")
            if overrides(type(effect), stage)}  # fmt: skip
    found: list[list[Sweep]] = []
    if acts & {"dry", "viscous"} and robot.drive_axes:
        found.append(list(_rubbing_sweeps(robot, scales, floor)))
    if acts & {"supply", "torque"}:
        found.append(list(_drive_sweeps(effect, robot, scales, largest)))
    if "force" in acts:
        found.append(list(_force_sweeps(robot, scales, floor)))
    if "command" in acts:
        others = [(k,) for k in range(len(robot.channels.inputs)) if k not in robot.drive_inputs]
        found += [list(_command_sweeps(robot, scales, places)) for places in (robot.drive_inputs, *others)]
    if "measure" in acts:
        found.append(list(_sensor_sweeps(robot, scales)))
    return found
