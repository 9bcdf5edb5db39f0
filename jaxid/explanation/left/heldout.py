"""How far a model is from logs it was not fitted to, in units of the noise, and whether anything is left to find."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..._distributions import chi_squared_tail, normal_tail
from ...estimate.confidence.agreement import counted_channels, diverging, errors_of, rms
from ...estimate.output_error.estimated_start import estimated_start
from ...estimate.portmanteau import robust_portmanteau
from ...logs import LogSet, noise_scale
from ...logs.noise import noise_error, usual_size
from ...robots.robot import Robot
from ...simulation.simulate import integrator_for, simulate
from ..level import current_level
from ..policy import current_policy
from ..refits.smoothed_angles import Angles

_LAGS = 20
_FARTHEST = 1e6


@dataclass(frozen=True)
class HeldOut:
    """Residuals (simulated minus measured) of a model on held-out logs.

    `normalised_rms` is 1 at the noise floor; `residuals` per log [T, channels] in units of the noise (NaN where nothing
    was measured); `p_white` the probability of autocorrelations and offsets this large if only noise were left.
    Where the wheels' angles were prescribed (see `smoothed_angles.py`), `simulated_freely` is the state without.
    `diverged` names the logs on which the simulation is no prediction any more; they count here, as very wrong.
    `noise_error`: standard deviation of the unit itself, the estimated noise, as a share of it. `within_errors`: whether what
    is left is what the standard errors of the parameters let expect (`within_errors.py`), `hung_on_it` the logs whose whole
    motion hangs on less than these, and `steady_rms` what is left where these move as they may; `unrelated`: whether it is
    small and follows nothing that drove the robot (`overrated.py`); `by_chance`: whether it is what delays that scatter leave
    (`by_chance.py`); `rounded`: whether it is what rounding to the sensors' steps makes (`rounding.py`), `inputs_rounded`
    whether it is no more than the rounding of the logged inputs makes (`rounded_inputs.py`).
    `but_fitted`: whether, though it passes for noise, what the model leaves on the fitted logs does not: it follows the motion.
    `false_alarm`: how often a complete model may be called incomplete by it (`level.py`), `negligible` the RMS below which a
    gap matters to nobody (`policy.py`).
    """

    normalised_rms: float
    by_channel: dict[str, float]
    residuals: tuple[NDArray[np.float64], ...]
    noise: dict[str, float]
    p_white: float
    simulated_freely: "HeldOut | None" = None
    diverged: tuple[str, ...] = ()
    noise_error: float = 0.0
    within_errors: bool = False
    hung_on_it: tuple[str, ...] = ()
    steady_rms: float = np.nan
    unrelated: bool = False
    by_chance: bool = False
    rounded: bool = False
    inputs_rounded: bool = False
    but_fitted: bool = False
    false_alarm: float = field(default_factory=current_level)
    negligible: float = field(default_factory=lambda: current_policy().negligible)

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
        return bool(
            (self.p_value >= self.false_alarm and not self.but_fitted)
            or self.normalised_rms < self.negligible
            or self.within_errors
            or self.unrelated
            or self.by_chance
            or self.rounded
            or self.inputs_rounded
        )

    @property
    def p_large(self) -> float:
        """Probability of a residual this large if only noise were left, whose size is known with an error."""
        # The noise was estimated without its far samples; where there are many, the residual is looked at in that way too.
        size = min(self.normalised_rms, self.usual)
        # Of logarithms: a noise that is underrated by a third makes a residual half as large again.
        error = np.sqrt(self.noise_error**2 + 0.5 / max(self.samples, 1))
        return float(normal_tail(np.log(max(size, 1e-300)) / error))

    @property
    def p_value(self) -> float:
        """Probability of this much structure, or size, if only white noise were left: two tests, of which the size's has a
        tenth of the level, since what a model lacks shows in both, and a noise that was rated too low in the size alone."""
        if not np.isfinite(self.normalised_rms):
            return 0.0
        return min(2.0 * self.p_white, 10.0 * self.p_large, 1.0)

    @property
    def usual(self) -> float:
        """The residual's size in units of the noise without what lies far from all others."""
        return usual_size(np.concatenate([r.ravel() for r in self.residuals]))

    @property
    def gap(self) -> float:
        """Normalised RMS above the noise floor."""
        return max(self.normalised_rms - 1.0, 0.0)

    @property
    def foretold(self) -> float:
        """The normalised RMS, without what no model can foretell of logs whose motion hangs on less than its errors."""
        return min(self.normalised_rms, self.steady_rms) if self.hung_on_it else self.normalised_rms


def whiteness(residuals: Sequence[NDArray[np.float64]]) -> float:
    """p value of one test of autocorrelations over all channels and logs, whatever tails and sizes their noise has.

    The residual's mean is not taken off, since simulated and measured have none in common: an offset counts.
    """
    statistic, freedom = structure(residuals)
    return float(chi_squared_tail(statistic, freedom)) if freedom else 1.0


def structure(residuals: Sequence[NDArray[np.float64]]) -> tuple[float, int]:
    """The statistic of `whiteness` and its degrees of freedom, none where no channel has samples enough."""
    statistic, freedom = 0.0, 0
    for channel in range(residuals[0].shape[1]):
        parts = [r[:, channel] for r in residuals if np.any(np.isfinite(r[:, channel]))]
        if sum(np.count_nonzero(np.isfinite(part)) for part in parts) < 4 * _LAGS:
            continue
        own, degrees = robust_portmanteau(parts, _LAGS)
        statistic, freedom = statistic + own, freedom + degrees
    return statistic, freedom


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
    return state_left(logs, _simulated(robot, logs, start, angles), {name: noise[name] for name in channels})


def state_left(logs: LogSet, every: Sequence[NDArray[np.float64]], noise: Mapping[str, float]) -> HeldOut:
    """What simulations of `logs`, `every` one [T, channels.measured], leave of the channels whose `noise` is given."""
    channels = list(noise)
    residuals = scaled_residuals(logs, every, noise)
    pooled = np.concatenate(residuals)
    return HeldOut(
        normalised_rms=rms(pooled),
        by_channel={c: rms(pooled[:, i]) for i, c in enumerate(channels)},
        residuals=tuple(residuals),
        noise=dict(noise),
        p_white=whiteness(residuals),
        noise_error=_noise_error(logs, residuals, channels),
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
    return scaled_residuals(logs, _simulated(robot, logs, start, angles or {}), noise)


def _noise_error(logs: LogSet, residuals: Sequence[NDArray[np.float64]], channels: Sequence[str]) -> float:
    """Standard deviation, as a share, of the noise that all channels together are measured in."""
    errors = noise_error(logs)
    samples = np.sum([np.count_nonzero(np.isfinite(r), axis=0) for r in residuals], axis=0)
    own = np.array([errors[name] if np.isfinite(errors[name]) else 0.0 for name in channels])
    return float(np.linalg.norm(samples * own) / max(samples.sum(), 1))


def _simulated(
    robot: Robot, logs: LogSet, start: Mapping[str, NDArray[np.float64]], angles: Angles
) -> list[NDArray[np.float64]]:
    return simulate(robot, logs, start=start, integrator=integrator_for(robot, logs), prescribed=angles)


def scaled_residuals(
    logs: LogSet, every: Sequence[NDArray[np.float64]], noise: Mapping[str, float]
) -> list[NDArray[np.float64]]:
    """Simulated minus measured in units of the `noise`, whose channels count; NaN where nothing was measured."""
    residuals, channels = [], list(noise)
    for log, simulated in zip(logs, every, strict=True):
        errors = errors_of(log, np.nan_to_num(simulated, nan=np.inf, posinf=np.inf, neginf=-np.inf))
        scaled = np.full((len(log), len(channels)), np.nan)
        for name in [name for name in errors if name in noise]:
            scaled[:, channels.index(name)] = np.clip(errors[name] / noise[name], -_FARTHEST, _FARTHEST)
        residuals.append(scaled)
    return residuals
