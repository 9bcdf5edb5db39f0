"""Curves through more points, where few have left something that more of them follow."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .._float64 import in_float64
from ..effects.curve import Curve, curve
from ..parameters import ParameterTable
from ..robots.robot import Robot
from .refit import Trial
from .telling_apart import told_apart_from

_MOST = 2
"""Times that the points of a curve are doubled."""


@in_float64
def with_denser_curve(robot: Robot, identifier: str) -> Robot:
    """`robot` with its curve `identifier` through twice as many points: the same curve, what was held still held."""
    coarse = next(effect for effect in robot.effects if effect.id == identifier)
    assert isinstance(coarse, Curve)
    table = robot.parameters
    kept = {name: p for name, p in table.items() if not name.startswith(coarse.key(""))}
    others = tuple(effect for effect in robot.effects if effect is not coarse)
    dense = coarse.denser
    found = replace(robot, effects=others, parameters=ParameterTable(kept)) + dense
    values: dict[str, float] = {}
    for name in coarse.each(robot):
        heights = [
            table.numbers[coarse.height(k, name)] if k in coarse.varying else 0.0 for k in range(len(coarse.places))
        ]
        for k in dense.varying:
            between = float(curve(np.float64(dense.places[k]), coarse.places, heights, 1.0))
            values[dense.height(k, name)] = between if k % 2 else heights[k // 2]
        for k in coarse.varying:
            if not table[coarse.height(k, name)].free:
                found = found.change(dense.height(2 * k, name), free=False)
    heights_of_both = {*values, *(coarse.height(k, name) for name in coarse.each(robot) for k in coarse.varying)}
    own = {n: p.value for n, p in table.items() if n.startswith(coarse.key("")) and n not in heights_of_both}
    return found.with_values(**values, **own)


def densest(trial: Trial, again: Callable[[Robot, Trial], Trial]) -> Trial:
    """The trial, or one with more points in the curve that it is about, if it is about one, as long as these tell more than
    chance; `again` refits a robot from its own values, and from the initial states of a trial."""
    for _ in range(_MOST):
        if not isinstance(trial.effect, Curve) or trial.fitted.adequate or not np.isfinite(trial.score):
            break
        dense = replace(again(with_denser_curve(trial.robot, trial.id), trial), id=trial.id)
        if not (dense.score < trial.score and told_apart_from(dense, trial)):
            break
        trial = dense
    return trial
