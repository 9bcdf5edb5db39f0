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
from ...robots.robot import Robot
from ...robots.traits import on_whole_signals
from ..refits.moving_alike import Seen, accelerations, seen_in
from ..refits.refit import Trial
from .denser import with_denser_curve

Array = NDArray[np.float64]
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


@in_float64
def is_another_of_its_curves(robot: Robot, identifier: str, other: str, logs: LogSet) -> bool:
    """Whether what the curve of the effect `identifier` adds to the model is what the curve of another of its effects, through
    as many points, and its own parameters may add: one function by two names, of which either may have any share."""
    curve, second = (next((e for e in robot.effects if e.id == name), None) for name in (identifier, other))
    if not isinstance(curve, Curve) or not isinstance(second, Curve) or robot.controlled:
        return False
    if any(on_whole_signals(e) or e.states_on(robot) for e in (curve, second)):
        return False
    seen = seen_in(robot, logs)
    if seen is None:
        return False
    own = _heights(curve, robot)
    wanted = np.array([robot.parameters[name].value for name in own]) @ _changes(robot, own, seen)
    while len(second.places) < len(curve.places):
        robot = with_denser_curve(robot, other)
        second = next(e for e in robot.effects if e.id == other and isinstance(e, Curve))
    rest = [name for name in robot.parameters if name not in own and robot.parameters[name].free]
    others = sorted({*rest, *_heights(second, robot)})
    left = _left(_changes(robot, others, seen), wanted)
    return bool(np.sum(left**2) < _SAME * np.sum(wanted**2))


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
