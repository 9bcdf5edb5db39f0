"""A parameter of an effect held at zero where the others can all change together with it without being seen.

What is lost of a force in proportion to it is a smaller gain of all that the force moves: a mass, its friction and its drag;
and so is what several motors have alike. Where a first look from far off has not seen that an effect holds such a scale,
nothing of the model is identified though it predicts well. With one number held there is one answer, of the same motion.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ...effects.curve import Curve
from ...estimate.result import Fit
from ...logs import LogSet
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..policy import current_policy
from ..search.denser import with_denser_curve
from .candidate_refits import Report
from .moving_alike import values_moving_alike
from .refit import Trial, continued, refit_from_itself

_MORE = 0.02
"""Share of what is asked for beyond which a limit that gives more is none."""
_DENSER = 2
"""Times that the points of a curve are doubled that is to follow alone what several do."""
_MANY = 10.0
"""Usual sizes beyond which a number is not what an effect of that name has."""


def with_parameters_held(
    trial: Trial, logs: LogSet, held_out: LogSet, noise: Mapping[str, float], say: Report = lambda message: None
) -> Trial:
    """The trial with what each of its effects `may_hold` held at zero, one number after another, where that is the likelier
    model, or, of a number that is far from none, where that leaves nothing to be explained of the logs fitted, or, of a limit
    that gives more than is asked of it, no more than a curve of few points may."""
    for effect in trial.robot.effects if not trial.angles else ():
        if isinstance(effect, Curve):
            trial = _with_fewer_curves(trial, effect, logs, held_out, noise, say)
        asked = set[str]()
        # Of what is left where one is held another may be.
        while names := [name for name in effect.may_hold(trial.robot) if name not in asked]:
            name = names[0]
            asked.add(name)
            say(f"refitting with a parameter of {effect.title} held")
            robot = trial.robot.with_values(**{name: 0.0}).change(name, free=False)
            again = refit_from_itself(robot, trial, logs, held_out, noise)
            if other := values_moving_alike(trial.robot, name, 0.0, logs):
                elsewhere = refit_from_itself(robot.with_values(**other), trial, logs, held_out, noise)
                again = min(again, elsewhere, key=lambda one: one.score)
            again = continued(again, logs, held_out, noise)
            coarse = again.fitted.normalised_rms < current_policy().coarse_curve
            impossible = coarse and _gives(trial.robot, effect, name)
            if again.score < trial.score or impossible or (_far(trial, name) and _nothing_left(again)):
                trial = replace(again, id=trial.id)
    return trial


def _with_fewer_curves(
    trial: Trial,
    effect: Curve,
    logs: LogSet,
    held_out: LogSet,
    noise: Mapping[str, float],
    say: Report,
) -> Trial:
    """The trial without those of an effect's curves that `may_be_none`, one after another, where that is the likelier model."""
    while others := effect.may_be_none(trial.robot):
        say(f"refitting with one of {effect.title}'s curves held")
        found = []
        for held, values in others:
            robot = trial.robot.with_values(**dict.fromkeys(held, 0.0), **values)
            for name in held:
                robot = robot.change(name, free=False)
            again = continued(refit_from_itself(robot, trial, logs, held_out, noise), logs, held_out, noise)
            # Two curves of few points may follow what one of them, through more points, follows alone.
            for _ in range(_DENSER):
                if again.score < trial.score:
                    break
                dense = refit_from_itself(with_denser_curve(again.robot, effect.id), again, logs, held_out, noise)
                if not dense.score < again.score:
                    break
                again = dense
            found.append(again)
        best = min(found, key=lambda one: one.score)
        if not best.score < trial.score:
            break
        trial = replace(best, id=trial.id)
        effect = next(own for own in trial.robot.effects if isinstance(own, Curve) and own.id == effect.id)
    return trial


def _place(robot: Robot, effect: Curve, name: str) -> float:
    """Where the height `name` of a curve stands, in the unit of what it is a curve of."""
    place = next(
        effect.places[k] for one in effect.each(robot) for k in effect.varying if effect.height(k, one) == name
    )
    return place * robot.parameters[effect.key("reach")].value


def _gives(robot: Robot, effect: Effect, name: str) -> bool:
    """Whether a limit's curve gives more than is asked for where little is."""
    if not isinstance(effect, Curve) or not effect.begins_later:
        return False
    return robot.parameters[name].value < -_MORE * _place(robot, effect, name)


def _far(trial: Trial, name: str) -> bool:
    """Whether a parameter has become many times what it usually is."""
    parameter = trial.robot.parameters[name]
    return abs(parameter.value) > _MANY * (parameter.typical or np.inf)


def _nothing_left(trial: Trial) -> bool:
    return trial.fitted.adequate or trial.fitted.normalised_rms < current_policy().small


def settled(final: Fit) -> bool:
    """Whether the fit tells what its formulas might hold. Of most curves a height that is held says what their form is not to
    be, which is done only where the data does not even tell that there is such an effect; a limit's takes nothing of what is
    small."""
    every = final.robot.effects
    own = (e for e in every if not isinstance(e, Curve) or e.settled_by_holding or e.begins_later)
    may = [name for effect in own for name in effect.may_hold(final.robot)]
    # The places of a curve's points are in units of what it is a curve of: to another scale of all, it is another curve, and
    # nearer to nature's by chance.
    by_places = any(isinstance(effect, Curve) for effect in every) and any(name in final.free_names for name in may)
    return not by_places and not any(final[name].status == "not_identifiable" for name in may)
