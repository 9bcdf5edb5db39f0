"""Which side of a line on the floor is the robot's own: that on which it begins.

A floor that is another beyond a line is the same floor with the sides exchanged, and no log tells which of the two the robot's
own friction is of. Whoever reads it takes it for that where the robot starts.
"""

from collections.abc import Mapping

import numpy as np

from ...logs import LogSet
from ...simulation.start import initial_states
from .candidate_refits import Report
from .refit import Trial, refit_from_itself

_WORSE = 1.0
"""Chi-squared by which a model fitted again may be worse and be the same."""


def begun_on_the_near_side(
    trial: Trial, logs: LogSet, held_out: LogSet, noise: Mapping[str, float], say: Report = lambda message: None
) -> Trial:
    """`trial` with the sides of its lines exchanged where most logs begin on a far one, fitted again; as it is where that is
    another model."""
    if trial.angles or not {"x", "y"} <= set(trial.robot.states):
        return trial
    begun = initial_states(trial.robot, logs).states
    x, y = (float(np.median(np.asarray(begun[name], float))) for name in ("x", "y"))
    for effect in trial.robot.effects:
        values = effect.sides_exchanged(trial.robot, x, y)
        if values:
            say(f"refitting with {effect.title}, its sides exchanged")
            other = refit_from_itself(trial.robot.with_values(**values), trial, logs, held_out, noise)
            trial = other if other.score <= trial.score + _WORSE else trial
    return trial
