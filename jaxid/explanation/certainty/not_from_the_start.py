"""Numbers of the robot that hang on constants of its table where a limit's curve takes up that one is wrong.

What limits a voltage or a force takes hardly anything of what is small: of a smooth characteristic, as its cube. A curve that
takes more, or gives more than was asked for, makes all that moves the robot weaker or stronger: just what a mass makes that is
not the table's. The fit is good then, and friction and back-EMF beside it are off by many of their standard errors.
"""

from collections.abc import Mapping
from dataclasses import replace

from ...effects.curve import Curve
from ...estimate.result import Fit
from ...logs import LogSet
from ...robots.effect import in_words
from ...robots.robot import Robot
from ..refits.candidate_refits import Report
from ..refits.refit import Trial, refit_from_itself
from ..search.said_of_constants import by_how_much
from ..search.table_constants import BELIEVABLE, constants_like
from ..search.telling_apart import told_apart_from
from .hinging import Hinging, hinging


def _smooth(effect: Curve, start: str, robot: Robot) -> bool:
    """Whether what a limit's curve takes at its first height, `start`, is what the cube makes of the next one, or less."""
    heights = {effect.height(k, name): effect.places[k] for name in effect.each(robot) for k in effect.varying}
    names, table = list(heights), robot.parameters
    second = names[names.index(start) + 1]
    return 0.0 <= table[start].value <= (heights[start] / heights[second]) ** 3 * table[second].value


def with_nothing_from_the_start(
    final: Fit,
    last: Trial,
    logs: LogSet,
    held_out: LogSet,
    noise: Mapping[str, float],
    say: Report = lambda message: None,
) -> Hinging:
    """`final` with standard errors that allow for the constants of the table which, being wrong, do what a limit's curve does
    of what is small, with a sentence. `last` is the trial that `final` is the fit in full of."""
    said = []
    for effect in last.robot.effects if not last.angles else ():
        if not isinstance(effect, Curve) or not effect.begins_later:
            continue
        table, starts = last.robot.parameters, effect.may_hold(last.robot)
        if not starts:
            continue
        # Of several, the one that takes least, or gives most: where it takes nothing, none gives more than was asked for.
        least = min(starts, key=lambda name: table[name].value)
        if _smooth(effect, least, last.robot):
            continue
        robot = last.robot.with_values(**{least: 0.0}).change(least, free=False)
        say(f"refitting {effect.title} that begins later, with constants of the table wrong")
        begun = replace(refit_from_itself(robot, last, logs, held_out, noise), id=effect.id)
        if not told_apart_from(last, begun):
            continue  # it may well begin later
        others = {
            " and ".join(
                f"{n} is another ({by_how_much(n, share, last.robot)})" for n, share in wrong.shares.items()
            ): wrong.robot
            for wrong in constants_like(begun, replace(last, id=effect.id), logs, held_out)
            if max(map(abs, wrong.shares.values())) < BELIEVABLE
        }
        own = {name for name in table if name.startswith(effect.key(""))}
        on = f"constants of the table, since {in_words(effect.id)} by this curve changes what is small, too"
        final, sentence = hinging(final, last, others, own, on)
        said.append(sentence)
    return Hinging(final, " ".join(filter(None, said)))
