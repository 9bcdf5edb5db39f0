r"""Whether a free simulation of a log can mean anything, from how errors of the state grow along it.

The state transition matrices Phi of short stretches, each linearised at the state that the log itself shows there, are
multiplied up over longer and longer spans. In units of the signals' own scatter,

    m(span) = mean over where the span begins of log ||Phi(begin + span, begin)||,

and its slope is the largest Lyapunov exponent (finite-time; Benettin et al., Meccanica 15, 1980). It does not hang on the
units, on whether the free simulation itself stays near the measurement, or on the parameters being right to the last
percent. Three kinds of plant differ by it:

- "stable": what the outputs show of an error at the start dies away;
- "integrating": it neither dies away nor grows by more than a power of time, so that every disturbance stays (a position);
- "unstable": it grows exponentially, in the outputs too (an inverted pendulum without its controller; chaos).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..._float64 import in_float64
from ...logs import Log, LogSet
from ...logs.noise import noise_scale
from ...robots.robot import Robot
from ...simulation.local_slopes import transitions
from ...simulation.rollout import Integrator
from ...simulation.start import states_at

Array = NDArray[np.float64]
Kind = Literal["stable", "integrating", "unstable"]

_STRETCHES = 100
"""Stretches into which a log is cut: the resolution of the spans."""
_SHORTER, _LONGER = 0.4, 0.8
"""Spans that are compared, as shares of the log: the second is twice the first."""
_POWER = float(np.log(4.0))
"""Growth over twice the span that a square of time explains; a double integrator's errors grow linearly."""
_LASTING = float(np.log(1.25))
"""Decay over twice the span below which nothing is forgotten within the log."""
_FORGOTTEN = float(np.log(0.05))
_EXPLODED = 1e100
"""Growth of an error over one stretch beyond which it is as good as infinite, and whose square is still a number."""


@dataclass(frozen=True)
class Predictability:
    """How errors of the state grow along the logs.

    - `kind`: "stable", "integrating" or "unstable", of the log on which errors grow most.
    - `growth_rate` [1/s]: of errors of the state, over the longest spans; negative where they die away.
    - `doubling_time` [s]: infinite unless unstable.
    - `horizon` [s]: after which an error as small as the noise is as large as the signal; infinite unless unstable.
    - `memory` [s]: after which the outputs show less than a twentieth of an error at the start; infinite unless stable.
    - `log`: the log that these numbers are of, and its `duration` [s].
    """

    kind: Kind
    growth_rate: float
    horizon: float
    memory: float
    log: str
    duration: float

    @property
    def doubling_time(self) -> float:
        """Time in which an error doubles [s]."""
        return float(np.log(2.0)) / self.growth_rate if self.kind == "unstable" else float("inf")

    @property
    def sentence(self) -> str:
        """The same in words."""
        if self.kind == "unstable":
            reach = (
                f"after {self.horizon:.2g} s of the {self.duration:.3g} s of {self.log} it says nothing"
                if self.horizon < self.duration
                else f"over the {self.duration:.3g} s of {self.log} an error as small as the noise stays below the signal"
            )
            return f"the free simulation is unstable: errors double every {self.doubling_time:.2g} s, and {reach}"
        if self.kind == "integrating":
            return (
                "the free simulation integrates: what disturbs the motion stays in the outputs to the end of the log, and "
                "the effects of disturbances add up"
            )
        return f"the free simulation is stable: the outputs forget the start within {self.memory:.2g} s"


def _spans(transitions: Array, seen: Array) -> tuple[Array, Array]:
    """Mean log norm [W] of the products over spans of 1 to W stretches, and of what the outputs show of them."""
    W, s = transitions.shape[:2]
    product, scale = np.tile(np.eye(s), (W, 1, 1)), np.zeros(W)
    states, outputs = np.full(W, np.nan), np.full(W, np.nan)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for span in range(1, W):
            product = transitions[span - 1 : W - 1] @ product[: W - span]
            scale = scale[: W - span]
            size = np.maximum(np.linalg.norm(product, axis=(1, 2)), np.finfo(float).tiny)
            product, scale = product / size[:, None, None], scale + np.log(size)
            shown = np.linalg.norm(seen[span:] @ product, axis=(1, 2))
            states[span] = np.mean(scale)
            outputs[span] = np.mean(scale + np.log(np.maximum(shown, np.finfo(float).tiny)))
    return states, outputs


def _of_log(robot: Robot, log: Log, integrator: Integrator, noise: Mapping[str, float]) -> Predictability | None:
    """The numbers of one log; None where it is too short or shows no motion."""
    n = max(1, (len(log) - 1) // _STRETCHES)
    W = (len(log) - 1) // n
    if W < 10:
        return None
    at = np.arange(W) * n
    states = states_at(robot, log, at)
    names = robot.estimated_states
    dt = np.diff(log.time)[: W * n].reshape(W, n)
    inputs = log.inputs[: W * n].reshape(W, n, -1)
    phi, seen = transitions(robot, integrator, names, states, inputs, dt)
    shown = [j for j in range(log.outputs.shape[1]) if np.isfinite(log.outputs[:, j]).any()]
    spread = np.array([np.std(states[name]) for name in names])
    unit = np.where(spread > 0, spread, 1.0)
    signal = np.array([np.nanstd(log.outputs[:, j]) for j in shown])
    moving = signal > 0
    if not moving.any() or not np.isfinite(seen).all():
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        phi = phi / unit[:, None] * unit
    phi = np.clip(np.nan_to_num(phi, posinf=_EXPLODED, neginf=-_EXPLODED), -_EXPLODED, _EXPLODED)
    seen = seen[:, shown][:, moving] * unit / signal[moving][:, None]
    states_grown, outputs_grown = _spans(phi, seen)
    span = float(np.median(np.sum(dt, axis=1)))
    first, second = max(1, int(_SHORTER * W)), max(2, min(W - 1, int(_LONGER * W)))
    growth = states_grown[second] - states_grown[first]
    rate = float(growth / ((second - first) * span))
    kept = outputs_grown[second] - outputs_grown[first]
    # A state that grows and shows in no output takes no simulation from its log.
    unbounded = min(growth, kept) > _POWER
    kind: Kind = "unstable" if unbounded else "integrating" if kept > -_LASTING else "stable"
    # The smallest error is a channel's noise, in units of its signal.
    names_shown = [log.channels.measured[j] for j in np.array(shown)[moving]]
    least = min(noise[name] / level for name, level in zip(names_shown, signal[moving], strict=True))
    horizon = memory = float("inf")
    if kind == "unstable":
        lost = np.flatnonzero(states_grown[1:] > np.log(1.0 / max(least, 1e-12)))
        reach = np.log(1.0 / max(least, 1e-12)) / max(rate, np.finfo(float).tiny)
        horizon = float((lost[0] + 1) * span) if len(lost) else float(reach)
    if kind == "stable":
        small = np.flatnonzero(outputs_grown[1:] - np.nanmax(outputs_grown) < _FORGOTTEN)
        memory = float((small[0] + 1) * span) if len(small) else float(W * span)
    return Predictability(kind, rate, horizon, memory, log.name, log.duration)


@in_float64
def predictability(robot: Robot, logs: LogSet, *, integrator: Integrator | None = None) -> Predictability:
    """How errors of the state of `robot`, with its present parameters, grow along the measured motion of `logs`.

    Of several logs the one on which they grow most. Effects on commands and sensors count as absent. Logs of fewer than
    ten samples, or without any motion, say nothing; where there are only such, the answer is "stable" with a growth rate
    of NaN.
    """
    integrator = integrator or Integrator.suited(robot, max(log.sampling_interval for log in logs))
    noise = noise_scale(logs)
    found = [p for log in logs if (p := _of_log(robot, log, integrator, noise)) is not None]
    if not found:
        nan = float("nan")
        return Predictability("stable", nan, float("inf"), nan, logs[0].name, logs[0].duration)
    order: dict[Kind, int] = {"stable": 0, "integrating": 1, "unstable": 2}
    return max(found, key=lambda p: (order[p.kind], p.growth_rate))
