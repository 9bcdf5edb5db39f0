"""Numbers of the robot that hinge on which of several names or laws it is that is missing, where the data does not tell."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from ..estimate.result import Fit
from ..robots.robot import Robot
from .refit import Trial
from .wider_errors import reaching_to

_APART = 3.0
"""Standard errors by which a parameter must be another one."""
_MOST = 4
"""Parameters that are told, those first that differ most."""


class Hinging(NamedTuple):
    """The final fit with standard errors that allow for the other names, and a sentence on what they would make of the robot's
    own parameters, empty where that is nothing else."""

    final: Fit
    sentence: str


def hinging(final: Fit, last: Trial, others: Mapping[str, Robot]) -> Hinging:
    """What the robot's own parameters would be under the names of `others` (each with its model). `last` is the trial of the
    name that was added last, which `final` is the fit in full of."""
    if _own(last.robot.parameters.free_names) != _own(final.free_names):
        return Hinging(final, "")  # something was held or left out since
    own = [name for name in final.free_names if "." not in name and final[name].status == "identified"]
    said, reached = [], {}
    for title, robot in others.items():
        moved = {}
        for name in own:
            value, error = robot.parameters[name].value, final[name].std_error
            by = value - last.robot.parameters[name].value
            if robot.parameters[name].free and abs(by) > _APART * error > 0.0:
                moved[name] = abs(value - final[name].value) / error
                reached[name] = max(reached.get(name, 0.0), abs(by))
        worst = sorted(moved, key=lambda name: -moved[name])[:_MOST]
        if worst:
            unit = {name: f" {final[name].unit}".rstrip() for name in worst}
            listed = ", ".join(
                f"{name} {robot.parameters[name].value:.4g} instead of {final[name].value:.4g}{unit[name]}"
                for name in worst
            )
            said.append(f"if it is {title}, {listed}")
    if not said:
        return Hinging(final, "")
    return Hinging(
        reaching_to(final, {name: (by, final[name].std_error) for name, by in reached.items()}),
        f"Numbers of the robot hinge on the name or its law, which these logs leave open: {'; '.join(said)}. Their standard "
        "errors allow for that.",
    )


def _own(names: Iterable[str]) -> set[str]:
    """Those that are the robot's own and not an effect's, of which the final fit may have a finer curve."""
    return {name for name in names if "." not in name}
