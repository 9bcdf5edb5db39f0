"""From the back: each effect but the last taken out of the model and looked for again, now that the later ones are there.

What was added first was chosen while all the others were still missing, from what promised most then: a curve that follows two
things may have won, and what is right may not even have been refitted. With the others in place, the first look is another.
"""

from collections.abc import Collection, Sequence

from ...effects import catalogue, laws_of
from ...effects.table_constants import TableConstants
from ...logs import Log, LogSet
from ...logs.windows import Windows
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..policy import current_policy
from ..refits.candidate_refits import Report
from ..refits.refit import Trial
from ..screening.first_look import first_look
from .next_name import name_next
from .reconsider import without
from .same_curves import each_once
from .steps import Step

_SAME = 10.0
"""Score (chi-squared) by which a model refitted from another start may differ and be the same one; as in `pruned`."""


def not_present(robot: Robot, effects: Sequence[Effect], logs: Sequence[Log] = ()) -> list[Effect]:
    """The laws that may be added to `robot`: the catalogue's and `effects`, of mechanisms that it has not got, and not upon
    one that it might have and has not; of `logs` that are windows none that counts from the start of the whole ones; no curve
    that the model has by another name."""
    present = {effect.id for effect in robot.effects}
    own = [law for effect in catalogue(robot) for law in laws_of(robot, effect.id)]
    absent = [effect for effect in (*own, *effects) if effect.id not in present]
    absent = [effect for effect in absent if not (effect.since_start and isinstance(logs, Windows))]
    missing = {effect.id for effect in absent}
    found = [effect.blurred for effect in absent if effect.upon not in missing]
    return each_once(robot, found, logs) if isinstance(logs, LogSet) else found


def named_from_the_back(
    steps: list[Step],
    current: Trial,
    base: Trial,
    effects: Sequence[Effect],
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
    confirmed: Collection[str] = (),
) -> tuple[list[Step], Trial]:
    """The steps and their model, effects but the last named anew where another explains more beside the rest.

    Nothing is looked for where only noise is left, nor, where little more than that is, what has been `confirmed` so before.
    `base` is the model without any of them, `effects` are candidates beside the catalogue's.
    """
    revised = list(steps)
    for step in steps[:-1]:
        present = {effect.id for effect in current.robot.effects}
        lasting = step.chosen.id != TableConstants.id and step.chosen.id in present and not current.angles
        if step.chosen.id in confirmed and current.held_out.normalised_rms < current_policy().coarse_law:
            continue
        if not lasting or current.held_out.adequate:
            continue
        say(f"looking for {step.chosen.id} again, beside what was added later")
        bare = without(step.chosen.id, current, base, logs, held_out, noise)
        screened = first_look(bare, logs, not_present(bare.robot, effects, logs), noise, say)
        found = name_next(bare, base, screened, logs, held_out, noise, say)
        if found is None or found.chosen.id == step.chosen.id or found.chosen.in_colour is not None:
            continue
        # Where its own mechanism was refitted as well as before, the order among the trials holds; else the better model.
        again = next((trial for trial in found.trials if trial.id == step.chosen.id), None)
        ranked = again is not None and again.score < current.score + _SAME
        if not ranked and found.chosen.score >= current.score:
            continue
        say(
            f"{found.chosen.title} instead of {step.chosen.title}: held-out {found.chosen.held_out.normalised_rms:.3f} x noise"
        )
        others = [own for own in revised if own is step or own.chosen.id != found.chosen.id]
        revised, current = [found if own is step else own for own in others], found.chosen
    return revised, current
