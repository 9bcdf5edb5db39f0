"""Curves of several mechanisms that are one function of one variable on a robot: one model by several names.

On one axis a drag and a friction that is not proportional to the speed are the same curve, and on a robot whose drive axes are
its body's every one of them is. That is asked of the equations, not of refits: what a curve adds to the accelerations at
states that the logs show is compared with what another mechanism's curve can add there, and other values of the fitted
parameters with it.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..._float64 import in_float64
from ...effects import catalogue, laws_of
from ...effects.curve import Curve
from ...logs import LogSet
from ...robots.effect import Effect, EffectError
from ...robots.robot import Robot
from ...robots.traits import on_whole_signals
from ..refits.moving_alike import Seen, accelerations, seen_in
from ..refits.refit import Trial

Array = NDArray[np.float64]
SPEEDS = ("|speed|", "|v|")
"""Variables of curves that may be of one speed: a drive axis's, and the body's."""
_SAME = 0.01
"""Share of what a curve adds (its square) that another may lack and be the same: what points in other places leave of it."""


def _changes(robot: Robot, names: Sequence[str], seen: Seen) -> Array:
    """What the parameters `names` add to the accelerations of the sliding robot, one by one [names, velocities · N]."""
    return accelerations(robot, names, np.array([robot.parameters[name].value for name in names]), seen)[1].T


def _left(columns: Array, wanted: Array) -> Array:
    """What the columns [n, N] cannot do of what is wanted [N], by least squares."""
    size = np.linalg.norm(columns, axis=1, keepdims=True)
    columns = columns[size[:, 0] > 0] / size[size[:, 0] > 0]
    return wanted - columns.T @ np.linalg.lstsq(columns.T, wanted, rcond=1e-9)[0] if len(columns) else wanted


def _heights(effect: Curve, robot: Robot) -> list[str]:
    return [effect.height(k, name) for name in effect.each(robot) for k in effect.varying]


def each_once(robot: Robot, laws: Sequence[Effect], logs: LogSet) -> list[Effect]:
    """Those of the `laws` that may stand beside the curves of `robot`: no curve of the same variable that one of these has in
    it, or that has one of these in it. Both would share one function in any way, each many times what there is of it."""
    there = [effect for effect in robot.effects if isinstance(effect, Curve) and effect.variable in SPEEDS]
    return [law for law in laws if not any(_one_function(robot, law, own, logs) for own in there)]


@in_float64
def _one_function(robot: Robot, law: Effect, own: Curve, logs: LogSet) -> bool:
    """Whether a law is a curve that can be all that the curve `own` of the robot can, but for its other parameters, or none but
    what that one can be."""
    seen = seen_in(robot, logs) if not robot.controlled else None
    if not isinstance(law, Curve) or law.variable not in SPEEDS or law.id == own.id or seen is None:
        return False
    try:
        model = robot + replace(law, between=own.between)  # through as many points
    except EffectError:
        return False
    curves = [effect for effect in model.effects if isinstance(effect, Curve) and effect.id in (law.id, own.id)]
    heights = [_heights(curve, model) for curve in curves]
    rest = sorted({*model.parameters.free_names} - {name for names in heights for name in names})
    columns = _changes(model, [*heights[0], *heights[1], *rest], seen)
    parts = np.split(columns, np.cumsum([len(names) for names in heights]))
    # Of any heights, and not of those that it has: bent as no other parameter can be.
    bent = [np.tile([curve.places[k] ** 2 for k in curve.varying], len(curve.each(model))) for curve in curves]
    wanted = [heights @ part for heights, part in zip(bent, parts[:2], strict=True)]
    others = [np.concatenate([parts[1 - k], parts[2]]) for k in range(2)]
    return any(np.sum(_left(o, w) ** 2) < _SAME * np.sum(w**2) for o, w in zip(others, wanted, strict=True))


@in_float64
def curves_that_are(before: Trial, after: Trial, promised: Collection[str], logs: LogSet) -> tuple[str, ...]:
    """The ids of mechanisms, of those that `promised` something, whose curves, of no more points, add to the model `before`
    what the curve of `after` does; none where the logs do not show the robot's velocities."""
    curve, robot, bare = after.effect, after.robot, before.robot
    if not isinstance(curve, Curve) or on_whole_signals(curve) or curve.states_on(robot) or after.angles:
        return ()
    seen = seen_in(bare, logs) if not bare.controlled else None
    if seen is None or not bare.drive_axes:
        return ()
    own = _heights(curve, robot)
    values = np.array([robot.parameters[name].value for name in own])
    wanted = values @ _changes(robot, own, seen)
    taken_up = _changes(bare, bare.parameters.free_names, seen)
    whole = float(np.sum(_left(taken_up, wanted) ** 2))
    found = []
    for other in (effect for effect in catalogue(bare) if effect.id in promised):
        law = next((law for law in laws_of(bare, other.id) if isinstance(law, Curve)), None)
        if law is None or other.id == curve.id or on_whole_signals(law) or law.states_on(bare) or "pose" in law.needs:
            continue
        apart = curve.apart and len(law.parts(bare)) > 1
        dense = replace(law, apart=apart, between=curve.between)
        model = bare + dense
        names = _heights(dense, model)
        if len(names) > len(own):
            continue
        columns = np.concatenate([taken_up, _changes(model, names, seen)])
        share = float(np.sum(_left(columns, wanted) ** 2)) / max(whole, 1e-300)
        if share < _SAME:
            found.append(other.id)
    return tuple(found)
