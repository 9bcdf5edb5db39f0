"""Noise that neighbouring samples rate too high.

What is new from one sample to the next is the yardstick of what a model leaves. Where neighbouring errors pull apart, as in
speeds that are differences of an encoder's counts, it is longer than the noise, and a model's own errors hide below it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...estimate.confidence.agreement import rms
from ...estimate.judge import NOTHING
from ...estimate.residual_tests import LAGS, cross_correlation
from ...estimate.result import Fit
from ...logs import LogSet
from ...logs.noise import noise_error
from .coloured import colours_of
from .heldout import HeldOut, held_out_state
from .rounding import rounded

_BELOW = 4.0
"""Standard errors of the noise's size by which what is new in a residual must be smaller."""
_LEAST_ERROR = 0.01
_SHARE = 0.05
"""Share of what is new in a residual that an input must explain, about: a model's error of a fifth of that. Coarse rounding
alone follows what is rounded by up to 4 % (complete omni with rounded speeds, case 31087)."""


def _follows_an_input(state: HeldOut, logs: LogSet, names: Sequence[str]) -> bool:
    """Whether the residual of a channel of `names` follows an input's last samples, by more than chance and to some extent.

    In whitened samples: noise that pulls apart lets a regression on slow signals as they are look surer than it is.
    """
    inputs = len(logs.channels.inputs)
    for name in names:
        parts = [r[:, list(state.by_channel).index(name)] for r in state.residuals]
        samples = sum(int(np.isfinite(part).sum()) for part in parts)
        for j in range(inputs):
            test, _ = cross_correlation(parts, [log.inputs[:, j] for log in logs])
            chance = state.false_alarm / (inputs * len(names))
            if test.p_value < chance and LAGS * test.statistic > _SHARE * samples:
                return True
    return False


def in_its_own_noise(fit: Fit, held_out: LogSet, state: HeldOut) -> HeldOut:
    """`state`, which `fit` leaves on the `held_out` logs, in units of what is new in every sample of the residual itself (the
    innovations of its autoregression), in channels where that is smaller than the noise that neighbouring samples show and the
    residual is slow or follows the inputs; elsewhere as it is. Only of a fit whose residual on its own logs says that something
    is missing."""
    if fit.judgement is None or fit.judgement.trustworthy:
        return state
    if state.diverged or state.p_white > state.false_alarm / 2 or not state.normalised_rms > NOTHING:
        return state
    errors, colours = noise_error(held_out), colours_of([state])
    own = {name: colour.level for name, colour in colours.items() if colour.order}
    own = {name: level for name, level in own.items() if level < 1.0 - _BELOW * max(errors[name], _LEAST_ERROR)}
    # Noise that pulls apart is rated too high; what is slow beside it is none of that, whatever it follows. What rounding makes
    # of slow signals is slow, too.
    slow = any(colours[name].correlation > 0.0 and not rounded(held_out, name, state) for name in own)
    if not (own and (slow or _follows_an_input(state, held_out, list(own)))):
        return state
    noise = dict(state.noise) | {name: state.noise[name] * level for name, level in own.items()}
    return replace(held_out_state(fit.robot, held_out, noise), false_alarm=state.false_alarm)


def small_after_all(state: HeldOut, held_out: LogSet, rated: Mapping[str, float]) -> HeldOut:
    """`state` of a model on the `held_out` logs, marked as `unrelated` where it is below the noise as neighbouring samples have
    it (`rated`) and follows no input: it may be larger than what is new in every sample all the same."""
    scale = np.array([state.noise[name] / rated[name] for name in state.by_channel])
    if np.all(scale == 1.0) or state.diverged or state.adequate:
        return state
    size = rms(np.concatenate([(r * scale).ravel() for r in state.residuals]))
    if not size < state.negligible:
        return state
    names = [name for name, factor in zip(state.by_channel, scale, strict=True) if factor != 1.0]
    return replace(state, unrelated=not _follows_an_input(state, held_out, names))
