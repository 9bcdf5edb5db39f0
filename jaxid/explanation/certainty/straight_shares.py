"""Parameters of the robot itself that share a straight line, or a level, with a curve of an effect.

Viscous friction beside a curve of the speed is one: what the one has more in proportion to the speed the other can have less,
so that the data determines their sum alone; so is Coulomb friction beside a curve that need not be zero at rest. What the final
fit says of either is then a convention, made by how a curve goes on beyond its reach or by a height held at zero, and its
standard error knows nothing of it.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..._float64 import in_float64
from ...effects.curve import Curve
from ...estimate.result import Fit
from ...robots.effect import Numbers
from ...robots.rates_in_motion import rates_in_motion
from ...robots.robot import Robot
from .wider_errors import not_told

_STATES = 64
"""States in which the rates of the robot are compared."""
_SPEEDS = (0.3, 0.03, 3e-3, 3e-4, 3e-5)
"""Shares of the largest speed that these states have at most, the first of them that is within the reach of the curves."""
_STEP = 1e-4
_SAME = 1e-5
"""Share of a change of the rates that differences of `_STEP` leave where two changes are one."""
_SHARES = "Not to be told apart from the curve of"


class Shared(NamedTuple):
    """The parameters of the robot that take part, and the sum that is determined instead, where it is of one with one height:
    `per` times the `height` at the curve's end is added to the first of them."""

    names: tuple[str, ...]
    height: str
    per: float


def without_shared_lines(final: Fit) -> Fit:
    """`final` in which no parameter of the robot counts as identified of which a curve may have a straight share, with a note
    that says what is determined instead."""
    for effect in final.robot.effects:
        shared = _shared(final, effect) if isinstance(effect, Curve) and not effect.begins_later else None
        if shared is None:
            continue
        note = (
            f"{_SHARES} {effect.title}: {', '.join(shared.names)}, of which it may have a share. {_sum(final, shared)}"
        )
        final = replace(not_told(final, shared.names), notes=(*final.notes, note.strip()))
    return final


def shared_lines(final: Fit) -> tuple[str, ...]:
    """The notes of `without_shared_lines` on the final fit."""
    return tuple(note for note in final.notes if note.startswith(_SHARES))


def open_gain(final: Fit) -> str:
    """A sentence on the parameters that a limit's curve leaves open with a gain of all; empty where it leaves none."""
    for effect in final.robot.effects:
        first = effect.may_hold(final.robot) if isinstance(effect, Curve) and effect.begins_later else ()
        if any(final[name].status == "not_identifiable" for name in first if name in final.free_names):
            lost = [n for n in final.free_names if "." not in n and final[n].status == "not_identifiable"]
            if lost:
                return (
                    f"What {effect.title} loses of what is small, in proportion to it, is a smaller gain of all: "
                    f"{', '.join(lost)} and the heights of the curve are known but for a factor that they have in common. A "
                    "mass that is weighed, or a gain that is measured, held in the model, gives the others."
                )
    return ""


def _sum(final: Fit, shared: Shared) -> str:
    """What is determined, in words: one parameter and the share of the curve's end, with their standard error."""
    names = list(final.free_names)
    if not shared.height:
        return "Only their sum with it is determined."
    name, weights = shared.names[0], np.zeros(len(names))
    weights[names.index(name)] = 1.0
    value = final[name].value + shared.per * final.robot.parameters[shared.height].value
    if shared.height in names:
        weights[names.index(shared.height)] = shared.per
    error = float(np.sqrt(max(weights @ final.covariance @ weights, 0.0)))
    unit = f" {final[name].unit}" if final[name].unit else ""
    return f"Only their sum is determined: {name} with the curve's share at its end is {value:.4g} ± {error:.2g}{unit}."


@in_float64
def _shared(final: Fit, effect: Curve) -> Shared | None:
    """Parameters that a straight share of the effect's curves replaces, or a level of theirs, by the rates of the model in
    states within the reach; None where there is none."""
    robot = final.robot.alone  # a controller's equations have no share in it
    numbers = {name: float(value) for name, value in robot.parameters.numbers.items()}
    own = [n for n in numbers if "." not in n and final[n].status in ("identified", "at_bound")]
    patterns, levels = list(_straight(robot, effect)), list(_level(robot, effect))
    if not own or not patterns:
        return None
    rates = _rates(robot)

    def change(of: dict[str, float], share: float) -> Float[np.ndarray, " N"]:
        up, down = ({n: numbers[n] + way * step for n, step in of.items()} for way in (_STEP, -_STEP))
        return (rates({**numbers, **up}, share) - rates({**numbers, **down}, share)) / (2 * _STEP)

    def straight(share: float) -> bool:
        """Whether what the curves have more is in proportion to the speeds in states of this share of the largest, or as much
        at each."""
        pairs = [(change(of, share), change(of, 0.5 * share)) for of in patterns]
        steady = [(change(of, share), change(of, 0.5 * share)) for of in levels]
        every = [(a, a - 2.0 * b) for a, b in pairs] + [(a, a - b) for a, b in steady]
        return all(np.max(np.abs(a)) > 0 and np.max(np.abs(rest)) < _SAME * np.max(np.abs(a)) for a, rest in every)

    share = next((share for share in _SPEEDS if straight(share)), None)
    if share is None:
        return None
    sizes = [abs(numbers[name]) or 1.0 for name in own]
    columns = [change({name: size}, share) for name, size in zip(own, sizes, strict=True)]
    columns += [change(of, share) for of in (*patterns, *levels)]
    matrix = np.stack(columns, axis=1)
    norms = np.linalg.norm(matrix, axis=0)
    if not np.all(np.isfinite(matrix)):
        return None
    _, values, ways = np.linalg.svd(matrix / np.where(norms > 0, norms, 1.0))
    same = ways[values < _SAME * values[0]]
    weighty = [k for k in range(len(own)) if norms[k] > 0 and np.any(np.abs(same[:, k]) > 1e-3)]
    if not weighty or not np.any(np.abs(same[:, len(own) :]) > 1e-3):
        return None
    names = tuple(own[k] for k in weighty)
    if len(patterns) + len(levels) > 1 or len(same) > 1:
        return Shared(names, "", 0.0)
    way = same[0] / norms
    per = -float(way[weighty[0]] / way[-1]) * sizes[weighty[0]]
    (last,) = (height for height, share in patterns[0].items() if share == max(patterns[0].values()))
    return Shared(names, last, per / patterns[0][last])


def _straight(robot: Robot, effect: Curve) -> Iterator[dict[str, float]]:
    """Changes of the heights by which each of its curves has more in proportion to its variable, as long as that is within the
    reach. None where the curve ends at zero, which says that there is nothing beyond."""
    last, table = len(effect.places) - 1, robot.parameters
    for name in effect.each(robot) if not effect.ends else ():
        heights = {effect.height(k, name): effect.places[k] for k in effect.varying}
        typical = table[effect.height(last, name)].typical or 1.0
        if all(k in effect.varying or effect.places[k] == 0.0 for k in range(len(effect.places))):
            yield {height: typical * place for height, place in heights.items()}


def _level(robot: Robot, effect: Curve) -> Iterator[dict[str, float]]:
    """Changes of the heights by which each of its curves has more by as much everywhere. None where the curve ends or begins at
    zero."""
    if effect.ends or 0 not in effect.varying or effect.places[0] != 0.0:
        return
    for name in effect.each(robot):
        heights = [effect.height(k, name) for k in effect.varying]
        if len(heights) == len(effect.places):
            yield {height: robot.parameters[heights[-1]].typical or 1.0 for height in heights}


def _rates(robot: Robot):
    """The rates of the robot's own states, as a function of the parameters and of a share of the speeds, in states drawn from
    the scales of its logs."""
    random, scales = np.random.default_rng(0), robot.scales
    rest = {name: np.full(_STATES, float(value)) for name, value in robot.initial_state().items()}
    fast = {name: scales.output(name) * random.uniform(-1.0, 1.0, _STATES) for name in robot.velocities}
    inputs = [scales.input_of(name) * random.uniform(-1.0, 1.0, _STATES) for name in robot.channels.inputs]
    states = {name: jnp.asarray(values) for name, values in (rest | fast).items()}

    drawn = tuple(jnp.asarray(values) for values in inputs)

    def at(p: Numbers, share: float) -> Float[np.ndarray, " N"]:
        slower = {name: share * values if name in fast else values for name, values in states.items()}
        return np.asarray(rates_in_motion(robot, robot.own_states, slower, drawn, p)).ravel()

    return at
