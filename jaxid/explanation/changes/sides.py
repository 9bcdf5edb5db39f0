"""One of the two sets of logs with its fit, as what a comparison simulates: residuals and secants, whitened.

A row is one measured value of one log. What the fit gave little weight as an outlier is left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from numpy.typing import NDArray

from ...estimate.noise_colour import Colour, colour_of
from ...estimate.output_error.setup import at_fit
from ...estimate.result import Fit
from ...logs import LogSet, noise_scale
from ...logs.windows import in_windows
from ...parameters import ParameterError
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ...simulation.simulate import integrator_for, simulate_models

Array = NDArray[np.float64]
STEP = 1e-3
"""Step of secants, in units of a number's magnitude."""
_FAR = 1e6


@dataclass(frozen=True)
class SetOfLogs:
    """Logs of one side, E of them with T samples (the longest) of ny channels.

    `begin` are the initial states [E] by name, of which those that were estimated may move (`state_names`, `state_free`
    [E, s], in units of `state_scale` [s], with priors of a precision `state_stiffness` [s] a unit); `there` says what counts.
    """

    logs: LogSet
    integrator: Integrator
    begin: dict[str, Float[np.ndarray, " E"]]
    state_names: tuple[str, ...]
    state_free: Bool[np.ndarray, "E s"]
    state_scale: Float[np.ndarray, " s"]
    state_stiffness: Float[np.ndarray, " s"]
    measured: Float[np.ndarray, "E T ny"]
    there: Bool[np.ndarray, "E T ny"]
    sigma: Float[np.ndarray, " ny"]

    def simulated(
        self, robot: Robot, changes: Sequence[Mapping[str, float]], states: Array
    ) -> Float[np.ndarray, "K E T ny"]:
        """Outputs in units of the noise with each of K `changes` of the robot's numbers; `states` [E, s] in their units."""
        start = self._start(states)
        robots = [robot.with_values(**change) for change in changes]
        found = np.zeros((len(robots), *self.measured.shape))
        by_log = simulate_models(robots, self.logs, start=start, integrator=self.integrator)
        for e, y in enumerate(by_log):
            found[:, e, : y.shape[1]] = y
        scaled = np.nan_to_num(found / self.sigma, nan=_FAR, posinf=_FAR, neginf=-_FAR)
        return np.where(self.there, np.clip(scaled, -_FAR, _FAR), 0.0)

    def _start(self, states: Array) -> dict[str, Array]:
        moved = {
            name: self.begin[name] + self.state_scale[i] * np.where(self.state_free[:, i], states[:, i], 0.0)
            for i, name in enumerate(self.state_names)
        }
        return {**self.begin, **moved}

    @property
    def observed(self) -> Float[np.ndarray, "E T ny"]:
        """The measurements in units of the noise, zero where none counts."""
        return np.where(self.there, np.nan_to_num(self.measured) / self.sigma, 0.0)

    @property
    def nothing_moved(self) -> Float[np.ndarray, "E s"]:
        """Initial states as the fit has them."""
        return np.zeros(self.state_free.shape)

    def state_columns(self, robot: Robot, states: Array, now: Array) -> Float[np.ndarray, "E T ny s"]:
        """What a unit of each free initial state does to its own log's outputs, which are `now` [E, T, ny]."""
        found = np.zeros((*now.shape, len(self.state_names)))
        for i in range(len(self.state_names)):
            moved = states.copy()
            moved[:, i] += STEP
            found[..., i] = (self.simulated(robot, [{}], moved)[0] - now) / STEP
        return found * self.state_free[:, None, None, :]

    def colours(self, residual: Float[np.ndarray, "E T ny"]) -> tuple[Colour, ...]:
        """The colour of every channel's noise, in units of its standard deviation."""
        parts = np.where(self.there, residual, np.nan)
        return tuple(colour_of(list(parts[:, :, i])) for i in range(parts.shape[2]))

    def whiten(
        self, values: Float[np.ndarray, "*K E T ny"], colours: Sequence[Colour]
    ) -> Float[np.ndarray, "*K E T ny"]:
        """`values` filtered as makes noise of these colours white and of size one."""
        found = np.zeros_like(values)
        for e in range(values.shape[-3]):
            for i, colour in enumerate(colours):
                found[..., e, :, i] = colour.whiten(values[..., e, :, i], self.there[e, :, i])
        return found


def _left_out(fit: Fit, logs: LogSet, there: Bool[np.ndarray, "E T ny"]) -> Bool[np.ndarray, "E T ny"]:
    """What counts, without the outliers that the fit lists."""
    kept = there.copy()
    places = {log.name: e for e, log in enumerate(logs)}
    for outlier in fit.outliers:
        e = places.get(outlier.log)
        if e is None:
            continue
        log = logs[e]
        hit = (log.time >= outlier.start) & (log.time <= outlier.stop)
        kept[e, np.flatnonzero(hit), log.channels.measured.index(outlier.channel)] = False
    return kept


def side_of(fit: Fit, logs: LogSet) -> SetOfLogs:
    """The logs that `fit` was made from, with the initial states and the noise that it found.

    Raises `ParameterError` for a fit that estimated offsets between clocks.
    """
    if fit.clock_offsets:
        raise ParameterError(
            "this fit estimated an offset between the clocks of inputs and outputs, which a comparison has no place for; shift "
            "the logs by it (fit.clock_offsets) and fit them again without"
        )
    structure, problem, unknowns = at_fit(fit, logs)
    logs = logs if fit.window is None else in_windows(logs, fit.window)
    names = structure.state_names
    begin = {name: np.array(np.broadcast_to(values, len(logs)), float) for name, values in problem.start.items()}
    scale, free = np.asarray(problem.state_scale, float), np.asarray(problem.state_free, bool)
    for i, name in enumerate(names):
        begin[name] = begin[name] + np.where(free[:, i], scale[i] * np.asarray(unknowns.states)[:, i], 0.0)
    left_out = {name for name, status in fit.log_status.items() if status.startswith("left out")}
    there = np.asarray(problem.mask, bool) & ~np.array([log.name in left_out for log in logs])[:, None, None]
    return SetOfLogs(
        logs=logs,
        integrator=integrator_for(fit.robot, logs),
        begin=begin,
        state_names=names,
        state_free=free,
        state_scale=scale,
        state_stiffness=np.sqrt(np.asarray(problem.state_precision, float)) * scale,
        measured=np.asarray(problem.outputs, float),
        there=_left_out(fit, logs, there),
        sigma=_noise(fit, logs, np.where(np.asarray(problem.sigma) > 0, np.asarray(problem.sigma, float), 1.0)),
    )


def _noise(fit: Fit, logs: LogSet, found: Float[np.ndarray, " ny"]) -> Float[np.ndarray, " ny"]:
    """The noise of every channel: as the fit `found` it, which weighed by what it leaves; of one that does not follow its logs
    at most what these show without a model, or what it lacks would pass for noise."""
    if fit.judgement is None or fit.judgement.verdict not in ("poor", "failed"):
        return found
    shown = noise_scale(logs)
    own = np.array([shown.get(name, np.inf) for name in logs.channels.measured])
    return np.where(own > 0, np.minimum(found, own), found)
