"""A height held at zero in curves whose heights and other parameters can all change together without being seen.

What is lost of a force in proportion to it is a smaller gain of all that the force moves: a mass, its friction and its drag.
Where a first look from far off has not seen that a straight line in a curve is such a scale, nothing of the model is identified
though it predicts well. With one height held there is one answer, of the same motion.
"""

from collections.abc import Mapping
from dataclasses import replace

from ..effects.curve import Curve
from ..logs import LogSet
from .candidate_refits import Report
from .refit import Trial, continued, refit_from_itself


def with_heights_held(
    trial: Trial, logs: LogSet, held_out: LogSet, noise: Mapping[str, float], say: Report = lambda message: None
) -> Trial:
    """The trial with a height held at zero in each of its curves that has none, where that is the likelier model."""
    for effect in trial.robot.effects if not trial.angles else ():
        if not isinstance(effect, Curve) or len(effect.varying) < 2:
            continue
        place = effect.varying[0 if effect.begins_later else -1]
        for name in effect.each(trial.robot):
            if not all(trial.robot.parameters[effect.height(k, name)].free for k in effect.varying):
                continue
            say(f"refitting with a height of {effect.title} held")
            height = effect.height(place, name)
            robot = trial.robot.with_values(**{height: 0.0}).change(height, free=False)
            again = continued(refit_from_itself(robot, trial, logs, held_out, noise), logs, held_out, noise)
            if again.score < trial.score:
                trial = replace(again, id=trial.id)
    return trial
