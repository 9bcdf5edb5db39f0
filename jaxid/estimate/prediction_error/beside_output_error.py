"""Whether prediction error and output error say the same, as they do where the process noise is what it is taken for.

Slow noise of a sensor looks like a disturbance of the motion to a filter, whose predictions then follow it: innovations that
are white, and parameters that are wrong. A free simulation does not follow the sensors. Output error's estimates are
consistent for noise of any colour, and under disturbances of the motion, too, as long as it is nearly linear in them;
prediction error's are the sharper ones where its model of the noise is right. So the two differ by what their errors allow
(Hausman 1978, Econometrica 46), or the noise is another one. Where the innovations are not white, either, and what a free
simulation leaves follows the motion, the model lacks something.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ...logs import LogError, LogSet
from ...parameters import ParameterError
from ...simulation.rollout import Integrator
from ..judgement import LOOK_FURTHER
from ..output_error.output_error import output_error
from ..output_error.setup import InitialStates
from ..result import Fit

_APART = 4.5
"""Standard errors of the difference between the two, from which it is no chance, with room for what friction makes of
disturbances in a free simulation."""
_LEAST = 0.25
"""Share of output error's variance that the difference has at least."""


def contradiction(
    fit: Fit,
    logs: LogSet,
    initial: InitialStates,
    integrator: Integrator | None,
    report: Callable[[str], None] = lambda message: None,
    *,
    white: bool = True,
) -> str:
    """A sentence on the identified parameters that output error, from the `fit`'s own values, makes others than both errors
    allow, or on what its residual follows where the innovations are not `white`; empty where there is none, or where no free
    simulation follows the logs."""
    other = _freely(fit, logs, initial, integrator, report)
    if other is None:
        return ""
    both = [n for n in fit.free_names if fit[n].status == other[n].status == "identified"]
    apart = {name: _apart(fit, other, name) for name in both}
    worst = sorted((name for name in both if apart[name] > _APART), key=lambda name: -apart[name])
    if worst:
        return _said(fit, other, worst[:3])
    if white or other.judgement is None or not other.judgement.follows:
        return ""
    channel, driver = next(iter(other.judgement.follows.items()))
    return (
        f"Innovations are not white, and what a free simulation leaves in {channel} follows the motion (most of all {driver}): "
        f"part of it is not in the model. {LOOK_FURTHER}"
    )


def noise_instead(
    fit: Fit,
    logs: LogSet,
    initial: InitialStates,
    integrator: Integrator | None,
    report: Callable[[str], None] = lambda message: None,
) -> str:
    """A sentence where the innovations follow the motion and what a free simulation leaves of the same model does not, so that
    nothing is missing from it; else empty."""
    other = _freely(fit, logs, initial, integrator, report)
    if other is None or other.judgement is None or not other.judgement.trustworthy:
        return ""
    both = [n for n in fit.free_names if fit[n].status == other[n].status == "identified"]
    worst = sorted(both, key=lambda name: -_apart(fit, other, name))[:3]
    return (
        f"The innovations follow the motion, and what a free simulation of the same model leaves does not: output error has "
        f"{_listed(fit, other, worst)}. So it is the noise that is another than supposed here, most likely slow noise of a "
        "sensor that was taken for a disturbance of the motion, and output error's estimates are the better ones. A log of the "
        "robot at rest tells."
    )


def _freely(fit: Fit, logs: LogSet, initial: InitialStates, integrator: Integrator | None, report) -> Fit | None:
    """Output error from the fit's values; None where that follows the logs no better."""
    report("compared with output error")
    try:
        other = output_error(fit.robot, logs, initial_states=initial, integrator=integrator)
    except (ParameterError, LogError):
        return None
    return None if other.failed or not other.converged else other


def _apart(fit: Fit, other: Fit, name: str) -> float:
    """How far the estimates of a parameter are apart, in standard errors of their difference."""
    variance = other[name].std_error ** 2
    left = max(variance - fit[name].std_error ** 2, _LEAST * variance)
    return abs(other[name].value - fit[name].value) / float(np.sqrt(left)) if left > 0 else 0.0


def _listed(fit: Fit, other: Fit, names: Sequence[str]) -> str:
    return ", ".join(
        f"{name} {other[name].value:.4g} instead of {fit[name].value:.4g} {fit[name].unit}".rstrip() for name in names
    )


def _said(fit: Fit, other: Fit, names: Sequence[str]) -> str:
    return (
        "Output error makes other numbers of the same logs than the errors of both allow: "
        f"{_listed(fit, other, names)}. So the noise is not what is supposed here: slow noise of a sensor, taken for a "
        "disturbance of the motion (then output error's are the better ones), or disturbances with which a free simulation is "
        "another on average. A log of the robot at rest tells."
    )
