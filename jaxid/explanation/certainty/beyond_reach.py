"""Numbers of the robot that hang on how a curve goes on beyond its reach.

What is lost of every command in proportion to it is a smaller gain: a lighter robot that rubs less is the same. A curve of what
is lost that is level beyond its reach, which is what a dead zone is, excludes that by its form alone; where it comes there with
a slope, nature's may go on.
"""

from collections.abc import Mapping

from ...effects.actuator.dead_zone import DeadZoneCurve
from ...estimate.result import Fit
from ...logs import LogSet
from ...robots.effect import in_words
from ..refits.candidate_refits import Report
from ..refits.refit import Trial, refit_from_itself
from ..search.telling_apart import told_apart_from
from .hinging import Hinging, hinging


def going_on_beyond(
    final: Fit, last: Trial, logs: LogSet, held_out: LogSet, noise: Mapping[str, float], say: Report
) -> Hinging:
    """`final` with standard errors of the other parameters that allow for such curves to go on beyond their reach as they come
    there, with a sentence. `last` is the trial that `final` is the fit in full of."""
    said = []
    for effect in last.robot.effects if not last.angles else ():
        if not isinstance(effect, DeadZoneCurve):
            continue
        say(f"refitting with {effect.title} that goes on beyond its reach")
        again = refit_from_itself(effect.going_on(last.robot), last, logs, held_out, noise)
        if told_apart_from(last, again):
            continue
        others = {"it goes on as it comes there": again.robot}
        own = {name for name in final.free_names if name.startswith(effect.key(""))}
        on = f"how {in_words(effect.id)} goes on beyond the reach of its curve"
        final, sentence = hinging(final, last, others, own, on)
        said.append(sentence)
    return Hinging(final, " ".join(filter(None, said)))
