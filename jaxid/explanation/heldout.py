"""How far a model is from logs it was not fitted to, in units of the noise, and whether anything is left to find."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ..estimate.confidence.validation import counted_channels
from ..estimate.output_error.estimated_start import estimated_start
from ..logs import LogSet, noise_level
from ..robots.robot import Robot
from ..simulation.simulate import simulate
from .told_angles import Angles

FALSE_ALARM = 0.005
"""How often a residual that is nothing but white noise is taken for a gap."""
_LAGS = 20
_NEGLIGIBLE = 1.005
"""Normalised RMS below which a gap is too small to matter, whatever its significance."""
_NOISE_UNKNOWN = 1.05
"""Normalised RMS above which even a white residual is a gap; below, the noise's own estimate may be at fault."""
_FARTHEST = 1e6


@dataclass(frozen=True)
class HeldOut:
    """Residuals (simulated minus measured) of a model on held-out logs.

    `normalised_rms` is 1 at the noise floor; `residuals` per log [T, channels] in units of the noise (NaN where nothing
    was measured); `p_white` the probability of autocorrelations and offsets this large if only noise were left.
    Of a model that was told its wheels' angles (see `told_angles.py`), `simulated_freely` is the state without.
    """

    normalised_rms: float
    by_channel: dict[str, float]
    residuals: tuple[NDArray[np.float64], ...]
    noise: dict[str, float]
    p_white: float
    simulated_freely: "HeldOut | None" = None

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
        white = self.p_white > FALSE_ALARM and self.normalised_rms < _NOISE_UNKNOWN
        return white or self.normalised_rms < _NEGLIGIBLE

    @property
    def gap(self) -> float:
        """Normalised RMS above the noise floor."""
        return max(self.normalised_rms - 1.0, 0.0)


def whiteness(residuals: tuple[NDArray[np.float64], ...] | list[NDArray[np.float64]]) -> float:
    """p value of one Ljung-Box test over all channels and logs.

    The residual's mean is not taken off, since simulated and measured have none in common: an offset counts.
    """
    statistic, freedom = 0.0, 0
    for channel in range(residuals[0].shape[1]):
        parts = [np.nan_to_num(r[:, channel]) for r in residuals if np.any(np.isfinite(r[:, channel]))]
        n = sum(np.count_nonzero(part) for part in parts)
        power = sum(float(part @ part) for part in parts)
        if n < 4 * _LAGS or power == 0:
            continue
        for lag in range(1, _LAGS + 1):
            rho = sum(float(part[lag:] @ part[:-lag]) for part in parts if len(part) > lag) / power
            statistic += n * (n + 2) * rho**2 / (n - lag)
            freedom += 1
    return float(stats.chi2.sf(statistic, freedom)) if freedom else 1.0


def held_out(
    robot: Robot, logs: LogSet, noise: Mapping[str, float] | None = None, angles: Angles | None = None
) -> HeldOut:
    """Simulate `logs` with `robot`, told its wheels' `angles` if given, and compare. Nothing measured is fed back; only
    where a log starts in motion, its initial state is estimated from it.

    `noise` defaults to what the logs' own data say.
    """
    angles = angles or {}
    noise = dict(noise or noise_level(logs))
    counted = {name for log in logs for name in counted_channels(log)}
    channels = [c for c in logs.channels.measured if c in counted and np.isfinite(noise.get(c, np.nan))]
    columns = [logs.channels.measured.index(c) for c in channels]
    scale = np.array([noise[c] for c in channels])
    residuals = []
    start = estimated_start(robot, logs, noise, angles)
    for log, simulated in zip(logs, simulate(robot, logs, start=start, driven=angles), strict=True):
        error = (simulated[:, columns] - log.outputs[:, columns]) / scale
        error = np.where(np.isfinite(simulated[:, columns]), error, _FARTHEST)
        residuals.append(np.clip(np.where(np.isfinite(log.outputs[:, columns]), error, np.nan), -_FARTHEST, _FARTHEST))
    pooled = np.concatenate(residuals)
    return HeldOut(
        normalised_rms=float(np.sqrt(np.nanmean(pooled**2))),
        by_channel={c: float(np.sqrt(np.nanmean(pooled[:, i] ** 2))) for i, c in enumerate(channels)},
        residuals=tuple(residuals),
        noise={c: noise[c] for c in channels},
        p_white=whiteness(residuals),
    )
