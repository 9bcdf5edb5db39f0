"""How far a model is from logs it was not fitted to, in units of the noise, and whether anything is left to find."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ..logs import LogSet, noise_level
from ..robots.robot import Robot
from ..simulate.simulate import simulate

FALSE_ALARM = 0.005
"""How often a residual that is nothing but white noise is taken for a gap."""
_LAGS = 20


@dataclass(frozen=True)
class HeldOut:
    """Residuals of a model on held-out logs.

    `normalised_rms` is 1 at the noise floor; `residuals` per log [T, outputs] in units of the noise (NaN where nothing
    was measured); `p_white` the probability of autocorrelations this large if only noise were left.
    """

    normalised_rms: float
    by_channel: dict[str, float]
    residuals: tuple[NDArray[np.float64], ...]
    noise: dict[str, float]
    p_white: float

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
        """Whether nothing but noise is left: white residuals, or too small a gap to matter."""
        return self.normalised_rms < 1.01 or (self.p_white > FALSE_ALARM and self.normalised_rms < 1.1)


def _whiteness(residuals: list[NDArray[np.float64]]) -> float:
    """p value of a pooled portmanteau test over all channels and logs."""
    statistic, freedom = 0.0, 0
    for channel in range(residuals[0].shape[1]):
        parts = [np.nan_to_num(r[:, channel]) for r in residuals if np.any(np.isfinite(r[:, channel]))]
        if not parts:
            continue
        parts = [part - part.mean() for part in parts]
        n = sum(part.size for part in parts)
        power = sum(float(part @ part) for part in parts)
        if power == 0:
            continue
        for lag in range(1, _LAGS + 1):
            rho = sum(float(part[lag:] @ part[:-lag]) for part in parts) / power
            statistic += n * (n + 2) * rho**2 / (n - lag)
            freedom += 1
    return float(stats.chi2.sf(statistic, freedom)) if freedom else 1.0


def held_out(robot: Robot, logs: LogSet, noise: dict[str, float] | None = None) -> HeldOut:
    """Simulate `logs` with `robot` and compare. `noise` defaults to what the logs' own data say."""
    noise = noise or noise_level(logs)
    channels = [c for c in logs[0].channels.outputs if np.isfinite(noise.get(c, np.nan))]
    residuals = []
    for log, simulated in zip(logs, simulate(robot, logs), strict=True):
        columns = [log.channels.measured.index(c) for c in channels]
        scale = np.array([noise[c] for c in channels])
        residual = (simulated[:, columns] - log.outputs[:, columns]) / scale
        residuals.append(np.clip(np.where(np.isfinite(log.outputs[:, columns]), residual, np.nan), -1e6, 1e6))
    pooled = np.concatenate(residuals)
    return HeldOut(
        normalised_rms=float(np.sqrt(np.nanmean(pooled**2))),
        by_channel={c: float(np.sqrt(np.nanmean(pooled[:, i] ** 2))) for i, c in enumerate(channels)},
        residuals=tuple(residuals),
        noise={c: noise[c] for c in channels},
        p_white=_whiteness(residuals),
    )
