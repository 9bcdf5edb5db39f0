"""A fit's note on stamps that scatter about the clock by which the robot ran.

Receive stamps are late by another millisecond in every row. A wheel turns by many counts of a fine encoder in that time, so
that a complete model leaves what follows the motion, and the residual alone says that the model lacks something. Which of the
two clocks was the robot's, the residual says: fitted with even stamps the same model leaves less, by more than chance.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ...logs.even_clock import evenly
from ...parameters import ParameterError
from ...simulation.simulate import integrator_for, simulate
from ...simulation.start import initial_states
from ..confidence.agreement import errors_of
from ..result import Fit

_LESS = 0.9
"""Share of the squares that even stamps must come below."""
_CERTAIN = 4.0
"""Standard errors by which they must leave less."""
_BLOCK = 25
"""Samples over which squares are summed, since neighbours are correlated."""


def _squares(fit: Fit, logs: LogSet, noise: Mapping[str, float]) -> NDArray[np.float64]:
    """Squares of what `fit` leaves of its logs, in units of the `noise`, summed over stretches."""
    begin = dict(initial_states(fit.robot, logs).states)
    for e, log in enumerate(logs):
        for name, value in fit.initial_states.get(log.name, {}).items():
            begin[name][e] = value
    found = []
    simulated = simulate(fit.robot, logs, start=begin, integrator=integrator_for(fit.robot, logs))
    for log, y in zip(logs, simulated, strict=True):
        errors = errors_of(log, y)
        error = np.stack([own / noise[name] for name, own in errors.items() if noise.get(name, 0.0) > 0])
        count = max(error.shape[1] // _BLOCK, 1)
        found += [float(np.sum(part)) for part in np.array_split(np.nansum(error**2, axis=0), count)]
    return np.array(found)


def with_stamps_noted(fit: Fit, logs: LogSet, again: Callable[[LogSet, Fit], Fit]) -> Fit:
    """The fit, with a note where its residual is that of stamps which scatter about an even clock. `again` is the same fit to
    other logs, from another one. Call under float64."""
    if fit.window is not None or fit.judgement is None or fit.judgement.trustworthy or fit.clock_offsets:
        return fit
    even, sizes = evenly(logs)
    if not sizes:
        return fit
    try:
        evened = again(even, fit)
    except ParameterError:
        return fit
    with np.errstate(over="ignore", invalid="ignore"):
        left = _squares(evened, even, fit.noise)
        gain = _squares(fit, logs, fit.noise) - left
    certain = np.isfinite(gain).all() and gain.sum() > _CERTAIN * float(np.std(gain)) * np.sqrt(len(gain))
    if not certain or left.sum() > _LESS * (left + gain).sum():
        return fit
    share = float(np.sqrt(left.sum() / (left + gain).sum()))
    note = (
        f"The stamps of {len(sizes)} of {len(logs)} logs scatter about an even clock, by {np.median(sizes):.1%} of the "
        f"interval. Fitted with even ones the same model leaves {share:.2g} times as much: the robot ran by that clock, and "
        "the stamps are those of arrival. Read the logs with `t = {interval = seconds}` in a mapping, and fit again."
    )
    return replace(fit, notes=(note, *fit.notes))
