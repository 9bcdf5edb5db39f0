"""What later effects make of earlier ones: not needed any more, by another law, or another's name."""

from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ...effects import laws_of
from ...effects.curve import SHAPE, Curve
from ...effects.table_constants import TableConstants
from ...logs import LogSet
from ...robots.effect import Effect, EffectError
from ...robots.robot import Robot
from ...robots.signal_path import overrides
from ..refits.candidate_refits import Report, all_added
from ..refits.refit import Trial, continued, refit, refit_from_itself
from ..screening.screen import Candidate, alike_to, screen
from .denser import densest
from .laws import best_first, by_where_they_bend, rather_of
from .one_of_several import with_one_alone
from .same_curves import each_once
from .steps import Search, Step, laws_in
from .table_constants import constants_instead
from .telling_apart import alike, not_told_apart, simplest_first, supersets, told_apart_from
from .worth import holds_as_well, in_the_running

_RIVALS = 3
"""Most rivals of an effect that are looked at again."""
_NOT_NEEDED = 10.0
"""Score by which a model without an effect may be worse, so that there is no evidence for it."""
_NEAR, _NEAR_A_CURVE = 0.2, 0.5
"""Shares of what an effect gained when it was added that rivals may have lacked: more beside a curve, which followed a part of
what was still missing as well, where a formula could not."""


def with_effects(base: Robot, owners: Mapping[str, Robot]) -> Robot:
    """`base` with the effects that `owners` names and it has not got, each as its owner has it: the values of its parameters,
    and which of them vary (a curve's reach and some of its heights do not)."""
    robot = base
    present = {effect.id for effect in base.effects}
    for identifier, owner in owners.items():
        if identifier in present:
            continue
        robot = robot + next(effect for effect in owner.effects if effect.id == identifier)
        for name in [name for name in robot.parameters if name.startswith(f"{identifier}.")]:
            known = owner.parameters[name]
            robot = robot.change(name, free=known.free).with_values(**{name: known.value})
    return robot


def refitted_like(robot: Robot, like: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]) -> Trial:
    """`robot` refitted from the numbers that it shares with the trial `like`, and from its own where it shares none."""
    known = like.robot.parameters
    own = {effect.id for effect in robot.effects} - {effect.id for effect in like.robot.effects}
    start = {n: p.value for n, p in robot.parameters.items() if p.free}
    start |= {n: known[n].value for n in start if n in known and n.split(".")[0] not in own}
    angles = like.angles if robot.needs("wheel_angles") else None
    return refit(robot, [start], logs, held_out, noise, like.initial_states, angles=angles)


def pruned(current: Trial, base: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float], say: Report) -> Trial:
    """Drop effects that later ones made superfluous."""
    given = {effect.id for effect in base.robot.effects}
    own = [effect.id for effect in current.robot.effects if effect.id not in given]
    for identifier in own[:-1]:
        say(f"refitting without {identifier}")
        kept = {effect.id: current.robot for effect in current.robot.effects if effect.id != identifier}
        trial = refitted_like(with_effects(base.robot, kept), current, logs, held_out, noise)
        if trial.score < current.score + _NOT_NEEDED:
            say(f"{identifier} is not needed any more")
            current = trial
    return current


def pruned_in_the_end(
    steps: list[Step], current: Trial, base: Trial, logs, held_out, noise, say: Report
) -> tuple[list[Step], Trial]:
    """The steps, of several, whose effect the finished model needs: laws that were exchanged, and curves of another, may since
    do what it was added for. Both models are refitted to the end before it is said."""
    for step in steps if len(steps) > 1 else ():
        bare = without(step.chosen.id, current, base, logs, held_out, noise)
        if not bare.score < current.score + _NOT_NEEDED:
            continue
        current = replace(continued(current, logs, held_out, noise), id=current.id)
        bare = continued(bare, logs, held_out, noise)
        if bare.score < current.score + _NOT_NEEDED and holds_as_well(bare, current):
            say(f"{step.chosen.id} is not needed any more")
            current = replace(bare, id=bare.robot.effects[-1].id if bare.robot.effects else "")
    present = {effect.id for effect in current.robot.effects}
    return [step for step in steps if step.chosen.id in present], current


def without(identifier: str, current: Trial, base: Trial, logs, held_out, noise) -> Trial:
    """The model without one of its effects, refitted."""
    owners = {effect.id: current.robot for effect in current.robot.effects if effect.id != identifier}
    return refitted_like(with_effects(base.robot, owners), current, logs, held_out, noise)


def bare_of_the_end(identifier: str, current: Trial, base: Trial) -> Robot:
    """The model without one of its effects, all else as it is; what of the robot's own that effect alone freed as in `base`."""
    owners = {effect.id: current.robot for effect in current.robot.effects if effect.id != identifier}
    robot, known = with_effects(base.robot, owners), current.robot.parameters
    freed = {name for effect in current.robot.effects for name in effect.frees(current.robot)}
    back = {name for name in freed if not robot.parameters[name].free}
    return robot.with_values(
        **{name: known[name].value for name in robot.parameters if name in known and name not in back}
    )


def as_in_the_end(step: Step, found: Search, logs: LogSet, held_out: LogSet) -> tuple[Trial, Trial]:
    """The models without and with the step's effect: those of the step, or where others have since got other laws or names,
    those of the end, since what stood for them has moved the effect as well."""
    final = found.final
    same = step.instead is None and step.after.id == step.chosen.id
    if final is None or same and laws_in(step.before.robot, "") <= laws_in(final.robot, step.chosen.id):
        return step.before, step.after
    noise = found.before.noise
    return without(step.chosen.id, final, found.steps[0].before, logs, held_out, noise), replace(
        final, id=step.chosen.id
    )


def _by_laws(effect: Effect, bare: Trial, logs, held_out, noise, say: Report) -> list[Trial]:
    """The model `bare` with the mechanism of `effect`, by each of its laws that stand beside what is in it: its own and those
    in the running refitted to the end."""
    laws = each_once(bare.robot, [law.blurred for law in laws_of(bare.robot, effect.id)], logs)
    screened = screen(bare.robot, logs, laws, noise, bare.initial_states, bare.angles)
    candidates = [law for candidate in screened for law in (candidate, *candidate.laws)]
    laws = [law for law in candidates if law.gain > 0]
    trials = all_added(bare, laws, logs, held_out, noise, say)
    near = in_the_running(trials, bare)

    def to_the_end(trial: Trial) -> Trial:
        if not trial.score < near and trial.law != effect.law:
            return trial
        ended = continued(trial, logs, held_out, noise)
        return densest(ended, lambda robot, like: refit_from_itself(robot, like, logs, held_out, noise))

    return [to_the_end(trial) for trial in trials]


def by_its_curve(
    identifier: str,
    current: Trial,
    base: Trial,
    logs: LogSet,
    held_out: LogSet,
    noise: dict[str, float],
    say: Report,
    dense: bool = False,
) -> Trial | None:
    """The model with the curve of a mechanism in the place of its formula, if `dense` through as many points as tell more than
    chance; None where it has none that explains anything. It is looked for with the integration steps of the `base`, and with
    those of `current`, where shorter, in the end."""
    fine = current.robot.longest_step
    current = replace(current, robot=replace(current.robot, longest_step=base.robot.longest_step))
    bare = without(identifier, current, base, logs, held_out, noise)
    curves = [law for law in laws_of(bare.robot, identifier) if isinstance(law, Curve)]
    screened = screen(bare.robot, logs, curves, noise, bare.initial_states, bare.angles) if curves else []
    added = all_added(bare, [law for law in screened if law.gain > 0], logs, held_out, noise, say)
    trials = [continued(trial, logs, held_out, noise) for trial in added]
    best = min(trials, key=lambda trial: trial.score, default=None)
    if best is None:
        return None
    if dense:
        best = densest(best, lambda robot, like: refit_from_itself(robot, like, logs, held_out, noise))
    if fine == base.robot.longest_step:
        return best
    finer = replace(best.robot, longest_step=fine)
    return replace(refit_from_itself(finer, best, logs, held_out, noise), id=best.id)


def by_laws_again(
    steps: list[Step], current: Trial, base: Trial, logs, held_out, noise, say: Report, last: bool = False
) -> tuple[list[Step], Trial]:
    """The laws of all effects but the last (or of that, too) chosen anew, now that the others are there: a law that was best
    while another effect was missing may have been so by that effect's doing. The last one's was chosen beside the laws of the
    others, and is chosen anew where one of these has changed."""
    revised = list(steps)
    for place, step in enumerate(steps):
        if place == len(steps) - 1 and not last and revised == steps:
            continue
        effect = next((e for e in current.robot.effects if e.id == step.chosen.id), None)
        if effect is None or len(laws_of(base.robot, step.chosen.id)) < 2 or current.held_out.adequate:
            continue
        say(f"the laws of {step.chosen.id} once more")
        bare = without(effect.id, current, base, logs, held_out, noise)
        trials = _by_laws(effect, bare, logs, held_out, noise, say)
        # Its own law from where the others begin, too: they compare where all were fitted equally well.
        again = next((trial for trial in trials if trial.law == effect.law), None)
        if again is not None and again.score < current.score:
            current = replace(again, id=current.id)
        trials = [trial for trial in trials if trial.law != effect.law and holds_as_well(trial, current)]
        own = best_first([replace(current, id=effect.id), *trials])
        if own[0].law == effect.law or not told_apart_from(own[0], current):
            continue
        say(f"{own[0].title} instead of {effect.title}: held-out {own[0].held_out.normalised_rms:.3f} x noise")
        current = own[0]
        same = tuple(trial.law for trial in alike(own))
        then = next((trial for trial in step.laws if trial.law == own[0].law), None)
        revised[place] = replace(
            step, trials=(own[0], *step.trials[1:]), laws=tuple(own), laws_alike=same, as_it_was=then
        )
    return revised, current


def rather_by_curves(
    steps: list[Step], found: Step, logs: LogSet, held_out: LogSet, noise: dict[str, float], say: Report
) -> tuple[list[Step], Trial] | None:
    """The last of the `steps` by its mechanism's curve, one for each part of the robot, instead of a further name (`found`)
    beside its formula: where one mechanism explains as much, a second name is what the formula had left. None where it does
    not, or is a curve already."""
    step = steps[-1]
    effect = found.before.effect
    curve = next((law for law in laws_of(step.before.robot, step.chosen.id) if isinstance(law, Curve)), None)
    if (
        effect is None
        or effect.id != step.chosen.id
        or isinstance(effect, Curve)
        or curve is None
        or found.before.angles
    ):
        return None
    say(f"{curve.title} of every part instead of {effect.title} and {found.chosen.title}")
    apart = len(curve.parts(step.before.robot)) > 1
    robot = step.before.robot + (replace(curve, apart=True) if apart else curve)
    trial = continued(refit_from_itself(robot, step.before, logs, held_out, noise), logs, held_out, noise)
    if trial.score > found.chosen.score and told_apart_from(found.chosen, trial):
        return None
    say(f"{trial.title} instead: held-out {trial.held_out.normalised_rms:.3f} x noise")
    others = tuple(other for other in step.trials if other.id != trial.id)
    found_again = replace(step, trials=(trial, *others), after=trial, laws=(trial, *step.laws), laws_alike=())
    return [*steps[:-1], found_again], trial


def with_trials(step: Step, trials: list[Trial]) -> Step:
    """The step with other trials first, best first; where another effect is now best, the laws are no longer of the chosen."""
    others = tuple(trial for trial in step.trials if trial.id not in {own.id for own in trials})
    same = trials[0].id == step.chosen.id
    laws, alike_laws = (step.laws, step.laws_alike) if same else ((trials[0],), ())
    equivalent = tuple(name for name in not_told_apart(trials, step.before) if name not in supersets(trials))
    return replace(step, trials=(*trials, *others), equivalent=equivalent, laws=laws, laws_alike=alike_laws)


def rivals_of(step: Step, present: Collection[str]) -> list[Trial]:
    """The rivals of a step's effect that came near it and are not `present` themselves: those first that could not be told
    from it, whatever else did better while later effects were missing."""
    # What was chosen may since have got another law, beside later effects, which the rivals were refitted without; the law that
    # was best then may have had a part of those effects, which rivals with no such law could not have.
    chosen = step.after.score if step.as_it_was is None else max(step.after.score, step.as_it_was.score)
    without = max(t.score for t in (*step.trials[1:], step.after, step.before) if np.isfinite(t.score))
    least = chosen + (_NEAR_A_CURVE if step.chosen.law == SHAPE else _NEAR) * (without - chosen)
    rivals = [t for t in step.trials[1:] if t.score < least and t.id not in present]
    return sorted(rivals, key=lambda t: (t.id not in step.equivalent, t.score))[:_RIVALS]


def with_rivals(
    rivals: Iterable[Trial], instead_of: str, current: Trial, base: Trial, logs, held_out, noise, say: Report
) -> list[Trial]:
    """The model with the effect of each of the rivals in the place of another, refitted; without those that cannot stand
    beside its other effects, such as two that make the same friction one of each axis."""
    models: list[tuple[Trial, Robot]] = []
    for rival in rivals:
        pairs = ((effect.id, current.robot) for effect in current.robot.effects)
        owners = dict((rival.id, rival.robot) if own == instead_of else (own, robot) for own, robot in pairs)
        with suppress(EffectError):
            models.append((rival, with_effects(base.robot, owners)))
    trials = []
    for number, (rival, model) in enumerate(models, start=1):
        say(f"refitting with {rival.title} instead of {instead_of}, {number} of {len(models)}")
        trials.append(replace(refitted_like(model, current, logs, held_out, noise), id=rival.id))
    return trials


def exchanged(
    steps: list[Step], current: Trial, base: Trial, logs, held_out, noise, say: Report
) -> tuple[list[Step], Trial]:
    """Earlier effects exchanged for rivals that came near them, where one explains more now that the last is there, too.

    Else the next name would be looked for beside a wrong one, and stand for what that lacks.
    """
    revised = list(steps)
    for place, step in enumerate(steps[:-1]):
        present = {effect.id for effect in current.robot.effects}
        if step.chosen.id not in present or current.angles or current.held_out.adequate:
            continue
        rivals = rivals_of(step, present)
        trials = with_rivals(rivals, step.chosen.id, current, base, logs, held_out, noise, say)
        # What follows the fitted logs better and does not hold on the others is not what the model gets, and leads nothing.
        holding = [trial for trial in trials if holds_as_well(trial, current)]
        best = min(holding, key=lambda trial: trial.score, default=current)
        if best.score < current.score and told_apart_from(best, current):
            say(f"{best.title} instead of {step.chosen.title}: held-out {best.held_out.normalised_rms:.3f} x noise")
            ranked = sorted([*holding, replace(current, id=step.chosen.id)], key=lambda trial: trial.score)
            bare = without(step.chosen.id, current, base, logs, held_out, noise)
            revised[place] = replace(with_trials(step, ranked), instead=(bare, best))
            current = replace(best, id=current.id)
    return revised, current


def _untried(step: Step, leading: Trial, present: Collection[str]) -> list[Candidate]:
    """What promised to explain like a rival that now comes first, and was not refitted, since another one led."""
    without = {trial.id for trial in step.trials} | set(present)
    return [c for c in alike_to(leading.id, step.screened, without) if c.gain > 0][:_RIVALS]


def _accounts(rival: Trial, final: Trial) -> bool:
    """Whether a rival accounts for what it leaves where the model does, of which that is what chance makes of its delays."""
    scatters = rival.effect is not None and overrides(type(rival.effect), "draws")
    return not final.held_out.by_chance or rival.held_out.adequate or scatters


def reconsidered(
    steps: list[Step], final: Trial, base: Trial, logs, held_out, noise, say: Report
) -> tuple[list[Step], Trial]:
    """Look again at the rivals of each of several effects, now that the others are there.

    A name that came first while another effect was still missing may have won, or lost, by that effect's doing.
    """
    if len(steps) < 2 and not any(step.chosen.id == TableConstants.id for step in steps):
        return steps, final
    revised = []
    for step in steps:
        present = {effect.id for effect in final.robot.effects}
        if step.chosen.id not in present:
            revised.append(step)
            continue
        rivals = rivals_of(step, present)
        trials = [replace(final, id=step.chosen.id)]
        bare = without(step.chosen.id, final, base, logs, held_out, noise)
        # What got another law beside later effects is compared with rivals by theirs, which the same effects may have changed;
        # so is what rivals were refitted beside and has been exchanged since.
        gone = laws_in(step.before.robot, "") - laws_in(final.robot, step.chosen.id)
        anew = (step.chosen.law != step.after.law or bool(gone)) and not final.angles
        for swapped in with_rivals(rivals, step.chosen.id, final, base, logs, held_out, noise, say):
            if anew and swapped.effect is not None:
                others = _by_laws(swapped.effect, bare, logs, held_out, noise, say)
                swapped = best_first([swapped, *(other for other in others if other.law != swapped.law)])[0]
            trials.append(swapped)
            say(f"{swapped.id} instead of {step.chosen.id}: held-out {swapped.held_out.normalised_rms:.3f} x noise")
        if TableConstants.id not in present:
            right = constants_instead(bare, min(trials, key=lambda t: t.score), logs, held_out)
            if right is not None:
                say(
                    f"other constants instead of {step.chosen.id}: held-out {right.held_out.normalised_rms:.3f} x noise"
                )
                trials.append(right)
        leading = min(trials, key=lambda t: t.score)
        if leading.id != step.chosen.id and step.chosen.effect is not None and not final.angles:
            # Its law was chosen while others were missing, as the one that leads now had not been.
            laws = _by_laws(step.chosen.effect, bare, logs, held_out, noise, say)
            own = best_first([trials[0], *(trial for trial in laws if trial.law != trials[0].law)])
            trials = [own[0], *trials[1:]]
        trials = [t if t is leading else with_one_alone(t, leading, logs, held_out, noise) for t in trials]
        leading = min(trials, key=lambda t: t.score)
        if leading.id != step.chosen.id and not final.angles:
            for other in _untried(step, leading, present):
                laws = _by_laws(other.effect, bare, logs, held_out, noise, say)
                trials += best_first(laws)[:1]
        whose = None if final.angles else rather_of(leading)
        if whose is not None and whose not in present:
            say(f"{whose} by its laws instead of {leading.title}")
            laws = _by_laws(laws_of(bare.robot, whose)[0], bare, logs, held_out, noise, say)
            trials = [*(t for t in trials if t.id != whose), *best_first(laws)[:1]]
        refitted = {t.id for t in trials}
        trials = [t for t in trials if t.id == step.chosen.id or holds_as_well(t, final) and _accounts(t, final)]
        # What was not told from it while others were missing, and does not hold beside them, is told from it now.
        refuted = refitted - {t.id for t in trials}
        step = replace(step, equivalent=tuple(name for name in step.equivalent if name not in refuted))
        mechanisms = by_where_they_bend([[trial] for trial in sorted(trials, key=lambda t: t.score)], bare)
        trials = simplest_first([own[0] for own in mechanisms])
        final = trials[0]
        if len(trials) > 1:
            renamed = trials[0].id != step.chosen.id
            step = with_trials(step, trials)
            step = replace(step, instead=(bare, trials[0])) if renamed else step
        revised.append(step)
    return revised, final
