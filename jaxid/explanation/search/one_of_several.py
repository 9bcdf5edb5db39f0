"""A law with a number for each of several things, such as every channel's scale, of which one alone explains as much.

Beside a rival of one number such a law fits as well and pays for the others, so that it would be told apart by their price.
"""

from dataclasses import replace

from ...effects.curve import Curve
from ...logs import LogSet
from ..policy import current_policy
from ..refits.refit import Trial, continued, refit_from_itself


def with_one_alone(trial: Trial, best: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> Trial:
    """The trial with all numbers of its effect but the strongest held at none, where it fits about as well as `best` and is
    told from it by its number of parameters alone; else the trial."""
    effect, table = trial.effect, trial.robot.parameters
    certain = (2 * current_policy().separated) ** 2
    if effect is None or isinstance(effect, Curve) or trial.free <= best.free or trial.score - best.score < certain:
        return trial
    if trial.squares - best.squares >= certain:
        return trial
    signed = {n: p for n, p in table.items() if n.startswith(effect.key("")) and p.free and p.lower < 0.0 < p.upper}
    if len(signed) < 2:
        return trial
    strongest = max(signed, key=lambda name: abs(signed[name].value) / (signed[name].typical or 1.0))
    robot = trial.robot
    for name in signed:
        if name != strongest:
            robot = robot.with_values(**{name: 0.0}).change(name, free=False)
    alone = continued(refit_from_itself(robot, trial, logs, held_out, noise), logs, held_out, noise)
    return replace(alone, id=trial.id) if alone.score < trial.score else trial
