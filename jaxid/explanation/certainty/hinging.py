"""Numbers of the robot, and of other effects, that hinge on which of several names or laws it is that is missing, where the
data does not tell."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...effects.curve import SHAPE, Curve
from ...estimate.result import Fit
from ...robots.effect import Effect, in_words
from ...robots.robot import Robot
from ..named_effect import NamedEffect
from ..policy import current_policy
from ..refits.refit import Trial
from ..search.steps import Step, laws_in
from .wider_errors import reaching_to

_APART = 3.0
"""Standard errors by which a parameter must be another one."""
_MOST = 4
"""Parameters that are told, those first that differ most."""
BY_NAME = "the name or its law, where another leaves hardly more"


class Hinging(NamedTuple):
    """The final fit with standard errors that allow for the other names, and a sentence on what they would make of the robot's
    own parameters, empty where that is nothing else."""

    final: Fit
    sentence: str


def hinging(
    final: Fit, last: Trial, others: Mapping[str, Robot], but: Collection[str] = (), on: str = BY_NAME
) -> Hinging:
    """What the model's parameters, `but` some, would be in the models of `others`, by what is so then, if these hinge `on`
    something.

    `last` is the trial that `final` is the fit in full of; where it has other effects than that, nothing is said.
    """
    free = last.robot.parameters.free_names
    held = any(name in final.parameters and final[name].status == "fixed" for name in free)
    if held or _own(free) != _own(final.free_names) or _ids(last.robot) != _ids(final.robot):
        return Hinging(final, "")  # something was held, left out or added since
    known = ("identified", "at_bound")  # what ends at its bound by one name need not by another
    own = [name for name in final.free_names if name not in but and final[name].status in known]
    said: dict[str, list[str]] = {}
    reached: dict[str, float] = {}
    for title, robot in others.items():
        moved = {}
        for name in own:
            if name not in robot.parameters or name not in last.robot.parameters:
                continue  # of a finer curve
            if len({_points(own, name) for own in (robot, last.robot, final.robot)}) > 1:
                continue  # a height at another place
            value, error = robot.parameters[name].value, final[name].std_error
            by = value - last.robot.parameters[name].value
            if abs(by) > _APART * error > 0.0:
                moved[name] = abs(value - final[name].value) / error
                reached[name] = max(reached.get(name, 0.0), abs(by))
        worst = sorted(moved, key=lambda name: -moved[name])[:_MOST]
        if worst:
            unit = {name: f" {final[name].unit}".rstrip() for name in worst}
            listed = ", ".join(
                f"{_said(name)} {robot.parameters[name].value:.4g} instead of {final[name].value:.4g}{unit[name]}"
                for name in worst
            )
            said.setdefault(listed, []).append(title)
    if not said:
        return Hinging(final, "")
    told = "; ".join(f"if {' or '.join(titles)}, {listed}" for listed, titles in said.items())
    return Hinging(
        reaching_to(final, {name: (by, final[name].std_error) for name, by in reached.items()}),
        f"Numbers of the model hinge on {on}: {told}. Their standard errors allow for that.",
    )


def shapes_alone(effect: Effect, robot: Robot) -> set[str]:
    """The effect's own parameters that say where or how it acts, and mean another thing by another law: all but its strengths,
    which begin at zero."""
    bare = replace(robot, effects=tuple(other for other in robot.effects if other.id != effect.id))
    return {name for name, parameter in effect.parameters(bare).items() if parameter.value != 0.0}


def by_law(effect: NamedEffect, step: Step) -> dict[str, Robot]:
    """The models by the laws that the data cannot tell from the effect's, or whose predictions differ from its by less than
    matters: nature's law may be another one still. A law of more parameters makes others of the rest by chance, and is none
    that was passed over."""
    best = step.after.fitted.normalised_rms
    most = np.sqrt(best**2 + current_policy().negligible ** 2 - 1.0)

    def near(trial: Trial) -> bool:
        return trial.law in effect.laws_alike or (trial.law != SHAPE and trial.fitted.normalised_rms < most)

    laws = (t for t in step.laws if t.law != effect.law and t.free <= step.after.free and not t.angles and near(t))
    return {f"it is {effect.title} by {_law_in_words(t.law)}": t.robot for t in laws}


def by_name(effect: NamedEffect, step: Step) -> dict[str, Robot]:
    """The models by the names that the data cannot tell from the effect's, by what it then is in words."""
    # Prescribed angles suit one of two names alone: what the other's model makes of them says nothing.
    # Nor does what has only a part in common with the effect, unless it is a curve that is the same function.
    names = {name for name in effect.equivalent_to if name in step.equivalent or effect.law == SHAPE}
    alike = (trial for trial in step.trials if trial.id in names and not trial.angles)
    return {f"it is {in_words(trial.id)}": trial.robot for trial in alike}


def with_the_rest(others: Mapping[str, Robot], identifier: str, final: Fit) -> dict[str, Robot]:
    """Those of the models in the place of one effect that have all else that `final` has, by the same laws: of others, what is
    missing there has moved the robot's own parameters, too."""
    rest = laws_in(final.robot, identifier)
    return {title: robot for title, robot in others.items() if rest <= laws_in(robot, identifier)}


def _points(robot: Robot, name: str) -> tuple[float, ...]:
    """The places of the curve that a parameter is a height of, and their unit; none where it is no curve's."""
    curve = next((e for e in robot.effects if isinstance(e, Curve) and e.is_height(name)), None)
    if curve is None:
        return ()
    reaches = (p.value for own, p in robot.parameters.items() if own.startswith(curve.key("reach")))
    return (*curve.places, *reaches)


def _said(name: str) -> str:
    """A parameter for a sentence: the robot's own by its symbol, an effect's in words."""
    effect, _, own = name.partition(".")
    return f"{own.replace('_', ' ')} of {in_words(effect)}" if own else name


def _ids(robot: Robot) -> set[str]:
    return {effect.id for effect in robot.effects}


def _own(names: Iterable[str]) -> set[str]:
    """Those that are the robot's own and not an effect's, of which the final fit may have a finer curve."""
    return {name for name in names if "." not in name}


def _law_in_words(law: str) -> str:
    return f"the law {in_words(law)}" if law else "its plain law"
