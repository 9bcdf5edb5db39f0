"""A formula and another effect in the place of a law of many numbers, such as a curve of every axis of a body.

So free a curve takes up what is no part of its mechanism, too: a drag of the yaw rate by heights of its own takes up the scale
of a gyro. It leaves no more than noise, and the robot's other numbers pay for it. A formula of the same mechanism and one other
effect, with far fewer numbers, that are likelier than the curve are what there is. So are two formulas of other mechanisms that
are likelier than the matrix of a cross talk between four motors.
"""

from collections.abc import Sequence

from ...effects import laws_of
from ...effects.curve import Curve
from ...logs import LogSet
from ...robots.effect import Effect
from ..refits.candidate_refits import Report
from ..refits.refit import Trial
from .formulas import unfitted_without
from .from_the_back import not_present
from .steps import Step
from .telling_apart import told_apart_from
from .two_formulas import formulas_beside, steps_of_two
from .worth import likelier

_MANY = 6
"""Free numbers from which a law may stand for more than its mechanism."""
_OTHERS = 3
"""Mechanisms that came next whose formulas are tried, too, where the curve is not its own mechanism's."""
_FOLLOWED = 2
"""Formulas beside which another effect is asked."""
_NO_WORSE = 1.01
"""Held-out error of the two over the curve's up to which they leave no more than it."""


def by_a_formula_and_another(
    steps: Sequence[Step],
    current: Trial,
    base: Trial,
    effects: Sequence[Effect],
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
) -> tuple[list[Step], Trial]:
    """The steps with a curve of many heights by a formula of its mechanism and another effect, where these two are likelier;
    else as they were. A formula of more than two numbers a motor may be two of other mechanisms."""
    laws_by_name = {e.id: e for e in current.robot.effects if _may_be_more(e, current)}
    place = next((k for k, step in enumerate(steps) if step.chosen.id in laws_by_name), None)
    if place is None or current.angles:
        return list(steps), current
    refits, name = (logs, held_out, noise, say), steps[place].chosen.id
    say(f"looking whether a formula and another effect are what {steps[place].chosen.title} follows")
    bare = unfitted_without(name, current, base)
    names = [name]
    law = laws_by_name[name]
    if not isinstance(law, Curve) or not law.agrees(current.robot):
        # It does not bend as its mechanism does, and may be another's that came near it.
        names += [trial.id for trial in steps[place].trials if trial.id != name][:_OTHERS]
    every = (one for own in names for one in laws_of(bare.robot, own) if (one.id, one.law) != (law.id, law.law))
    own = [one.blurred for one in every if not isinstance(one, Curve) and not one.repeats]
    alone = formulas_beside(bare, own, refits)
    if alone is None:
        return list(steps), current
    found = []
    for first in (alone.laws if len(names) == 1 else alone.ranked)[:_FOLLOWED]:
        others = [e for e in not_present(first.robot, effects, logs) if not isinstance(e, Curve) and e.id != first.id]
        second = formulas_beside(first, others, refits)
        found += [(first, second)] if second is not None else []
    first, second = min(found, key=lambda two: two[1].best.score, default=(None, None))
    if first is None or second is None:
        return list(steps), current
    pair = second.best
    worth = likelier(first, pair, len(second.screened)) and told_apart_from(pair, first)
    no_worse = pair.held_out.normalised_rms <= _NO_WORSE * current.held_out.normalised_rms
    if not (worth and no_worse and pair.score < current.score):
        return list(steps), current
    say(f"{first.title} and {pair.title} instead: held-out {pair.held_out.normalised_rms:.3f} x noise")
    beside = alone._replace(ranked=[first], laws=[first], alike=())
    return steps_of_two(steps, place, beside, second, base, refits), pair


def _may_be_more(law: Effect, trial: Trial) -> bool:
    """Whether a law has so many numbers free that it may stand for more than its mechanism."""
    free = sum(name.startswith(law.key("")) for name in trial.robot.parameters.free_names)
    motors = len(trial.robot.channels.inputs)
    return free >= _MANY and (isinstance(law, Curve) or (free > 2 * motors and not law.repeats))
