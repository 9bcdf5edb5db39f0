"""A fit without readings that tell nothing of the motion: at the end of a sensor's range, or of one that is dead in a log."""

from collections.abc import Callable
from dataclasses import replace

from ...logs import LogSet
from ...logs.unusable import without_unusable
from ...parameters import ParameterError
from ..result import Fit

_LESS = 0.9
"""Share of the residual that the model must come below without them."""


def without_unusable_readings(fit: Fit, logs: LogSet, again: Callable[[LogSet], Fit]) -> Fit:
    """The fit, or the one without such readings where these alone make it doubtful; with a note on it either way. `again` is
    the same fit to other logs. Call under float64."""
    if fit.judgement is None or fit.judgement.trustworthy:
        return fit
    (usable,), said = without_unusable(logs)
    if not said:
        return fit
    try:
        other = again(usable)
    except ParameterError:
        return fit
    left = fit.judgement.normalised_rms
    if other.failed or other.judgement is None or not other.judgement.normalised_rms < _LESS * left:
        return fit
    what = f"These readings tell nothing of the motion: {'; '.join(said)}."
    leaves = f"the same model leaves {other.judgement.normalised_rms:.3g} times the noise instead of {left:.3g}"
    if other.judgement.trustworthy:
        return replace(
            other, notes=(f"{what} They are left out: with them {left:.3g} times the noise is left.", *other.notes)
        )
    return replace(fit, notes=(f"{what} Without them {leaves}: leave these cells empty, and fit again.", *fit.notes))
