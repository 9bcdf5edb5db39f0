"""Logs unlike all others: without them nothing is missing, and something happened in them.

A push, a lift, a collision or a sensor that failed for a moment is no effect of the robot's. In the fit of all logs it pulls
at the parameters, so that every log seems to lack something.
"""

from collections.abc import Sequence

import numpy as np

from ...estimate.output_error.output_error import output_error
from ...estimate.result import Fit
from ...logs import Log, LogError, LogSet, noise_scale
from ...parameters import ParameterError
from .heldout import HeldOut, held_out_state
from .overrated import in_its_own_noise
from .rounding import within_rounding
from .within_errors import within_errors

_MOST = 1.0 / 3.0
"""Share of the logs that may be unlike the others."""
_FEWEST = 2
"""Logs that have to be left to fit."""
_MOSTLY = 0.9
"""Share of what a log leaves above the noise that a stretch has to hold to be told, and `_SHORT` the longest such stretch, as
a share of the log."""
_SHORT = 0.6
_TOLD = 3


def unlike_the_others(fit: Fit, logs: LogSet, held_out: LogSet, odd: Sequence[str]) -> str:
    """A sentence on the logs named `odd`, which the model of `fit` does not explain alone, where the robot as it is explains
    all others together: fitted to those of `logs`, it leaves nothing on those of `held_out`. Empty where it does not."""
    every = [*logs, *held_out]
    others, judging = ([log for log in own if log.name not in odd] for own in (logs, held_out))
    if not odd or len(odd) > _MOST * len(every) or len(others) < _FEWEST or not judging:
        return ""
    rest, check = LogSet(others), LogSet(judging)
    try:
        again = output_error(fit.robot, rest)
    except (ParameterError, LogError):
        return ""
    noise = noise_scale(check, otherwise=rest)
    left = in_its_own_noise(again, check, held_out_state(again.robot, check, noise))
    if not (left.adequate or within_rounding(check, within_errors(again, check, left)).adequate):
        return ""
    own = [(log, held_out_state(again.robot, LogSet([log]), left.noise)) for log in every if log.name in odd]
    own = [pair for pair in own if not pair[1].adequate]
    if len(own) < len(odd):
        return ""
    told = "; ".join(_in_words(log, state) for log, state in own[:_TOLD])
    more = f" (and {len(own) - _TOLD} more)" if len(own) > _TOLD else ""
    many = len(own) > 1
    return (
        f"All logs but {len(own) if many else 'one'} are explained by the robot as it is: fitted without "
        f"{'them' if many else 'it'}, nothing is missing on the {'other ' if len(check) < len(held_out) else ''}held-out "
        f"logs. What is left is in {told}{more}: a push, a lift, a sensor that failed for a moment, or something that is "
        "missing where no other log goes."
    )


def _in_words(log: Log, state: HeldOut) -> str:
    """What is left in a log, and where most of it is."""
    if state.diverged:
        return f"{log.name} (the simulation diverges)"
    left = f"{log.name} ({state.normalised_rms:.3g} times the noise"
    excess = np.nansum(np.maximum(state.residuals[0] ** 2 - 1.0, 0.0), axis=1)
    share = np.cumsum(excess) / max(float(np.sum(excess)), 1e-300)
    # The shortest stretch that holds most of it.
    begins = np.concatenate([[0.0], share[:-1]])
    ends = np.searchsorted(share, np.minimum(begins + _MOSTLY, 1.0 - 1e-12))
    time = np.asarray(log.time)
    lasts = np.where(begins + _MOSTLY < 1.0, time[np.minimum(ends, len(time) - 1)] - time, np.inf)
    first = int(np.argmin(lasts))
    if lasts[first] > _SHORT * (time[-1] - time[0]):
        return f"{left})"
    return f"{left}, {100 * _MOSTLY:.0f} % of it from {time[first]:.4g} s to {time[ends[first]]:.4g} s)"
