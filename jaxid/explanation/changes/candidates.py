"""What may have changed, one candidate each: a parameter of the robot, several that one cause changes together, or a mechanism
of the catalogue that came or went.

A candidate moves a few numbers of one of the two sets of logs (its `coordinates`) while all else is shared. Those that one
cause moves together come first (a payload is mass, inertia and centre of mass; a smaller tyre changes one of two radii), since
of names that the data cannot tell apart the one of a cause is wanted.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from ...effects import catalogue
from ...effects.actuator.drives import drive_names, one_torque_each
from ...effects.own_parameter import OwnParameter
from ...robots.effect import Effect, in_words
from ...robots.robot import Robot
from ...robots.traits import axes_in_words, refusal
from .differences import CommandGain, DryShare, TorqueShare, ViscousShare

Side = Literal["before", "after"]
Numbers = Mapping[str, float]
EACH = "friction_of_each"
"""The candidate by which every drive axis has another friction of its own."""
_TREAD = 0.06
"""Share by which wear and pressure change a tyre's radius."""
Move = Callable[[Numbers, Float[np.ndarray, " k"]], dict[str, float]]


@dataclass(frozen=True)
class Coordinate:
    """One number by which a candidate moves: its name, its unit and its order of magnitude. `of` is the robot's parameter that
    it is added to, empty where it is a share."""

    name: str
    unit: str
    size: float
    of: str = ""


@dataclass(frozen=True)
class Candidate:
    """One thing that may have changed.

    `effects` are what the robot has to carry for it (absent while their parameters are zero); `move` gives the numbers of the
    `side` that differs when the `coordinates` have certain values, from those that both sides share. `start` are values to
    begin a refit from, `parts` the two that it joins. `usual`: what changes on any robot from one day to the next. `as_well_as`
    is the id of another with more numbers, for some of whose sizes it may stand; none of its own is beyond `most`. `beside`: it
    is asked only beside another, since alone it is one of the catalogue's by another name.
    """

    id: str
    title: str
    coordinates: tuple[Coordinate, ...]
    move: Move = field(repr=False, compare=False)
    effects: tuple[Effect, ...] = ()
    side: Side = "after"
    start: tuple[float, ...] = ()
    parts: tuple["Candidate", ...] = ()
    usual: bool = False
    as_well_as: str = ""
    most: float = np.inf
    beside: bool = False

    @property
    def stands_for(self) -> frozenset[str]:
        """The ids of what it may stand for some sizes of, or of what it joins then; none where it stands for nothing."""
        parts = self.parts or (self,)
        if not any(part.as_well_as for part in parts):
            return frozenset()
        return frozenset(part.as_well_as or part.id for part in parts)

    @property
    def ids(self) -> frozenset[str]:
        """Its id, or those of what it joins."""
        return frozenset(part.id for part in self.parts or (self,))

    def believable(self, delta: Float[np.ndarray, " k"]) -> bool:
        """Whether it, and what it joins, may change by as much as that."""
        if not self.parts:
            return bool(np.all(np.abs(delta) <= self.most))
        first, second = self.parts
        k = len(first.coordinates)
        return first.believable(delta[:k]) and second.believable(delta[k:])

    @property
    def is_usual(self) -> bool:
        """Whether it, or all that it joins, is usual."""
        return all(part.usual for part in self.parts) if self.parts else self.usual

    @property
    def law(self) -> tuple[str, str]:
        """The law by which a mechanism of the catalogue comes or goes, and its formula; empty where it has one only."""
        effect = next((effect for effect in self.effects if effect.id == self.id), None)
        return (effect.law, effect.formula) if effect is not None and effect.law else ("", "")

    @property
    def own(self) -> tuple[str, ...]:
        """Parameters of the robot that it is made of; none where it is an effect."""
        return tuple(c.of for c in self.coordinates if c.of)


def _added(names: Sequence[str]) -> Move:
    return lambda numbers, d: {name: numbers[name] + float(x) for name, x in zip(names, d, strict=True)}


def _put(names: Sequence[str]) -> Move:
    return lambda numbers, d: {name: float(x) for name, x in zip(names, d, strict=True)}


def _size(robot: Robot, name: str) -> float:
    parameter = robot.parameters[name]
    return abs(parameter.value) or parameter.typical or 1.0


def _worded(robot: Robot, name: str) -> str:
    meaning = robot.parameters[name].meaning
    effect, dot, own = name.rpartition(".")
    if dot and not meaning:
        return f"{own.replace('_', ' ')} of {in_words(effect)}"
    return f"{meaning} ({name})" if meaning else name


def _of_parameters(robot: Robot, identifier: str, title: str, names: Sequence[str]) -> Candidate:
    table = robot.parameters
    coordinates = tuple(Coordinate(name, table[name].unit, _size(robot, name), name) for name in names)
    return Candidate(identifier, title, coordinates, _added(names))


def _one_side(robot: Robot, mismatch: str, sign: float) -> Move:
    """The radius of one side, (1 ± mismatch) times the mean of both, grows by a share d; the other stays what it is."""

    def move(numbers: Numbers, d: Float[np.ndarray, " k"]) -> dict[str, float]:
        m, share = numbers[mismatch], float(d[0])
        larger, smaller = (1.0 + m) * (1.0 + share * (sign > 0)), (1.0 - m) * (1.0 + share * (sign < 0))
        mean = 0.5 * (larger + smaller)
        return {**robot.with_larger_wheels(numbers, mean - 1.0), mismatch: larger / mean - 1.0}

    return move


def _all_radii(load: Sequence[str]) -> Candidate:
    """All wheels are larger by a share, and speeds that their turns tell are still made of the old radius: the robot then has
    the square of it more of what drive forces move (mass and inertia, the `load`)."""
    name = "radius_of_all_wheels"

    def move(numbers: Numbers, d: Float[np.ndarray, " k"]) -> dict[str, float]:
        return {own: numbers[own] * (1.0 + float(d[0])) ** 2 for own in load}

    title, coordinates = "radius of all wheels (speeds by encoders)", (Coordinate(name, "", 1.0),)
    return Candidate(name, title, coordinates, move, as_well_as="payload", most=_TREAD)


def _drives(robot: Robot) -> list[Candidate]:
    """The torque of each of several drives: one gear that is worn, one motor that is hot."""
    drives, axes = drive_names(robot), robot.drive_axes
    if len(drives) < 2 or refusal(TorqueShare(), robot) is not None or not one_torque_each(robot):
        return []
    words = axes_in_words(robot) if len(axes) == len(drives) else [in_words(name) for name in drives]
    found = []
    for i, word in enumerate(words):
        name = f"drive_of_{word.removeprefix('the ').replace(' ', '_')}"
        effect = TorqueShare(of=i).standing_as(f"{name}.{TorqueShare.id}")
        found.append(replace(_of_effects(robot, name, f"drive torque of {word}", [effect]), beside=True))
    return found


def _friction(robot: Robot, identifier: str, title: str, groups: Sequence[Sequence[int]]) -> Candidate | None:
    """Coulomb and viscous friction of each of the `groups` of axes, by shares of its own."""
    parts: list[Effect] = []
    for axes in groups:
        end = "" if len(groups) == 1 else f"_{axes[0] + 1}"
        for kind in (DryShare, ViscousShare):
            effect = kind(axes=tuple(axes))
            parts.append(effect.standing_as(f"{identifier}{end}.{effect.id}"))
    parts = [effect for effect in parts if refusal(effect, robot) is None]
    return _of_effects(robot, identifier, title, parts) if parts else None


def _of_effects(robot: Robot, identifier: str, title: str, effects: Sequence[Effect], tied: bool = False) -> Candidate:
    parameters = {name: p for effect in effects for name, p in effect.parameters(robot).items()}
    free = {name: p for name, p in parameters.items() if p.free}
    if tied:
        names, first = list(free), next(iter(free.values()))
        coordinate = Coordinate(identifier, first.unit, first.typical or 1.0)
        return Candidate(
            identifier, title, (coordinate,), lambda numbers, d: dict.fromkeys(names, float(d[0])), tuple(effects)
        )
    coordinates = tuple(Coordinate(name, p.unit, p.typical or 1.0) for name, p in free.items())
    return Candidate(identifier, title, coordinates, _put(list(free)), tuple(effects))


def _causes(robot: Robot) -> list[Candidate]:
    """What one cause moves together, and what has no parameter of its own in the robot."""
    table, found = robot.parameters, []
    load = [name for name in robot.mechanisms.get("payload_change", ()) if name in table]
    if load:
        mass = _of_parameters(robot, load[0], _worded(robot, load[0]), load[:1])
        found.append(replace(mass, usual=len(load) == 1))
    if len(load) > 1:
        found.append(replace(_of_parameters(robot, "payload", "payload", load[:2]), usual=True))
        if robot.drive_axes and set(robot.velocities) <= set(robot.channels.outputs):
            found.append(_all_radii(load[:2]))
    if len(load) > 2:
        found.append(_of_parameters(robot, "payload_off_centre", "payload, and where it lies", load))
    gain = CommandGain()
    if refusal(gain, robot) is None and robot.drive_inputs:
        found.append(replace(_of_effects(robot, "command_gain", "supply or command gain", [gain]), usual=True))
    mismatch = robot.mechanisms.get("wheel_radius_mismatch", ())
    if len(mismatch) == 1 and robot.with_larger_wheels(table.numbers, 0.1):
        for sign, side in zip((1.0, -1.0), robot.wheel_sides, strict=True):
            name = f"radius_of_{side.replace(' ', '_')}"
            move = _one_side(robot, mismatch[0], sign)
            found.append(Candidate(name, f"radius of the {side}", (Coordinate(name, "", 1.0),), move))
    found += _drives(robot)
    axes = robot.drive_axes
    every = _friction(robot, "friction", "friction of all drive axes", [axes]) if axes else None
    found += [replace(every, usual=True)] if every else []
    if len(axes) > 1:
        each = [
            _friction(robot, f"friction_of_{word.removeprefix('the ').replace(' ', '_')}", f"friction of {word}", [[i]])
            for i, word in zip(axes, axes_in_words(robot), strict=True)
        ]
        each.append(_friction(robot, EACH, "friction of each drive axis", [[i] for i in axes]))
        found += [one for one in each if one is not None]
    return found


def _of_added(robot: Robot) -> list[Candidate]:
    """Each effect that the model has, all of its numbers together: friction that falls with speed and grew."""
    found = []
    for effect in robot.effects:
        names = [name for name, p in effect.parameters(robot).items() if p.free and name in robot.parameters]
        if len(names) > 1:
            found.append(of_numbers(robot, effect.id, names))
    return found


def of_numbers(robot: Robot, mechanism: str, names: Sequence[str]) -> Candidate:
    """What the model has of a mechanism, these numbers of it together."""
    return _of_parameters(robot, mechanism, in_words(mechanism), names)


def _parameters(robot: Robot) -> list[Candidate]:
    """Every number of the model, each by itself."""
    return [_of_parameters(robot, name, _worded(robot, name), [name]) for name in robot.parameters]


def is_only_later(candidate: Candidate) -> bool:
    """Whether it makes the same motion later and changes nothing else."""
    return bool(candidate.effects) and all(effect.only_later for effect in candidate.effects)


def of_mechanism(effect: Effect, robot: Robot, side: Side, start: Mapping[str, float] | None = None) -> Candidate:
    """An effect of the catalogue that came (`side` after) or went (before)."""
    word = "appeared" if side == "after" else "vanished"
    found = _of_effects(robot, effect.id, f"{in_words(effect.id)} that {word}", [effect])
    values = tuple((start or {}).get(c.name, 0.0) for c in found.coordinates)
    return replace(found, side=side, start=values)


def both(first: Candidate, second: Candidate) -> Candidate:
    """Two candidates of one side that have changed together."""
    k = len(first.coordinates)

    def move(numbers: Numbers, d: Float[np.ndarray, " k"]) -> dict[str, float]:
        moved = first.move(numbers, d[:k])
        return {**moved, **second.move({**numbers, **moved}, d[k:])}

    return Candidate(
        f"{first.id}+{second.id}",
        f"{first.title} and {second.title}",
        first.coordinates + second.coordinates,
        move,
        (*first.effects, *(effect for effect in second.effects if effect not in first.effects)),
        first.side,
        parts=(first, second),
    )


def candidates_of(robot: Robot) -> list[Candidate]:
    """Everything but the catalogue's mechanisms, causes first; one of each set of coordinates."""
    found: dict[tuple[str, ...], Candidate] = {}
    for candidate in (*_causes(robot), *_of_added(robot), *_parameters(robot)):
        found.setdefault(tuple(c.name for c in candidate.coordinates), candidate)
    return list(found.values())


def mechanisms_of(robot: Robot) -> list[Effect]:
    """Mechanisms of the catalogue that the robot lacks and that are no parameters of its own; not those that repeat with the
    wheels' angles, for which these would have to be prescribed."""
    return [e for e in catalogue(robot) if not isinstance(e, OwnParameter) and not e.repeats]


__all__ = [
    "Candidate",
    "Coordinate",
    "Side",
    "both",
    "candidates_of",
    "is_only_later",
    "mechanisms_of",
    "of_mechanism",
    "of_numbers",
]
