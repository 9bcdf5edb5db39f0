"""Explain the logs without readings that tell nothing of the motion: at the end of a sensor's range, or of one that is dead.

They are no measurements, so that nothing that a robot may lack explains them, and what is searched for is hidden behind them.
"""

from collections.abc import Callable
from typing import Any

from ...estimate.output_error.output_error import output_error
from ...estimate.result import Fit
from ...logs import LogSet
from ...logs.unusable import without_unusable
from ...parameters import ParameterError
from .heldout import held_out_state

_LESS = 0.9
"""Share of the error on the held-out or on the fitted logs that the model must come below without such readings."""


def on_usable_readings(
    fit: Fit, logs: LogSet, held_out: LogSet, report: Callable[[str], None], **options: Any
) -> tuple[Fit, LogSet, LogSet, str]:
    """The fit and the logs without such readings, and a sentence on that, where there are any and they make much of the gap;
    else as they were. `options` are those of the fit (`output_error`)."""
    (own, other), said = without_unusable(logs, held_out)
    trusted = fit.judgement is not None and fit.judgement.trustworthy
    before = held_out_state(fit.robot, held_out) if said else None
    if before is None or fit.window is not None or (before.adequate and trusted):
        return fit, logs, held_out, ""
    report("some readings tell nothing of the motion; fitting without them")
    changed = any(mine is not given for mine, given in zip(own, logs, strict=True))
    try:
        again = output_error(fit.robot, own, **options) if changed else fit
    except ParameterError:
        return fit, logs, held_out, ""
    pairs = ((before, other), (held_out_state(fit.robot, logs), own))
    less = (
        held_out_state(again.robot, some).normalised_rms < _LESS * with_them.normalised_rms for with_them, some in pairs
    )
    if again.failed or not any(less):
        return fit, logs, held_out, ""
    left_out = f"Left out, since they tell nothing of the motion: {'; '.join(said)}."
    return (
        again,
        own,
        other,
        f"{left_out} With them the held-out error was {before.normalised_rms:.3g} times the noise.",
    )
