"""Output error in windows of the logs: multiple shooting without continuity, and when it is called for.

Every window is an experiment with initial states of its own, estimated with the parameters, so that errors grow for the
length of a window only (Bock, Numerical Treatment of Inverse Problems, 1983; Ribeiro et al., Automatica 121, 2020, on the
smoothness that it buys). Nothing ties the windows together: a disturbance between two of them costs nothing.

`choose` decides by evidence. It stays with the free simulation where that follows the measurement, and where the outputs'
errors do not grow without bound, so that a large residual means an incomplete model. Otherwise: windows over which errors
grow twentyfold where the simulation is unstable, and windows as long as the residual stays at the noise where it
integrates in a closed loop.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ...logs import LogError, LogSet
from ...logs.noise import noise_scale
from ...logs.windows import bridged, in_windows, stitched
from ...parameters import ParameterError
from ...robots.robot import Robot
from ..result import Fit
from .direct import simulated_now
from .feedback import Feedback, fed_back
from .from_optimum import channel_noise
from .optimum import Optimum
from .predictability import Predictability, predictability
from .problem import Problem, Structure, Unknowns
from .setup import Starts, build, start_values
from .solvers import minimise_compiled
from .window_start import started

GROWTH = float(np.log(20.0))
"""Growth of errors (logarithm) over one window of an unstable plant."""
_POOR, _GOOD = 2.0, 1.5
"""Residual in units of the noise: too large for a free simulation to be believed; small enough for a window."""
_VISIBLE = 1e-3
"""Share of the signal below which no residual is poor: the integrator's own error."""
_FEWEST = 10
"""Windows that the longest choice makes of a log, and samples of the shortest share of one that is fitted by itself."""
_HORIZONS = (0.125, 0.25, 0.5)
"""Shares of a window that are fitted before the whole."""
_LENGTHENED, _AS_GOOD = 1, 1.02
"""How often windows of an unstable plant are doubled, from good parameters, and what their residual may then gain: longer
windows tell more, as errors of the parameters grow along them, too."""
_BETTER = 0.5
"""Share of the free simulation's residual that windows must come below to be taken."""


Unless = Callable[[Problem, Optimum], bool]
"""Whether a first minimum of the free simulation is not worth going on from."""


@runtime_checkable
class Once(Protocol):
    """A fit in windows of so many seconds, or free, from a start. Raises `Lost` where `unless` says so."""

    def __call__(self, window: float | None, start: Starts, unless: Unless | None = None) -> Fit: ...


class Lost(Exception):
    """A free simulation has not found the way; what it leaves, in units of the noise."""

    def __init__(self, ratio: float):
        self.ratio = ratio


def left_over(problem: Problem, optimum: Optimum, logs: LogSet) -> float:
    """Largest residual of a channel in units of its noise."""
    if not np.isfinite(optimum.cost):
        return float("inf")
    levels = np.asarray(channel_noise(problem, optimum.triangle.squares))
    return _largest(dict(zip(logs.channels.measured, levels, strict=True)), logs, free=True)


def condensed(fit: Fit, logs: LogSet, seconds: float) -> Fit:
    """`fit`, to the windows of `logs`, with one status a log instead of one a window."""
    status = {}
    for log in logs:
        own = [what for name, what in fit.log_status.items() if name == log.name or name.startswith(f"{log.name}[")]
        odd = [what for what in own if what != "fitted"]
        text = f"fitted; {len(odd)} of its {len(own)} windows leave far more than the others"
        status[log.name] = text if odd else "fitted"
    notes = tuple(f"{name} {what}." for name, what in status.items() if what != "fitted")
    kept = tuple(note for note in fit.notes if not any(note.startswith(f"{log.name}") for log in logs))
    return replace(fit, log_status=status, notes=(*kept, *notes), window=seconds)


def approached(structure: Structure, problem: Problem, unknowns: Unknowns, max_steps: int = 30) -> Unknowns:
    """`unknowns` after windows of a growing share of their length were fitted.

    The noise in a measured slope, grown along a whole window, may leave the measurement for good; over an eighth of it, it
    does not, and what that tells of the initial state holds for a quarter.
    """
    samples = int(np.asarray(problem.mask).any(axis=-1).sum(axis=1).max())
    early = np.arange(problem.mask.shape[1])
    for share in _HORIZONS:
        if share * samples >= _FEWEST:
            shorter = replace(problem, mask=problem.mask & (early < share * samples)[None, :, None])
            found = minimise_compiled(structure, shorter, unknowns, max_steps=max_steps)
            unknowns = found.unknowns if bool(np.isfinite(found.cost)) else unknowns
    return unknowns


def followed(robot: Robot, logs: LogSet, seconds: float, noise: Mapping[str, float]) -> list[NDArray[np.float64]]:
    """Simulated outputs [T, channels.measured] of every log in windows of `seconds`, each from the initial state that suits
    it best with all parameters held; interpolated over stretches without measurement.

    `noise` is each channel's standard deviation. Raises `ParameterError` if the robot has no free parameter.
    """
    windows = in_windows(logs, seconds)
    start = start_values(robot, None)
    structure, problem, unknowns = build(robot, windows, start=start, initial="estimate")
    problem = started(logs, structure, problem)
    sigma = np.asarray([noise[name] for name in logs.channels.measured])
    problem = replace(problem, sigma=sigma, free=np.zeros(problem.free.shape, dtype=bool))
    there = minimise_compiled(structure, problem, approached(structure, problem, unknowns)).unknowns
    simulated = simulated_now(structure, problem, there)
    return [bridged(whole) for whole in stitched(logs, seconds, list(simulated))]


def _ratio(fit: Fit | None, logs: LogSet) -> float:
    """Largest residual of a channel in units of its noise; infinite without a fit."""
    return float("inf") if fit is None else _largest(fit.noise, logs, free=fit.window is None)


def _largest(noise: Mapping[str, float], logs: LogSet, *, free: bool) -> float:
    scale, found = noise_scale(logs), 0.0
    for name, level in noise.items():
        y = np.concatenate([log.output(name) for log in logs])
        if not np.isfinite(y).any():
            continue
        least = max(scale[name], _VISIBLE * float(np.nanstd(y)) / _POOR)
        found = max(found, float(level) / (least if free else scale[name]))
    return found if np.isfinite(found) else float("inf")


def _white(fit: Fit) -> bool:
    """Whether nothing but white noise is left. What is left at the noise and is not may be a lost simulation: motion that is as
    quick as a controller that answers every sample passes for noise."""
    return fit.judgement is None or bool(fit.judgement.white)


def _worse(one: Predictability, other: Predictability) -> Predictability:
    order = ("stable", "integrating", "unstable")
    return max(one, other, key=lambda p: (order.index(p.kind), np.nan_to_num(p.growth_rate)))


def _growing(robot: Robot, logs: LogSet, free: Fit | None, start: Starts) -> Predictability:
    """Predictability at the start values and at the free simulation's estimate, whichever is worse."""
    if isinstance(start, Fit):
        robot = robot.with_values(**{n: v for n, v in start.robot.parameters.numbers.items() if n in robot.parameters})
    elif isinstance(start, Mapping):
        robot = robot.with_values(**start)
    here = predictability(robot, logs)
    return here if free is None else _worse(here, predictability(free.robot, logs))


def _shortest(robot: Robot, logs: LogSet) -> float:
    """Twice as many samples as there are states to estimate, and two more [s]."""
    interval = max(log.sampling_interval for log in logs)
    channels = max(1, len(logs[0].measured))
    return interval * (2 * int(np.ceil(len(robot.estimated_states) / channels)) + 2)


def _by_noise(robot: Robot, logs: LogSet, once: Once, start: Starts) -> Fit:
    """The fit in the longest windows whose residual is at the noise, or in the shortest sensible ones."""
    shortest = _shortest(robot, logs)
    longest = max(max(log.duration for log in logs) / _FEWEST, shortest)
    fit = once(longest, start)
    upper = _ratio(fit, logs)
    if upper <= _GOOD or longest <= shortest:
        return fit
    least = once(shortest, fit)
    lower = _ratio(least, logs)
    if lower > _GOOD:
        return least
    # The residual of an integrated disturbance grows as a power of the length.
    power = np.log(upper / lower) / np.log(longest / shortest)
    between = float(np.clip(shortest * (_GOOD / lower) ** (1.0 / power), shortest, longest))
    if between < 1.5 * shortest:
        return least
    middle = once(between, least)
    return middle if _ratio(middle, logs) <= _GOOD else least


def _by_growth(growth: Predictability, robot: Robot, logs: LogSet, once: Once, start: Starts) -> Fit:
    """The fit in windows over which errors grow twentyfold, or in shorter ones where that leaves more than noise."""
    shortest = _shortest(robot, logs)
    length = max(GROWTH / growth.growth_rate, shortest)
    fit = once(min(length, growth.duration / 2), start)
    if _ratio(fit, logs) <= _GOOD:
        for _ in range(_LENGTHENED):
            if 2 * (fit.window or length) > growth.duration / 2:
                break
            longer = once(2 * (fit.window or length), fit)
            if not _ratio(longer, logs) <= _AS_GOOD * _ratio(fit, logs):
                break
            fit = longer
        return fit
    other = once(max((fit.window or length) / 4, shortest), start)
    return other if _ratio(other, logs) < _BETTER * _ratio(fit, logs) else fit


def capital(sentence: str) -> str:
    return sentence[0].upper() + sentence[1:]


def _sentence(growth: Predictability, loop: Feedback, free: float, fit: Fit, logs: LogSet) -> str:
    integrator = "an integrator" if growth.kind == "integrating" else "an unstable plant"
    record = (
        f"The record is a closed loop around {integrator} (residuals foretell {100 * loop.share:.0f} % of what is new in "
        f"{loop.name}): "
        if loop.closed
        else ""
    )
    leaves = f"leaves {free:.3g} times the noise" if np.isfinite(free) else "diverges"
    text = capital(
        f"{record}{growth.sentence}, and {leaves}. Fitted in windows of {fit.window:.3g} s, each from an initial state of "
        f"its own; they leave {_ratio(fit, logs):.3g} times the noise."
    )
    if loop.closed:
        text += " With the controller given (`controller=`), the loop itself can be simulated over the whole record."
    return text


def _in_windows(growth: Predictability, robot: Robot, logs: LogSet, once: Once, start: Starts) -> Fit | None:
    """The fit in the windows that suit the growth of errors; None where it fails."""
    by = _by_growth if growth.kind == "unstable" else lambda growth, *others: _by_noise(*others)
    try:
        fit = by(growth, robot, logs, once, start)
    except (ParameterError, LogError):
        return None
    return None if fit.judgement is not None and fit.judgement.verdict == "failed" else fit


def _taken(
    fit: Fit,
    growth: Predictability,
    loop: Feedback,
    poor: float,
    logs: LogSet,
    once: Once,
    unless: Unless | None = None,
) -> Fit:
    """`fit`, in windows, with a note that says why; or the free one from its good parameters, where that follows the logs:
    a whole log tells more than its windows. The free simulation from the start leaves `poor` times the noise."""
    if growth.kind == "unstable" and _ratio(fit, logs) <= _GOOD:
        try:
            again = once(None, fit, unless)
        except (ParameterError, Lost):
            again = None
        if again is not None and _ratio(again, logs) <= _GOOD * min(_ratio(fit, logs), 1.0):
            note = (
                f"The free simulation is lost at the start values; a fit in windows of {fit.window:.3g} s led to values from "
                "which it follows the logs."
            )
            return replace(again, notes=(*again.notes, note))
    return replace(fit, notes=(_sentence(growth, loop, poor, fit, logs), *fit.notes))


def choose(robot: Robot, logs: LogSet, once: Once, start: Starts) -> Fit:
    """The free fit `once(None, start)`, or one in windows where evidence asks for them, with a note that says so.

    Raises `ParameterError` where neither the free simulation nor windows lead anywhere.
    """
    free, why, found = None, None, None

    def lost(problem: Problem, optimum: Optimum) -> bool:
        """Far from the measurement, at no minimum, with a simulation that is unstable: other starts and polishing, most of
        a fit's work, lead nowhere."""
        nonlocal found
        if bool(optimum.converged) or left_over(problem, optimum, logs) <= _POOR:
            return False
        found = found or _growing(robot, logs, None, start)
        return found.kind == "unstable" and found.horizon < found.duration

    try:
        free = once(None, start, lost)
    except ParameterError as error:
        why = error
    except Lost as astray:
        assert found is not None
        fit, loop = _in_windows(found, robot, logs, once, start), fed_back(None, logs)
        taken = None
        if fit is not None and _ratio(fit, logs) <= min(_GOOD, _BETTER * astray.ratio):
            taken = _taken(fit, found, loop, astray.ratio, logs, once, lost if loop.closed else None)
        # What only its controller keeps from falling is followed by no free simulation, whatever the start. Another record
        # may be, and then tells more than its windows.
        if taken is not None and (taken.window is None or loop.closed):
            return taken
        try:
            free = once(None, start)
        except ParameterError as error:
            why = error
        if taken is not None and _ratio(free, logs) > _POOR:
            return taken
    poor = _ratio(free, logs)
    within = free is not None and poor <= _POOR
    if free is not None and within and _white(free):
        return free
    growth = _growing(robot, logs, free, start)
    if free is not None and within and growth.kind != "unstable":
        return free
    loop = fed_back(free, logs)
    # An error of what integrates grows by a power of time, which is no instability: a free simulation can follow. Windows
    # would hide what the model lacks, but where the record is a loop, whose inputs answer every disturbance so far.
    if growth.kind == "stable" or (growth.kind == "integrating" and free is not None and not loop.closed):
        if free is None:
            raise why or ParameterError(f"the simulation of {robot.name!r} diverges")
        return free
    fit = _in_windows(growth, robot, logs, once, start)
    if fit is None or not _ratio(fit, logs) < _BETTER * poor:
        if free is None:
            raise why or ParameterError(f"the simulation of {robot.name!r} diverges")
        if within:
            return free
        note = f"{capital(growth.sentence)}; windows leave as much, so that the model itself is suspect."
        return replace(free, notes=(*free.notes, note))
    return _taken(fit, growth, loop, poor, logs, once)
