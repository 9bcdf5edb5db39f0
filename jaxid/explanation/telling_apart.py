"""Whether two models can be told apart on the logs at hand."""

from collections.abc import Sequence

import numpy as np

from .refit import Trial

SEPARATED = 2.0
"""Standard errors of the log-likelihood difference beyond which two names are told apart (Vuong 1989)."""
_SAME_BUT_LATER = {"input_delay", "sensor_delay"}
"""One model by two names: the same motion, later; but for what was commanded before a log began."""
_UNKNOWN_PAST = 10
"""First samples of a log, which show what was commanded before it began."""
_INTERPOLATED = 0.1
"""Difference of two predictions (RMS, times the noise) that may be due to how they interpolate between samples."""
_BLOCK = 25  # samples over which differences of squared residuals are summed, since neighbours are correlated


def told_apart(one: Trial, other: Trial) -> float:
    """Vuong's statistic: how many standard errors `one` predicts the held-out logs better than `other`."""
    blocks = []
    for a, b in zip(one.held_out.residuals, other.held_out.residuals, strict=True):
        difference = np.nansum(b**2 - a**2, axis=1)
        n = max(len(difference) // _BLOCK, 1)  # a window that is shorter is a block
        size = min(_BLOCK, len(difference))
        blocks.append(difference[: n * size].reshape(n, size).sum(axis=1))
    values = np.concatenate(blocks)
    spread = float(np.std(values)) * np.sqrt(values.size)
    return float(values.sum()) / spread if spread > 0 else 0.0


def told_apart_from(best: Trial, trial: Trial) -> bool:
    """Whether `trial` is less likely than `best` by more than chance, on the fitted logs or on the held-out ones."""
    # Twice the log-likelihood difference of two wrong-by-noise models has a standard deviation of about 2 sqrt(it).
    worse = max(trial.score - best.score, 0.0)
    return not (worse < (2 * SEPARATED) ** 2 and told_apart(best, trial) < SEPARATED)


def differ(one: Trial, other: Trial, skip: int = 0) -> float:
    """RMS difference of two predictions of the held-out logs, times the noise; the first samples of each log left out."""
    pairs = zip(one.held_out.residuals, other.held_out.residuals, strict=True)
    return float(np.sqrt(np.nanmean(np.concatenate([(a - b)[skip:].ravel() for a, b in pairs]) ** 2)))


def alike(trials: Sequence[Trial], slack: float = 0.0) -> list[Trial]:
    """Those that the data cannot tell from the first: about as likely on the fitted logs and on the held-out ones, or no more
    than `slack` times the noise worse on these."""
    best = trials[0]
    found = []
    for trial in trials[1:]:
        if {best.id, trial.id} == _SAME_BUT_LATER and differ(best, trial, _UNKNOWN_PAST) < _INTERPOLATED:
            found.append(trial)
            continue
        near = slack > 0 and trial.held_out.normalised_rms - best.held_out.normalised_rms < slack
        if near or not told_apart_from(best, trial):
            found.append(trial)
    return found


def not_told_apart(trials: Sequence[Trial], slack: float = 0.0) -> tuple[str, ...]:
    """The ids of those that the data cannot tell from the first."""
    return tuple(trial.id for trial in alike(trials, slack))
