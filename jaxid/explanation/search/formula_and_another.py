"""A formula and another effect in the place of a curve of many heights, such as one of every axis of a body.

So free a curve takes up what is no part of its mechanism, too: a drag of the yaw rate by heights of its own takes up the scale
of a gyro. It leaves no more than noise, and the robot's other numbers pay for it. A formula of the same mechanism and one other
effect, with far fewer numbers, that are likelier than the curve are what there is.
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
"""Free heights from which a curve may stand for more than its mechanism."""
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
    else as they were."""
    curves = {e.id: e for e in current.robot.effects if isinstance(e, Curve) and _heights(e, current) >= _MANY}
    place = next((k for k, step in enumerate(steps) if step.chosen.id in curves), None)
    if place is None or current.angles:
        return list(steps), current
    refits, name = (logs, held_out, noise, say), steps[place].chosen.id
    say(f"looking whether a formula and another effect are what {steps[place].chosen.title} follows")
    bare = unfitted_without(name, current, base)
    names = [name]
    if not curves[name].agrees(current.robot):
        # It does not bend as its mechanism does, and may be another's that came near it.
        names += [trial.id for trial in steps[place].trials if trial.id != name][:_OTHERS]
    laws = (law for own in names for law in laws_of(bare.robot, own))
    own = [law.blurred for law in laws if not isinstance(law, Curve) and not law.repeats]
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


def _heights(curve: Curve, trial: Trial) -> int:
    """How many numbers of the curve a model has free."""
    return sum(name.startswith(curve.key("")) for name in trial.robot.parameters.free_names)
