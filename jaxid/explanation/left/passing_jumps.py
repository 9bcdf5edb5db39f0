"""Samples that jump away from their neighbours and come back: what no moving mass does, so that no effect is looked for in
them.

A robust loss keeps such samples from pulling an estimate. In the sums of squares that rank candidates they would count in
full, and on held-out logs there is no fit to give them little weight. They are found in what the fit leaves
(`estimate/jumps.py`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...estimate.jumps import jumping
from ...logs import Log, LogSet, noise_scale
from ...robots.robot import Robot
from .heldout import HeldOut, held_out_state

_MUCH = 1.1
"""Ratio of what a model leaves of the held-out logs with samples that jump and without them, from which these are what is to be
seen there, and are left out whatever the loss."""
_LATELY = 5
"""Samples after a change of an input in which a fast robot's answer to it jumps."""
_RELATED = 4.0
"""Standard errors by which inputs change more before samples that jump than before others, from which these are no noise."""
ROBUST = (
    "They make much of the error on the held-out logs, and may have pulled the numbers of the fit: a robust loss "
    '(`loss="cauchy"`, --loss cauchy) keeps them from that.'
)


_MOST = 0.1
"""Share of the readings up to which such samples are a sensor's: where more jump, readings are so far between that the
motion itself does, and what the model lacks of it."""
_LEVELS = 2.0 ** np.arange(0.5, 10.0, 0.5)
"""By how much more a sample may have to jump, in units of the noise, than where the robot's answers to commands jump too."""
_TOLD = 5
"""Samples that jump from which it shows whether they follow changes of the inputs: where a sixth of all samples does, five that
come whenever they like all do in one set of eight thousand."""


def passing_jumps(residual: NDArray[np.float64], least: float = 1.0) -> NDArray[np.bool_]:
    """Which samples of a channel's residual [T] in units of the noise, NaN where nothing was measured, jump and come back."""
    return jumping(residual, least=least)


def _changes(log: Log) -> NDArray[np.float64]:
    """By how much the inputs changed within the last few samples [T], in units of what each of them usually does."""
    steps = np.abs(np.diff(log.inputs, axis=0, prepend=log.inputs[:1]))
    size = np.sqrt(np.mean(steps**2, axis=0))
    size = np.sqrt(np.sum((steps / np.where(size > 0, size, 1.0)) ** 2, axis=1))
    lately = np.pad(size, (_LATELY - 1, 0))
    return np.max(np.lib.stride_tricks.sliding_window_view(lately, _LATELY), axis=1)


class _Timing(NamedTuple):
    """By how much the inputs change on average before the `samples` that jump, before the `others`, and by how much that
    differs by chance."""

    samples: int
    jumps: float
    others: float
    chance: float

    @property
    def after_commands(self) -> bool:
        """Whether they follow changes of the inputs: a robot that answers fast, and later or otherwise than the model, makes
        such errors, and a sensor that slips does not know of them."""
        return self.jumps - self.others > _RELATED * max(self.chance, 1e-300)


def _timing(logs: LogSet, jumps: Sequence[NDArray[np.bool_]]) -> _Timing | None:
    """When samples that jump do so; None where too few do, or too few do not."""
    every = [_changes(log) for log in logs]
    any_channel = [own.any(axis=1) for own in jumps]
    there = np.concatenate([values[own] for values, own in zip(every, any_channel, strict=True)])
    others = np.concatenate([values[~own] for values, own in zip(every, any_channel, strict=True)])
    if len(there) < 2 or len(others) < 2:
        return None
    spread = np.std(others) * np.hypot(1.0 / np.sqrt(len(there)), 1.0 / np.sqrt(len(others)))
    return _Timing(len(there), float(np.mean(there)), float(np.mean(others)), float(spread))


def _jumps(state: HeldOut, logs: LogSet) -> list[NDArray[np.bool_]]:
    """Which samples [T, channels] of every log jump and come back. Where they follow changes of the inputs, those of them that
    jump by so much more that they come whenever they like: spikes of a sensor in a log on which the robot answers otherwise
    than the model."""

    def beyond(least: float) -> list[NDArray[np.bool_]]:
        return [np.stack([passing_jumps(column, least) for column in own.T], axis=1) for own in state.residuals]

    def few(found: list[NDArray[np.bool_]]) -> bool:
        readings = sum(np.count_nonzero(np.isfinite(own)) for own in state.residuals)
        return bool(sum(np.count_nonzero(own) for own in found) <= _MOST * readings)

    found = beyond(1.0)
    none = [np.zeros_like(own) for own in found]
    all_of_them = _timing(logs, found)
    if all_of_them is None or not all_of_them.after_commands:
        return found if few(found) else none
    for level in _LEVELS:
        larger = beyond(level)
        timing = _timing(logs, larger)
        if timing is None or timing.samples < _TOLD:
            break
        # As far from when the robot's own answers jump as they can be.
        elsewhere = timing.jumps < 0.5 * (timing.others + all_of_them.jumps)
        if few(larger) and elsewhere and not timing.after_commands:
            return larger
    return none


def _without(robot: Robot, logs: LogSet, noise: Mapping[str, float]) -> tuple[LogSet, int]:
    state = held_out_state(robot, logs, noise)
    channels, total, kept = list(state.noise), 0, []
    for log, every in zip(logs, _jumps(state, logs), strict=True):
        outputs = np.array(log.outputs)
        for i, name in enumerate(channels):
            jumps = every[:, i]
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
