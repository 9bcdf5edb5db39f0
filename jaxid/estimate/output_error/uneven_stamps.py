"""A fit's note on stamps that scatter about the clock by which the robot ran.

Receive stamps are late by another millisecond in every row. A wheel turns by many counts of a fine encoder in that time, so
that a complete model leaves what follows the motion, and the residual alone says that the model lacks something. Which of the
two clocks was the robot's, the residual says: the same model simulated by even stamps leaves less, by more than chance.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ...logs.even_clock import evenly
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


def _squares(fit: Fit, logs: LogSet, like: LogSet) -> NDArray[np.float64]:
    """Squares of the residual in units of the fit's noise, summed over stretches of the logs, which are those that the fit was
    made to (`like`) but for their stamps."""
    begin = dict(initial_states(fit.robot, like).states)
    for e, log in enumerate(like):
        for name, value in fit.initial_states.get(log.name, {}).items():
            begin[name][e] = value
    found = []
    simulated = simulate(fit.robot, logs, start=begin, integrator=integrator_for(fit.robot, like))
    for log, y in zip(logs, simulated, strict=True):
        errors = errors_of(log, y)
        counted = [name for name in errors if fit.noise.get(name, 0.0) > 0]
        error = np.stack([errors[name] / fit.noise[name] for name in counted])
        squares = np.nansum(error**2, axis=0)
        count = max(len(squares) // _BLOCK, 1)
        found += [float(np.sum(part)) for part in np.array_split(squares, count)]
    return np.array(found)


def with_stamps_noted(fit: Fit, logs: LogSet) -> Fit:
    """The fit, with a note where its residual is that of stamps which scatter about an even clock. Call under float64."""
    if fit.window is not None or fit.judgement is None or fit.judgement.verdict == "sound" or fit.clock_offsets:
        return fit
    even, sizes = evenly(logs)
    if not sizes:
        return fit
    given, evened = _squares(fit, logs, logs), _squares(fit, even, logs)
    gain = given - evened
    certain = gain.sum() > _CERTAIN * max(float(np.std(gain)) * np.sqrt(len(gain)), 1e-300)
    if not (np.isfinite(gain).all() and certain and evened.sum() < _LESS * given.sum()):
        return fit
    share = float(np.sqrt(evened.sum() / given.sum()))
    note = (
        f"The stamps of {len(sizes)} of {len(logs)} logs scatter about an even clock, by {np.median(sizes):.1%} of the "
        f"interval. With even ones the same model leaves {share:.2g} times as much: the robot ran by that clock, and the "
        "stamps are those of arrival. Read the logs with `t = {interval = seconds}` in a mapping, and fit again."
    )
    return replace(fit, notes=(note, *fit.notes))
