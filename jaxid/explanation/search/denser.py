"""Curves through more points, or one for each axis, where few, or one for all, have left something that these follow; and
formulas with further terms where there are such."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..._float64 import in_float64
from ...effects.curve import Curve, curve
from ...parameters import ParameterTable
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..refits.refit import Trial
from .telling_apart import told_apart_from

_MOST = 2
"""Times that the points of a curve are doubled."""
_FARTHER = 2.0
"""Times that a curve with twice as many points reaches farther."""
_MOST_HEIGHTS = 64
"""Heights of all its curves together beyond which a mechanism gets no more: they would follow whatever is missing."""


def bare_of(robot: Robot, effect: Effect) -> Robot:
    """`robot` without one of its effects."""
    kept = {name: p for name, p in robot.parameters.items() if not name.startswith(effect.key(""))}
    others = tuple(own for own in robot.effects if own is not effect)
    return replace(robot, effects=others, parameters=ParameterTable(kept))


def _curve_of(robot: Robot, identifier: str) -> Curve:
    effect = next(effect for effect in robot.effects if effect.id == identifier)
    assert isinstance(effect, Curve)
    return effect


@in_float64
def with_curves_apart(robot: Robot, identifier: str) -> Robot:
    """`robot` with a curve of its own for every part of it (`Curve.parts`), all of them what the one for all was."""
    shared, table = _curve_of(robot, identifier), robot.parameters
    own = replace(shared, apart=True)
    found = bare_of(robot, shared) + own
    values = {n: p.value for n, p in table.items() if n.startswith(shared.key("")) and n in found.parameters}
    for kind in shared.kinds:
        for k in shared.varying:
            known = table[shared.height(k, kind)]
            for part in shared.parts(robot):
                name = own.height(k, own.of(part, kind))
                # Of another unit: a moment is not what a force is.
                alike = found.parameters[name].unit == known.unit
                values[name] = known.value if alike else 0.0
                found = found if known.free else found.change(name, free=False)
    return found.with_values(**values)


@in_float64
def with_denser_curve(robot: Robot, identifier: str) -> Robot:
    """`robot` with its curve `identifier` through twice as many points: the same curve, what was held still held."""
    coarse, table = _curve_of(robot, identifier), robot.parameters
    dense = coarse.denser
    found = bare_of(robot, coarse) + dense
    values: dict[str, float] = {}
    for name in coarse.each(robot):
        heights = [
            table.numbers[coarse.height(k, name)] if k in coarse.varying else 0.0 for k in range(len(coarse.places))
        ]
        for k in dense.varying:
            between = float(curve(np.float64(dense.places[k]), coarse.places, heights, 1.0))
            values[dense.height(k, name)] = between if k % 2 else heights[k // 2]
        held = [k for k in coarse.varying if not table[coarse.height(k, name)].free]
        whole = len(held) == len(coarse.varying)  # one that is nothing stays nothing
        for k in dense.varying if whole else [2 * k for k in held]:
            found = found.change(dense.height(k, name), free=False)
    heights_of_both = {*values, *(coarse.height(k, name) for name in coarse.each(robot) for k in coarse.varying)}
    own = {n: p.value for n, p in table.items() if n.startswith(coarse.key("")) and n not in heights_of_both}
    return found.with_values(**values, **own)


def may_be_denser(robot: Robot, curve: Curve) -> bool:
    """Whether a curve with twice as many points has not too many."""
    return 2 * len(curve.each(robot)) * len(curve.varying) <= _MOST_HEIGHTS


def may_reach_farther(robot: Robot, effect: Effect) -> bool:
    """Whether an effect is a curve whose reach was chosen among several (`Curve.reaches`), and none beyond these."""
    if not isinstance(effect, Curve) or len(effect.reaches) < 2:
        return False
    name = effect.key("reach")
    farthest = max(effect.reaches) * effect.parameters(robot)[name].value
    return robot.parameters[name].value / farthest < 0.5 * (1.0 + _FARTHER)


@in_float64
def with_farther_reach(robot: Robot, identifier: str) -> Robot:
    """`robot` with its curve `identifier` through twice as many points on a reach that is twice as long: the same curve."""
    dense = _curve_of(with_denser_curve(robot, identifier), identifier)
    coarse, numbers = _curve_of(robot, identifier), robot.parameters.numbers
    found, reach = bare_of(robot, coarse) + dense, coarse.key("reach")
    heights = {
        dense.height(k, name): float(coarse.at(np.float64(_FARTHER * dense.places[k] * numbers[reach]), numbers, name))
        for name in coarse.each(robot)
        for k in dense.varying
    }
    known = {reach, *heights, *(coarse.height(k, name) for name in coarse.each(robot) for k in coarse.varying)}
    own = {n: v for n, v in numbers.items() if n.startswith(coarse.key("")) and n not in known}
    return found.with_values(**heights, **own, **{reach: _FARTHER * numbers[reach]})


@in_float64
def with_further_terms(robot: Robot, identifier: str) -> Robot:
    """`robot` with the denser law of its effect `identifier`: what both have is what it was, the further terms are nothing."""
    plain = next(effect for effect in robot.effects if effect.id == identifier)
    assert plain.denser is not None
    found = bare_of(robot, plain) + plain.denser
    own = {n: p for n, p in robot.parameters.items() if n.startswith(plain.key("")) and n in found.parameters}
    for name, parameter in own.items():
        found = found if parameter.free else found.change(name, free=False)
    return found.with_values(**{name: parameter.value for name, parameter in own.items()})


@in_float64
def with_freer_form(robot: Robot, effect: Effect) -> Robot:
    """`robot` with an effect's `freer` form: what both have by one name is what it was."""
    assert effect.freer is not None
    found = bare_of(robot, effect) + effect.freer
    own = {n: p.value for n, p in robot.parameters.items() if n.startswith(effect.key("")) and n in found.parameters}
    return found.with_values(**own)


def densest(trial: Trial, again: Callable[[Robot, Trial], Trial]) -> Trial:
    """The trial, or one with more points in the curve that it is about, if it is about one, as long as these tell more than
    chance, or with a curve for every part of the robot or one that reaches farther where that does, or with the further terms
    of its formula; `again` refits a robot from its own values, and from the initial states of a trial."""

    for _ in range(_MOST):
        if not _open(trial):
            break
        changes = _changes(trial)
        others = [replace(again(change(trial.robot, trial.id), trial), id=trial.id) for change in changes]
        best = min(others, key=lambda other: other.score)
        if not (best.score < trial.score and told_apart_from(best, trial)):
            break
        trial = best
    return trial


def _changes(trial: Trial) -> tuple[Callable[[Robot, str], Robot], ...]:
    """How its effect may be given more freedom."""
    if not isinstance(trial.effect, Curve):
        return (with_further_terms,)
    apart = (with_curves_apart,) if _parts(trial) else ()
    # What the rest of a curve leaves beyond a reach that is too short would be taken for another effect.
    farther = (with_farther_reach,) if may_reach_farther(trial.robot, trial.effect) else ()
    return (with_denser_curve, *apart, *farther)


def _open(trial: Trial) -> bool:
    """Whether it is about an effect that can be given more freedom, and leaves something."""
    effect = trial.effect
    freer = effect is not None and effect.denser is not None
    if isinstance(effect, Curve) and not may_be_denser(trial.robot, effect):
        return False
    return freer and not trial.fitted.adequate and bool(np.isfinite(trial.score))


def _parts(trial: Trial) -> bool:
    """Whether its curve is shared by several parts of the robot."""
    curve = trial.effect
    return isinstance(curve, Curve) and not curve.apart and len(curve.parts(trial.robot)) > 1
