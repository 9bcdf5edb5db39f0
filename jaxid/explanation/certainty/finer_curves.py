"""Curves through more points, and wider standard errors beside formulas, where the robot's own parameters hang on a law's form.

A search takes the simplest law that leaves no more than noise: a formula, or a curve of few points. What it still lacks is
then no more than noise in the outputs, but the other parameters make up for it, by several of their standard errors, which
know nothing of it. So the final model is fitted once more with twice as many points in its curve, or with the mechanism's
curve: of two models that are both right, the estimates differ by no more than the additional parameters cost (Hausman 1978,
Econometrica 46). Where they differ by more, the finer curve is the answer. A formula stays, since the outputs do not tell
against it, with standard errors that reach as far as the other form leads.
"""

from collections.abc import Callable
from dataclasses import replace
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from ...effects import laws_of
from ...effects.curve import Curve
from ...estimate.result import Fit
from ...parameters import ParameterError
from ...robots.effect import Effect
from ...robots.robot import Robot
from ..refits.refit import Trial
from ..search.denser import may_reach_farther, with_denser_curve, with_farther_reach, with_freer_form
from ..search.steps import Search, Step
from .wider_errors import not_told, reaching_to

_MOST = 2
"""Times that the points are doubled."""
_MOST_HEIGHTS = 24
"""Heights of all its curves together beyond which a mechanism gets no more: the fit in full then takes minutes."""
_CHANCE = 0.05
"""Share of right models of which a parameter is another one with further points, by chance."""
_HANGS = "The robot's own parameters hang on the form of"
_CERTAIN = 2.0
"""Standard errors by which the parameter of a freer form differs from the formula's."""
_NO_WORSE = 1.05
"""Times what the formula leaves that a freer form may leave, whose fit has ended where the formula's has."""
_LEAST = 0.1
"""Share of the finer model's variance that the difference has at least, where rounding leaves less."""


class Finer(NamedTuple):
    """What was found and its fit in full, with curves through as many points as the robot's own parameters need."""

    found: Search
    final: Fit


def through_enough_points(
    found: Search, final: Fit, in_full: Callable[[Trial], Fit], sure: Callable[[Fit], bool], say: Callable[[str], None]
) -> Finer:
    """The fit `in_full` of what was found, with finer curves where these move the robot's own parameters by more than they
    may, or leave nothing to be doubted where the coarser ones do, and still say what they said: that there are such effects is
    `sure`, and no parameter is lost."""
    best = Finer(found, final)
    for identifier in [effect.id for effect in final.robot.effects if isinstance(effect, Curve)]:
        for change, most in ((with_denser_curve, _MOST), (with_farther_reach, 1)):
            for _ in range(most):
                finer = _finer(best, identifier, change, in_full, say)
                if finer is None or not sure(finer.final):
                    break
                mends = finer.final.trustworthy and not best.final.trustworthy
                if not (mends or (_all_identified(best.final, finer.final) and moved(best.final, finer.final))):
                    break
                say(f"{identifier} needs a curve through more points")
                best = finer
    return best


def by_a_curve_instead(
    found: Search,
    final: Fit,
    curve_of: Callable[[str], Trial | None],
    in_full: Callable[[Trial], Fit],
    say: Callable[[str], None],
) -> Finer:
    """What was found with the curve of a mechanism in the place of its formula, where the fit with the formula is to be doubted
    and that with the curve is not: held-out logs did not show what the fitted ones do."""
    for step in found.steps:
        effect = next((own for own in final.robot.effects if own.id == step.chosen.id), None)
        if effect is None or isinstance(effect, Curve) or found.final is None or found.final.angles:
            continue
        if not any(isinstance(law, Curve) for law in laws_of(step.before.robot, effect.id)):
            continue
        say(f"the fit with {effect.title} is to be doubted; fitting its curve instead")
        curve = curve_of(effect.id)
        if curve is not None and not curve.score < found.final.score:
            continue  # nor is it any better
        for _ in range(1 + _MOST):
            fit = _fitted(curve, effect.id, in_full) if curve is not None else None
            if curve is None or fit is None:
                break
            if fit.sound:
                say(f"the curve of {effect.title} leaves no doubt")
                return Finer(replace(found, final=replace(curve, robot=fit.robot)), fit)
            curve = _dense(replace(curve, robot=fit.robot), fit.robot, effect.id)
    return Finer(found, final)


def widened_by_forms(
    found: Search,
    final: Fit,
    curve_of: Callable[[str], Trial | None],
    in_full: Callable[[Trial], Fit],
    say: Callable[[str], None],
) -> Fit:
    """`final` with standard errors of the robot's own parameters that allow for the form of a formula, and a note on it, where
    they hang on it. `curve_of` is the model with the curve of a mechanism.

    Asked only where the other parameters mean the same beside either: of what is limited, whose formula and curve both lose
    nothing of what is small, and of what both end. Another curve of the speed shares a part in proportion to it with the
    viscous friction.
    """
    for step in found.steps:
        effect = next((own for own in final.robot.effects if own.id == step.chosen.id), None)
        if effect is None or isinstance(effect, Curve) or found.final is None or found.final.angles:
            continue
        fit = _of_another_form(effect, final, found.final, step, curve_of, in_full, say)
        if fit is None or _worse(fit, final) or _same_law(effect, final, fit):
            continue
        if moved(final, fit, lost=effect.freer is not None) or _contradicted(effect, fit):
            say(f"the robot's own parameters hang on the form of {effect.title}")
            final = _widened(final, fit, effect)
    return final


def _worse(fit: Fit, than: Fit) -> bool:
    """Whether a freer form leaves more, since its fit ended elsewhere: it says nothing of the formula then."""
    if fit.judgement is None or than.judgement is None:
        return False
    return fit.judgement.normalised_rms > _NO_WORSE * than.judgement.normalised_rms


def _same_law(effect: Effect, final: Fit, fit: Fit) -> bool:
    """Whether the freer form is the formula, of which another number of it has the place of one of the robot's: that is nothing
    then, and no other is another one."""
    if effect.freer is None or effect.freer.restricts:
        return False
    own = _own(final, fit)
    gone = [n for n in own if fit[n].status == "at_bound" or abs(fit[n].value) <= _CERTAIN * fit[n].std_error]
    kept = {n: e for n, e in final.parameters.items() if n not in gone}
    return bool(gone) and not moved(replace(final, parameters=kept), fit)


def _contradicted(effect: Effect, fit: Fit) -> bool:
    """Whether the freer form is another one than the formula, or one that the formula is no case of."""
    if effect.freer is None:
        return False
    at = {effect.key(name): value for name, value in effect.freer.restricts.items()}
    return not at or any(
        fit[name].status != "not_identifiable" and abs(fit[name].value - value) > _CERTAIN * fit[name].std_error
        for name, value in at.items()
    )


def _of_another_form(
    effect: Effect,
    final: Fit,
    trial: Trial,
    step: Step,
    curve_of: Callable[[str], Trial | None],
    in_full: Callable[[Trial], Fit],
    say: Callable[[str], None],
) -> Fit | None:
    """The fit in full with a freer form of the effect, or with the mechanism's curve; None where there is none to compare."""
    if effect.freer is not None:
        say(f"fitting another form of {effect.title}")
        return _fitted(replace(trial, robot=with_freer_form(final.robot, effect)), effect.id, in_full)
    curves = [law for law in laws_of(step.before.robot, effect.id) if isinstance(law, Curve)]
    curve = curve_of(effect.id) if any(curve.begins_later or curve.ends for curve in curves) else None
    if curve is None:
        return None
    # Through more points than it needs, so that what it lacks itself does not tell against the formula; with the integration
    # steps that the formula was found to need, which would be found anew.
    dense = _dense(curve, replace(curve.robot, longest_step=final.robot.longest_step), effect.id)
    if dense is None:
        return None
    return _fitted(
        replace(dense, robot=_losing_nothing_of_the_small(dense.robot, effect.id, final.robot)), effect.id, in_full
    )


def hangs_on_forms(final: Fit) -> tuple[str, ...]:
    """The notes of `widened_by_forms` on the final fit."""
    return tuple(note for note in final.notes if note.startswith(_HANGS))


def _widened(final: Fit, freer: Fit, effect: Effect) -> Fit:
    """`final` with standard errors of its own parameters that reach to those of the `freer` fit, and have its width; what that
    does not identify is not identified."""
    own = {n: (freer[n].value - final[n].value, freer[n].std_error) for n in _own(final, freer)}
    lost = [n for n in own if freer[n].status == "not_identifiable" or not np.isfinite(freer[n].std_error)]
    form = "a curve in its place"
    if effect.freer is not None:
        form = "another exponent" if "exponent" in effect.freer.formula else "a freer form"
    kept = {n: by for n, by in own.items() if n not in lost}
    told = f"with {form} they would be {', '.join(f'{n} {freer[n].value:.4g}' for n in kept)}" if kept else ""
    told += f"{'; ' * bool(kept)}with {form} {' and '.join(lost)} would not be identified" if lost else ""
    note = f"{_HANGS} {effect.title}: {told}. {'Their standard errors allow' if kept else 'That is allowed'} for that."
    return replace(not_told(reaching_to(final, kept), lost), notes=(*final.notes, note))


def _finer(
    best: Finer,
    identifier: str,
    change: Callable[[Robot, str], Robot],
    in_full: Callable[[Trial], Fit],
    say: Callable[[str], None],
) -> Finer | None:
    """The same with twice as many points in one curve, as `change` places them; None where that is one too many, or leads
    nowhere."""
    trial = best.found.final
    dense = _dense(trial, best.final.robot, identifier, change) if trial is not None and not trial.angles else None
    if dense is None:
        return None
    say(f"fitting {identifier} through more points")
    fit = _fitted(dense, identifier, in_full)
    return fit and Finer(replace(best.found, final=replace(dense, robot=fit.robot)), fit)


def _dense(
    trial: Trial, robot: Robot, identifier: str, change: Callable[[Robot, str], Robot] = with_denser_curve
) -> Trial | None:
    """The trial with `robot`'s curve through twice as many points; None where these are too many, or reach no farther."""
    curve = next(effect for effect in robot.effects if effect.id == identifier)
    assert isinstance(curve, Curve)
    if 2 * len(curve.each(robot)) * len(curve.varying) > _MOST_HEIGHTS:
        return None
    if change is with_farther_reach and not may_reach_farther(robot, curve):
        return None
    return replace(trial, robot=_held_at_the_first(change(robot, identifier), identifier))


def _fitted(trial: Trial, identifier: str, in_full: Callable[[Trial], Fit]) -> Fit | None:
    """The fit in full of a trial with a curve, or None where that leads nowhere. What the curve holds at zero is set to what
    its next height says and the fit repeated."""
    try:
        fit = in_full(trial)
        begun = None if fit.failed else _begun_with_the_cube(fit.robot, identifier)
        fit = in_full(replace(trial, robot=begun)) if begun is not None else fit
    except ParameterError:
        return None
    return None if fit.failed else fit


def _begun_with_the_cube(robot: Robot, identifier: str) -> Robot | None:
    """The robot with the first heights of a limit's curve, where held, at what is lost there of a smooth characteristic; None
    where there is no such height, or nothing is lost at the next one.

    What is lost of an odd function begins with the cube. A loss in proportion to the variable is a smaller gain of all, so
    that the next height is known but for such a share, and the cube says how large it is.
    """
    curve = next(effect for effect in robot.effects if effect.id == identifier)
    if not isinstance(curve, Curve):
        return None
    values: dict[str, float] = {}
    for name in curve.each(robot) if curve.begins_later else ():
        (first, x1), (second, x2) = ((curve.height(k, name), curve.places[k]) for k in curve.varying[:2])
        lost, ratio = robot.parameters[second].value, (x1 / x2) ** 3
        if not robot.parameters[first].free and robot.parameters[second].free and lost > 0.0:
            values[first] = ratio * lost * x1 / (x1 - ratio * x2)
    return robot.with_values(**values) if values else None


def _held_at_the_first(robot: Robot, identifier: str) -> Robot:
    """The robot, of whose curve the height that was the first and is held at zero is estimated, and the one before it held:
    a share of the variable itself is another parameter's, but what is limited loses the less of it the smaller it is."""
    curve = next(effect for effect in robot.effects if effect.id == identifier)
    assert isinstance(curve, Curve)
    for name in curve.each(robot) if curve.begins_later else ():
        before, first = (curve.height(place, name) for place in curve.varying[:2])
        if robot.parameters[before].free and not robot.parameters[first].free:
            robot = robot.with_values(**{before: 0.0}).change(before, free=False).change(first, free=True)
    return robot


def _losing_nothing_of_the_small(robot: Robot, identifier: str, beside: Robot) -> Robot:
    """The robot, the first height of whose curve of a limit is held at zero where it is estimated, the others less what they
    have in proportion to it: that is another gain of all, with which the robot's own parameters mean another thing than
    `beside` the formula, from whose values they begin then."""
    curve = next(effect for effect in robot.effects if effect.id == identifier)
    assert isinstance(curve, Curve)
    table, changed = robot.parameters, dict[str, float]()
    for name in curve.each(robot) if curve.begins_later else ():
        heights = {curve.height(place, name): curve.places[place] for place in curve.varying}
        first = curve.height(curve.varying[0], name)
        if table[first].free:
            gain = table[first].value / heights[first]
            changed |= {height: table[height].value - gain * share for height, share in heights.items()}
            robot = robot.change(first, free=False)
    if not changed:
        return robot
    own = {n: p.value for n, p in beside.parameters.items() if "." not in n and n in table}
    return robot.with_values(**own, **changed)


def _own(coarse: Fit, fine: Fit) -> list[str]:
    """The robot's own parameters that the coarser fit identifies."""
    names = (name for name, estimate in coarse.parameters.items() if estimate.status == "identified")
    return [name for name in names if "." not in name and name in fine.parameters]


def _all_identified(coarse: Fit, fine: Fit) -> bool:
    """Whether the finer fit identifies all that the coarser one does."""
    return all(fine[name].status == "identified" for name in _own(coarse, fine))


def moved(coarse: Fit, fine: Fit, lost: bool = False) -> bool:
    """Whether a parameter of the robot itself is more apart in the two fits than the finer one's further parameters explain;
    one may be at a bound in the finer one. Where that does not tell all that the other does, `lost` is the answer."""
    own = _own(coarse, fine)
    if any(fine[name].status == "not_identifiable" or not np.isfinite(fine[name].std_error) for name in own):
        return lost
    pairs = [(coarse[name], fine[name]) for name in own]
    apart = NormalDist().inv_cdf(1.0 - 0.5 * _CHANCE / max(len(pairs), 1))
    return any(
        abs(b.value - a.value) > apart * np.sqrt(max(b.std_error**2 - a.std_error**2, _LEAST * b.std_error**2))
        for a, b in pairs
    )
