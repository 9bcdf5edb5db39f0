"""How far a model is from logs it was not fitted to, in units of the noise, and whether anything is left to find."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ..estimate.confidence.agreement import counted_channels, diverging, errors_of, rms
from ..estimate.output_error.estimated_start import estimated_start
from ..estimate.residual_tests import ljung_box
from ..logs import LogSet, noise_scale
from ..logs.noise import usual_size
from ..robots.robot import Robot
from ..simulation.simulate import integrator_for, simulate
from .smoothed_angles import Angles

FALSE_ALARM = 0.005
"""How often a residual that is nothing but white noise is taken for a gap."""
_LAGS = 20
_NEGLIGIBLE = 1.005
"""Normalised RMS below which a gap is too small to matter, whatever its significance."""
_NOISE_UNKNOWN = float(stats.norm.isf(FALSE_ALARM) * np.sqrt((2.31 + 1.0) / 2.0))
"""Over the root of the number of samples: the normalised RMS above one at which even a white residual is a gap. Below, the
noise's own estimate may be at fault: its variance from third differences (1, -3, 3, -1) has 1 + 2 (0.75^2 + 0.3^2 + 0.05^2)
= 2.31 times the uncertainty of as many independent samples, by the autocorrelations of the differences, the residual's one."""
_FARTHEST = 1e6


@dataclass(frozen=True)
class HeldOut:
    """Residuals (simulated minus measured) of a model on held-out logs.

    `normalised_rms` is 1 at the noise floor; `residuals` per log [T, channels] in units of the noise (NaN where nothing
    was measured); `p_white` the probability of autocorrelations and offsets this large if only noise were left.
    Where the wheels' angles were prescribed (see `smoothed_angles.py`), `simulated_freely` is the state without.
    `diverged` names the logs on which the simulation is no prediction any more; they count here, as very wrong.
    """

    normalised_rms: float
    by_channel: dict[str, float]
    residuals: tuple[NDArray[np.float64], ...]
    noise: dict[str, float]
    p_white: float
    simulated_freely: "HeldOut | None" = None
    diverged: tuple[str, ...] = ()

    @property
    def squares(self) -> float:
        """Sum of squares in units of the noise."""
        return float(sum(np.nansum(r**2) for r in self.residuals))

    @property
    def samples(self) -> int:
        """Number of measured values."""
        return int(sum(np.count_nonzero(np.isfinite(r)) for r in self.residuals))

    @property
    def adequate(self) -> bool:
        """Whether nothing but noise is left: white residuals at the noise floor, or a gap too small to matter."""
        # The noise was estimated without its far samples; where there are many, the residual is looked at in that way too.
        usual = usual_size(np.concatenate([r.ravel() for r in self.residuals]))
        known = 1.0 + _NOISE_UNKNOWN / np.sqrt(max(self.samples, 1))
        white = self.p_white > FALSE_ALARM and min(self.normalised_rms, usual) < known
        return bool(white or self.normalised_rms < _NEGLIGIBLE)

    @property
    def gap(self) -> float:
        """Normalised RMS above the noise floor."""
        return max(self.normalised_rms - 1.0, 0.0)


def whiteness(residuals: Sequence[NDArray[np.float64]]) -> float:
    """p value of one Ljung-Box test over all channels and logs.

    The residual's mean is not taken off, since simulated and measured have none in common: an offset counts.
    """
    statistic, freedom = 0.0, 0
    for channel in range(residuals[0].shape[1]):
        parts = [r[:, channel] for r in residuals if np.any(np.isfinite(r[:, channel]))]
        if sum(np.count_nonzero(np.isfinite(part)) for part in parts) < 4 * _LAGS:
            continue
        own, degrees = ljung_box(parts, _LAGS, mean=0.0)
        statistic, freedom = statistic + own, freedom + degrees
    return float(stats.chi2.sf(statistic, freedom)) if freedom else 1.0


def held_out_state(
    robot: Robot, logs: LogSet, noise: Mapping[str, float] | None = None, angles: Angles | None = None
) -> HeldOut:
    """Simulate `logs` with `robot`, its wheels' `angles` prescribed if given, and compare. Nothing else measured is fed
    back; only where a log starts in motion, its initial state is estimated from it.

    `noise` defaults to what the logs' own data say.
    """
    angles = angles or {}
    noise = dict(noise or noise_scale(logs))
    channels = [c for c in logs.channels.measured if any(c in counted_channels(log) for log in logs)]
    start = estimated_start(robot, logs, noise, angles)
    every = _simulated(robot, logs, start, angles)
    residuals = _scaled(logs, every, {name: noise[name] for name in channels})
    pooled = np.concatenate(residuals)
    return HeldOut(
        normalised_rms=rms(pooled),
        by_channel={c: rms(pooled[:, i]) for i, c in enumerate(channels)},
        residuals=tuple(residuals),
        noise={c: noise[c] for c in channels},
        p_white=whiteness(residuals),
        diverged=diverging(logs, every, noise),
    )


def residuals_of(
    robot: Robot,
    logs: LogSet,
    noise: Mapping[str, float],
    start: Mapping[str, NDArray[np.float64]],
    angles: Angles | None = None,
) -> list[NDArray[np.float64]]:
    """Residuals of every log [T, channels] in units of the `noise`, whose channels they are of, from the initial states
    `start` [E]."""
    return _scaled(logs, _simulated(robot, logs, start, angles or {}), noise)


def _simulated(
    robot: Robot, logs: LogSet, start: Mapping[str, NDArray[np.float64]], angles: Angles
) -> list[NDArray[np.float64]]:
    return simulate(robot, logs, start=start, integrator=integrator_for(robot, logs), prescribed=angles)


def _scaled(
    logs: LogSet, every: Sequence[NDArray[np.float64]], noise: Mapping[str, float]
) -> list[NDArray[np.float64]]:
    """Simulated minus measured in units of the noise, NaN where nothing was measured."""
    residuals, channels = [], list(noise)
    for log, simulated in zip(logs, every, strict=True):
        errors = errors_of(log, np.nan_to_num(simulated, nan=np.inf, posinf=np.inf, neginf=-np.inf))
        scaled = np.full((len(log), len(channels)), np.nan)
        for name, error in errors.items():
            scaled[:, channels.index(name)] = np.clip(error / noise[name], -_FARTHEST, _FARTHEST)
        residuals.append(scaled)
    return residuals
