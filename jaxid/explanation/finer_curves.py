"""A curve in the place of a formula, and through more points, where the robot's own parameters hang on the form of a law.

A search takes the simplest law that leaves no more than noise: a formula, or a curve of few points. What it still lacks is
then no more than noise in the outputs, but the other parameters make up for it, by several of their standard errors, which
know nothing of it. So the final model is fitted once more with the mechanism's curve, and with twice as many points in it: of
two models that are both right, the estimates differ by no more than the additional parameters cost (Hausman 1978,
Econometrica 46). Where they differ by more, the freer curve is the answer, with the wider intervals that belong to it.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..effects import laws_of
from ..effects.curve import Curve
from ..estimate.result import Fit
from ..parameters import ParameterError
from ..robots.robot import Robot
from .denser import MOST_HEIGHTS, with_denser_curve
from .refit import Trial
from .steps import Search

_MOST = 2
"""Times that the points are doubled."""
_APART, _FORMULA = 2.0, 4.0
"""Difference of two estimates, in standard errors of that difference, beyond which fewer points are too few, and a formula not
the law. More points cost nothing but width, a formula is an answer: of right ones 6 in 100,000 parameters have more."""
_LEAST = 0.1
"""Share of the finer model's variance that the difference has at least, where rounding leaves less."""


class Finer(NamedTuple):
    """What was found and its fit in full, with curves through as many points as the robot's own parameters need."""

    found: Search
    final: Fit


def through_enough_points(
    found: Search, final: Fit, in_full: Callable[[Trial], Fit], sure: Callable[[Fit], bool], say: Callable[[str], None]
) -> Finer:
    """The fit `in_full` of what was found, with finer curves where these move the robot's own parameters by more than they
    may, and still say what they said: that there are such effects is `sure`, and no parameter is lost."""
    best = Finer(found, final)
    for identifier in [effect.id for effect in final.robot.effects if isinstance(effect, Curve)]:
        for _ in range(_MOST):
            finer = _finer(best, identifier, in_full, say)
            if finer is None or not sure(finer.final) or not moved(best.final, finer.final):
                break
            say(f"{identifier} needs a curve through more points")
            best = finer
    return best


def instead_of_formulas(
    found: Search,
    final: Fit,
    curve_of: Callable[[str], Trial | None],
    in_full: Callable[[Trial], Fit],
    sure: Callable[[Fit], bool],
    say: Callable[[str], None],
) -> Finer:
    """The fit of what was found with a curve in the place of a formula on whose form the robot's own parameters hang.
    `curve_of` is the model with the curve of a mechanism.

    Asked only of what is limited: its formula and its curve both lose nothing of what is small, so that the other parameters
    mean the same beside either. A curve of the speed shares a part in proportion to it with the viscous friction.
    """
    best = Finer(found, final)
    for step in found.steps:
        effect = next((own for own in final.robot.effects if own.id == step.chosen.id), None)
        if effect is None or isinstance(effect, Curve) or best.found.final is None or best.found.final.angles:
            continue
        limits = any(isinstance(law, Curve) and law.begins_later for law in laws_of(step.before.robot, effect.id))
        trial = curve_of(effect.id) if limits else None
        if trial is None:
            continue
        # Through more points than it needs, so that what it lacks itself does not tell against the formula.
        dense = _dense(trial, trial.robot, effect.id)
        fit = _fitted(dense, in_full) if dense is not None else None
        if fit is not None and sure(fit) and moved(best.final, fit, _FORMULA):
            say(f"the robot's own parameters hang on the form of {effect.title}; its curve in its place")
            # The next one would have to be refitted beside the curve; one formula is what is mostly wrong.
            return Finer(replace(found, final=replace(trial, robot=fit.robot)), fit)
    return best


def _finer(best: Finer, identifier: str, in_full: Callable[[Trial], Fit], say: Callable[[str], None]) -> Finer | None:
    """The same with twice as many points in one curve; None where that is one too many, or leads nowhere."""
    trial = best.found.final
    dense = _dense(trial, best.final.robot, identifier) if trial is not None and not trial.angles else None
    if dense is None:
        return None
    say(f"fitting {identifier} through more points")
    fit = _fitted(dense, in_full)
    return fit and Finer(replace(best.found, final=replace(dense, robot=fit.robot)), fit)


def _dense(trial: Trial, robot: Robot, identifier: str) -> Trial | None:
    """The trial with `robot`'s curve through twice as many points; None where these are too many."""
    curve = next(effect for effect in robot.effects if effect.id == identifier)
    assert isinstance(curve, Curve)
    if 2 * len(curve.each(robot)) * len(curve.varying) > MOST_HEIGHTS:
        return None
    return replace(trial, robot=_held_at_the_first(with_denser_curve(robot, identifier), identifier))


def _fitted(trial: Trial, in_full: Callable[[Trial], Fit]) -> Fit | None:
    """The fit in full of a trial, or None where that leads nowhere."""
    try:
        fit = in_full(trial)
    except ParameterError:
        return None
    return None if fit.failed else fit


def _held_at_the_first(robot: Robot, identifier: str) -> Robot:
    """The robot, of whose curve the height that was the first and is held at zero is estimated, and the one before it held:
    a share of the variable itself is another parameter's, but what is limited loses the less of it the smaller it is."""
    curve = next(effect for effect in robot.effects if effect.id == identifier)
    assert isinstance(curve, Curve)
    for name in curve.each(robot) if curve.begins_later else ():
        before, first = (curve.height(place, name) for place in curve.varying[:2])
        if robot.parameters[before].free and not robot.parameters[first].free:
            robot = robot.with_values(**{before: 0.0}).change(before, free=False).change(first, free=True)
    return robot


def moved(coarse: Fit, fine: Fit, most: float = _APART) -> bool:
    """Whether a parameter of the robot itself is more apart in the two fits than the finer one's further parameters explain (by
    `most` standard errors of the difference); not where the finer one no longer identifies all that the other does."""
    own = [
        name
        for name, estimate in coarse.parameters.items()
        if estimate.status == "identified" and "." not in name and name in fine.parameters
    ]
    if any(fine[name].status != "identified" for name in own):
        return False
    pairs = [(coarse[name], fine[name]) for name in own]
    return any(
        abs(b.value - a.value) > most * np.sqrt(max(b.std_error**2 - a.std_error**2, _LEAST * b.std_error**2))
        for a, b in pairs
    )
