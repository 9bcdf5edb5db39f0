"""Numbers of the robot that hinge on which of several names it is that is missing, where the data does not tell."""

from collections.abc import Mapping

from ..estimate.result import Fit
from ..robots.robot import Robot
from .refit import Trial

_APART = 3.0
"""Standard errors by which a parameter must be another one."""
_MOST = 4
"""Parameters that are told, those first that differ most."""


def hinging(final: Fit, last: Trial, others: Mapping[str, Robot]) -> str:
    """A sentence on the robot's own parameters that would be others under the names of `others` (each with its model); empty
    where none is. `last` is the trial of the name that was added last, which `final` is the fit in full of."""
    if set(last.robot.parameters.free_names) != set(final.free_names):
        return ""  # something was held or left out since
    own = [name for name in final.free_names if "." not in name and final[name].status == "identified"]
    said = []
    for title, robot in others.items():
        moved = {}
        for name in own:
            value, error = robot.parameters[name].value, final[name].std_error
            if robot.parameters[name].free and abs(value - last.robot.parameters[name].value) > _APART * error > 0.0:
                moved[name] = abs(value - final[name].value) / error
        worst = sorted(moved, key=lambda name: -moved[name])[:_MOST]
        if worst:
            unit = {name: f" {final[name].unit}".rstrip() for name in worst}
            listed = ", ".join(
                f"{name} {robot.parameters[name].value:.4g} instead of {final[name].value:.4g}{unit[name]}"
                for name in worst
            )
            said.append(f"if it is {title}, {listed}")
    if not said:
        return ""
    return (
        f"Numbers of the robot hinge on the name, which these logs leave open: {'; '.join(said)}. Their standard errors hold "
        "for the name that stands first."
    )
