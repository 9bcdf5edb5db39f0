"""Which of several motors, or sensors, is the nominal one: a convention, on which numbers of the robot hang.

Where the robot's own parameters are free, the data tells only by how much one motor is stronger than another: all of them
stronger is a lighter robot that rubs less. One of the shares is held at zero then, and which one is for nobody to say.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from ...estimate.result import Fit
from ...logs import LogSet
from ...robots.effect import Effect, in_words
from ...robots.robot import Robot
from ..refits.candidate_refits import Report
from ..refits.refit import Trial, refit_from_itself
from ..search.telling_apart import told_apart_from
from .hinging import Hinging, hinging

_TELLS = "these logs tell only by how much one differs from another"


def with_another_nominal(
    final: Fit,
    last: Trial,
    logs: LogSet,
    held_out: LogSet,
    noise: Mapping[str, float],
    say: Report = lambda message: None,
) -> Hinging:
    """`final` with standard errors of all other parameters that allow for each other motor, or sensor, being the nominal one,
    with a sentence. `last` is the trial that `final` is the fit in full of."""
    said = []
    for effect in last.robot.effects if not last.angles else ():
        others = {}
        counted = {words: last.robot.with_values(**v) for words, v in effect.conventions(last.robot).items()}
        for words, robot in (*_others(last.robot, effect), *counted.items()):
            say(f"refitting {effect.title} as if {words}")
            again = refit_from_itself(robot, last, logs, held_out, noise)
            if not told_apart_from(last, replace(again, id=last.id)):
                others[words] = again.robot
        own = {name for name in final.free_names if name.startswith(effect.key(""))}
        final, sentence = hinging(final, last, others, own, f"what is nominal: of {in_words(effect.id)} {_TELLS}")
        said.append(sentence)
    return Hinging(final, " ".join(filter(None, said)))


def _others(robot: Robot, effect: Effect) -> Iterator[tuple[str, Robot]]:
    """Models in which another share is none, the least and the largest of them, with what that means: from where the shares
    differ as much as they do; where one of each unit is none, another of the same."""
    table, words = robot.parameters, effect.either_nominal(robot)
    every_held = [name for name in words if not table[name].free and table[name].value == 0.0]
    units = {name: _unit(robot, name) if len(every_held) > 1 else "" for name in words}
    for held in every_held:
        free = {name: table[name].value for name in words if table[name].free and units[name] == units[held]}
        if len(free) + 1 != list(units.values()).count(units[held]) or not free:
            continue
        for name in dict.fromkeys(chosen(free, key=lambda name: free[name]) for chosen in (min, max)):
            scale = 1.0 + free[name]
            if not scale > 0.0:
                continue  # dead, or the other way round: not what the others are measured by
            values = {other: (1.0 + value) / scale - 1.0 for other, value in {**free, held: 0.0}.items()}
            other = robot.with_values(**values).change(held, free=True).change(name, free=False)
            yield words[name], other


def _unit(robot: Robot, name: str) -> str:
    """The unit of the sensor that a share is of: of several units, one sensor of each is the nominal one."""
    return next((unit for channel, unit in robot.channels.units.items() if name.endswith(f"_{channel}")), "")
