"""Heights of curves where the logs have nothing: held level with the nearest that the logs tell."""

from collections.abc import Collection, Mapping

from ...effects.curve import Curve
from ...parameters import ParameterTable
from ...robots.robot import Robot

UNSEEN = 0.01
"""Change of a whole simulation, in units of the noise, by a curve's height of typical size, that nobody can see."""
RAN_AWAY = 1e6
"""Typical sizes from which a parameter of an effect ran away. Standard errors of a thousandth of that are common where heights
and a constant friction are hardly told apart, each of which matters."""


def each_curve(robot: Robot) -> list[tuple[Curve, dict[int, str]]]:
    """All curves of `robot`, each with its heights by their places."""
    curves = [effect for effect in robot.effects if isinstance(effect, Curve)]
    return [(c, {k: c.height(k, name) for k in c.varying}) for c in curves for name in c.each(robot)]


def unseen_by(robot: Robot, changes: Mapping[str, float]) -> list[str]:
    """The free heights of which one of typical size changes the simulation by less than anybody can see; `changes` are those
    of it, in units of the noise, per unit of a parameter."""
    table = robot.parameters
    free = [name for _, heights in each_curve(robot) for name in heights.values() if name in changes]
    return [name for name in free if changes[name] * typical(table, name) < UNSEEN]


def ran_away(robot: Robot) -> list[str]:
    """The free heights that a search left beyond any size."""
    table = robot.parameters
    every = (name for _, heights in each_curve(robot) for name in heights.values() if table[name].free)
    return [name for name in every if not abs(table[name].value) <= RAN_AWAY * typical(table, name)]


def typical(table: ParameterTable, name: str) -> float:
    """The typical size of a height."""
    return table[name].typical or 1.0


def held_level(robot: Robot, heights: Collection[str]) -> Robot:
    """`robot` with these heights held, each at the value of the nearest place of its curve that is not among them: beyond
    what it has been tried at, a law goes on as it was, and a search would leave the height anywhere, and with it all that is
    predicted of logs that do get there."""
    values: dict[str, float] = {}
    for curve, own in each_curve(robot):
        told = [k for k in range(len(curve.places)) if own.get(k) not in heights]
        acts = any(k in own for k in told)
        for k in (k for k, name in own.items() if name in heights):
            near = min(told, key=lambda place: abs(curve.places[place] - curve.places[k])) if acts else -1
            values[own[k]] = robot.parameters[own[near]].value if near in own else 0.0
    found = robot.with_values(**values)
    for name in values:
        found = found.change(name, free=False)
    return found
