"""Samples that jump away from their neighbours and come back: what no moving mass does, so that no effect is looked for in
them.

A robust loss keeps such samples from pulling an estimate. In the sums of squares that rank candidates they would count in
full, and on held-out logs there is no fit to give them little weight. They are found in what the fit leaves
(`estimate/jumps.py`).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...estimate.jumps import jumping
from ...logs import LogSet, noise_scale
from ...robots.robot import Robot
from .heldout import held_out_state

_MUCH = 1.1
"""Ratio of what a model leaves of the held-out logs with samples that jump and without them, from which these are what is to be
seen there, and are left out whatever the loss."""
ROBUST = (
    "They make much of the error on the held-out logs, and may have pulled the numbers of the fit: a robust loss "
    '(`loss="cauchy"`, --loss cauchy) keeps them from that.'
)


def passing_jumps(residual: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which samples of a channel's residual [T] in units of the noise, NaN where nothing was measured, jump and come back."""
    return jumping(residual, least=1.0)


def _without(robot: Robot, logs: LogSet, noise: Mapping[str, float]) -> tuple[LogSet, int]:
    state = held_out_state(robot, logs, noise)
    channels, total, kept = list(state.noise), 0, []
    for log, residual in zip(logs, state.residuals, strict=True):
        outputs = np.array(log.outputs)
        for i, name in enumerate(channels):
            jumps = passing_jumps(residual[:, i])
            total += int(np.count_nonzero(jumps))
            outputs[jumps, log.measured.index(name)] = np.nan
        kept.append(replace(log, outputs=outputs))
    return LogSet(kept), total


def jumps_are_much(robot: Robot, logs: LogSet, held_out: LogSet) -> bool:
    """Whether samples that jump and come back make much of what `robot` leaves of the held-out logs. Not where nothing is
    missing all the same: heavy tails are then what the noise is. Noise that these do not show is that of the fitted `logs`."""
    noise = noise_scale(held_out, otherwise=logs)
    every = held_out_state(robot, held_out, noise)
    if every.adequate:
        return False
    steady, _ = _without(robot, held_out, noise)
    return bool(every.normalised_rms > _MUCH * held_out_state(robot, steady, noise).normalised_rms)


def without_passing_jumps(robot: Robot, logs: LogSet, held_out: LogSet) -> tuple[LogSet, LogSet, str]:
    """Fitted and held-out logs without the samples that jump away from the simulation of `robot` and come back, and a
    sentence that says how many these are."""
    noise = noise_scale(held_out, otherwise=logs)
    logs, fitted = _without(robot, logs, noise)
    held_out, held = _without(robot, held_out, noise)
    return logs, held_out, (
        f"{fitted} samples of the fitted logs and {held} of the held-out ones jump away from their neighbours and come back; "
        "nothing was looked for in them."
    )  # fmt: skip
