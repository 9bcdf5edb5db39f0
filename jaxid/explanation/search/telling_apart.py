"""Whether two models can be told apart on the logs at hand."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...effects.curve import SHAPE, Curve
from ..left.heldout import HeldOut
from ..policy import current_policy
from ..refits.refit import Trial

UNKNOWN_PAST = 10
"""First samples of a log, which show what was commanded before it began."""
_INTERPOLATED = 0.01
"""Share of what a delay makes of a motion that interpolation between samples may get wrong of it."""
_SAME = 0.05
"""RMS difference of two models' predictions, times the noise, below which they predict the same, whatever the likelihood of
some ten thousand samples says, or the number of their parameters."""
_AS_MUCH = 1.02
"""Ratio of what two curves of the same thing leave, with points at other places."""
_BLOCK = 25  # samples over which differences of squared residuals are summed, since neighbours are correlated


def _blocks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Sums [blocks, ...] over stretches of the samples [T, ...]; a log that is shorter is a block."""
    size = max(min(_BLOCK, len(values)), 1)
    n = max(len(values) // size, 1)
    return values[: n * size].reshape(n, -1, *values.shape[1:]).sum(axis=1)


def vuong(one: Sequence[NDArray[np.float64]], other: Sequence[NDArray[np.float64]]) -> float:
    """Vuong's statistic (Econometrica 57, 1989): by how many standard errors the residuals [T, channels] of `one` are less."""
    differences = (np.nansum(b**2 - a**2, axis=-1).ravel() for a, b in zip(one, other, strict=True))
    values = np.concatenate([_blocks(own) for own in differences])
    spread = float(np.std(values)) * np.sqrt(values.size)
    return float(values.sum()) / spread if spread > 0 else 0.0


def told_apart(one: HeldOut, other: HeldOut) -> float:
    """How many standard errors better `one` is than `other`, another model's state on the same logs."""
    return vuong(one.residuals, other.residuals)


def _chance(state: HeldOut) -> NDArray[np.float64]:
    """By channel, how much more than white noise of the usual size what is left may add up to: its long-run variance (batch
    means), at least one. Whatever two models differ in, chance makes them differ in likelihood by that much more."""
    squares, samples = np.zeros(len(state.by_channel)), np.zeros(len(state.by_channel))
    for residual in state.residuals:
        squares += np.sum(_blocks(np.nan_to_num(residual)) ** 2, axis=0)
        samples += np.count_nonzero(np.isfinite(residual), axis=0)
    return np.maximum(squares / np.maximum(samples, 1), 1.0)


def _less_likely(best: HeldOut, other: HeldOut) -> float:
    """By how much `other` is less likely (twice the logarithm), in units of what chance makes of it."""
    chance = _chance(best)
    pairs = zip(best.residuals, other.residuals, strict=True)
    return sum(float(np.sum(np.nansum(b**2 - a**2, axis=0) / chance)) for a, b in pairs)


def clearly_better(one: HeldOut, other: HeldOut) -> bool:
    """Whether `one` is better than `other` by more standard errors than chance makes, and by more than nothing: two models that
    are the same but for rounding may differ by many standard errors of a difference that nobody could see."""
    separated = current_policy().separated
    return told_apart(one, other) >= separated and _less_likely(one, other) >= separated**2


def told_apart_from(best: Trial, trial: Trial) -> bool:
    """Whether `trial` is less likely than `best` by more than chance, on the fitted logs."""
    if differ(best.fitted, trial.fitted) < _SAME:
        return False
    # Parameters are paid for. Twice the log-likelihood difference of two wrong-by-noise models has a standard deviation of
    # about 2 sqrt(it).
    price = (trial.free - best.free) * float(np.log(max(best.fitted.samples, 1)))
    separated, less = current_policy().separated, _less_likely(best.fitted, trial.fitted)
    if less + price >= (2 * separated) ** 2:
        return True
    # What the best one has won by more parameters than the other has is no evidence for it.
    share = min(less + price, less) / max(less, 1e-300)
    return told_apart(best.fitted, trial.fitted) * share >= separated and less >= separated**2


def _delays(trial: Trial) -> bool:
    """Whether the trial's effect is a delay by any of its mechanism's laws."""
    return any(vars(base).get("only_later", False) for base in type(trial.effect).__mro__)


def same_but_later(one: Trial, other: Trial, base: Trial | None) -> bool:
    """Whether both are one model by two names, the same motion later; but for what was commanded before a log began. `base` is
    the model that is not late."""
    if one.angles and other.angles and _delays(one) and _delays(other):
        return True  # prescribed angles are as late as the sensors show them, which suits one of the two names alone
    if not all(trial.effect is not None and trial.effect.only_later for trial in (one, other)):
        return False
    late = differ(one.fitted, base.fitted, UNKNOWN_PAST) if base is not None else 0.0
    same = max(current_policy().same_motion, _INTERPOLATED * (late if np.isfinite(late) else 0.0))
    return differ(one.fitted, other.fitted, UNKNOWN_PAST) < same


def _by_one_factor(best: Trial, trial: Trial) -> bool:
    """Whether both are curves of which a robot that makes forces of commands by one factor makes the same: their few points
    stand at other places, and leave nearly as much."""
    curves = isinstance(best.effect, Curve) and isinstance(trial.effect, Curve) and best.effect.may_as_well == trial.id
    return curves and trial.fitted.normalised_rms < _AS_MUCH * best.fitted.normalised_rms


def differ(one: HeldOut, other: HeldOut, skip: int = 0) -> float:
    """RMS difference of two models' outputs on the same logs, times the noise; the first samples of each log left out."""
    pairs = zip(one.residuals, other.residuals, strict=True)
    return float(np.sqrt(np.nanmean(np.concatenate([(a - b)[skip:].ravel() for a, b in pairs]) ** 2)))


def alike(trials: Sequence[Trial], base: Trial | None = None) -> list[Trial]:
    """Those that the data cannot tell from the first: about as likely on the fitted logs. `base` is the model without them."""
    best = trials[0]
    return [
        trial
        for trial in trials[1:]
        if same_but_later(best, trial, base) or _by_one_factor(best, trial) or not told_apart_from(best, trial)
    ]


def not_told_apart(trials: Sequence[Trial], base: Trial | None = None) -> tuple[str, ...]:
    """The ids of those that the data cannot tell from the first. `base` is the model without any of them."""
    return tuple(trial.id for trial in alike(trials, base))


def simplest_first(trials: Sequence[Trial]) -> list[Trial]:
    """Trials of several mechanisms, best first; where a curve is best and the data cannot tell a formula of fewer parameters
    from it, that one comes first."""
    best = trials[0]
    plain = [t for t in alike(trials) if t.law != SHAPE and t.free < best.free] if best.law == SHAPE else []
    first = min(plain, key=lambda trial: trial.free, default=best)
    return [first, *(trial for trial in trials if trial is not first)]


def _kinds(trial: Trial) -> int:
    """How many curves of one thing the trial's effect has, such as one for either way; a formula counts as one."""
    return len(trial.effect.kinds) if isinstance(trial.effect, Curve) else 1


def kinds_alike(several: Trial, fewer: Trial) -> bool:
    """Whether the effect of `several` is more curves of one thing than that of `fewer`, all of them much the same: they follow
    what depends on less."""
    effect = several.effect
    return isinstance(effect, Curve) and _kinds(several) > _kinds(fewer) and not effect.agrees(several.robot)


def supersets(trials: Sequence[Trial]) -> set[str]:
    """Ids of the curves of more parameters than the first trial's formula, and of several curves that are alike where the first
    is one: that they can follow it is no evidence for them."""
    first = trials[0]
    more = (t for t in trials[1:] if first.law != SHAPE and t.law == SHAPE and t.free > first.free)
    return {t.id for t in more} | {t.id for t in trials[1:] if kinds_alike(t, first)}
