"""Judge a linear fit by its equations: what they leave, whether that is noise, and what noise in the regressors has done."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ...logs.noise import noise_scale
from ..confidence.agreement import rms
from ..judge import (
    ABOVE,
    FOLLOWS,
    LEFT,
    LEFT_IN_ONE,
    NOTHING,
    POOR,
    drivers,
    judged,
    step_of,
    with_integration,
)
from ..judgement import Judgement, Verdict
from ..lacking import FALSE_ALARM as LACKING
from ..noise_colour import Colour, colour_in_stretches
from ..residual_tests import FALSE_ALARM, relation, whiteness
from ..result import Fit
from ..slow_part import slow_part
from .neglected import neglected
from .regressor_noise import NoiseResponse, noise_response, series, whiteness_of
from .simulated_motion import followed_simulation, twins_of
from .weighted_least_squares import Solution
from .window_equations import window_equations

Array = NDArray[np.float64]
BIASED = 0.5
"""Standard errors by which noise may move an estimate before its interval holds the truth too seldom (92 %)."""
_CLEAR = 2.0
"""Standard errors of a predicted bias that it must exceed."""
_NOT_PREDICTED = (
    "Noise on the measured speeds also enters the regressors (errors in variables); how far that moves the estimate could not "
    "be predicted here, and the standard errors do not include it. Output error has no such bias."
)
_TELLS = (
    "Output error tells by its residual what the equations leave: missing from the model, coloured noise of a sensor, or a "
    "disturbance of the motion, which prediction error fits better."
)
_INNOCENT = "Take instrumental variables or output error, which it does not bias."


@dataclass(frozen=True)
class Residual:
    """What equations leave of every speed that they predict: `parts` by name, [T] of each log, NaN where there is no
    equation, with the p value of each being `white`, and what they may follow (`drivers`).

    `whole`: whether the parts are the noise itself, slow or not; stretches lose what is slower than they are long.
    """

    parts: Mapping[str, Sequence[Array]]
    white: Mapping[str, float]
    drivers: Mapping[str, Sequence[Array]]
    whole: bool


def equation_noise(logs: LogSet) -> dict[str, float]:
    """The sensors' noise, and that of speeds which no log measures but a position stands for: of its central differences."""
    noise = with_integration(logs, noise_scale(logs))
    found = dict(noise)
    one_for_one = {name: own for name, own in logs.channels.substitutes.items() if isinstance(own, str)}
    for name, position in one_for_one.items():
        own = [log for log in logs if np.isfinite(log.output(position)).any()]
        if own and not any(np.isfinite(log.output(name)).any() for log in logs):
            found[name] = noise[position] / (np.sqrt(2.0) * float(np.median([log.sampling_interval for log in own])))
    return found


def judged_equations(
    fit: Fit, logs: LogSet, residual: Residual | None = None, biased: Mapping[str, float] | None = None
) -> Fit:
    """A linear fit with its judgement, by the scatter of its equations in units of the sensors' noise and what else is
    known of their `residual`.

    `Fit.noise` is that of the speeds that the equations predict over their stretches; what more there is than the sensors
    show, the equations lack. Over whole logs the model may do worse: `compare` says so. `biased`: parameters that noise in
    the regressors moves, and how many standard errors.
    """
    noise = equation_noise(logs)
    by_channel = {name: level / noise[name] for name, level in fit.noise.items()}
    pooled = rms(np.array(list(by_channel.values())))
    biased = (biased or {}) if pooled >= NOTHING else {}  # there is no noise
    sentences, coloured, doubtful = [], [], False
    if pooled > ABOVE:
        sentences.append(f"The equations are off by {pooled:.3g} times the noise that the sensors show (RMS).")
    if residual is not None:
        coloured, more, doubtful = _left(residual, logs, noise, by_channel)
        sentences += more
    verdict: Verdict = "sound"
    if pooled > POOR or doubtful:
        verdict = "poor"
    elif pooled > ABOVE or coloured:
        verdict = "coloured"
    better = ""
    if biased:
        # Interpolation between the samples is part of it.
        moved = ", ".join(f"{name} by {by:+.1f}" for name, by in biased.items())
        what = (
            "The noise of the sensors"
            if verdict == "sound"
            else "What the equations leave, if it is the sensors' noise,"
        )
        better = "" if verdict == "sound" else _TELLS
        verdict = "poor" if verdict == "poor" else "biased"
        sentences.insert(0, f"{what} is in the regressors, too, and moves the estimate: {moved} standard errors, so that "
                         "these intervals do not hold.")  # fmt: skip
        better = f"{_INNOCENT} {better}".strip()
    elif verdict != "sound":
        better = _TELLS
    white = None if residual is None else not coloured
    judgement = Judgement(verdict, pooled, by_channel, white, tuple(sentences), better, dict(biased))
    return judged(replace(fit, standard_errors="scatter"), judgement)


def _left(
    residual: Residual, logs: LogSet, noise: Mapping[str, float], by_channel: Mapping[str, float]
) -> tuple[list[str], list[str], bool]:
    """Channels whose residual is not white, what is to be said of the residual, and whether it makes the fit poor."""
    names = [name for name in residual.parts if by_channel.get(name, 0.0) >= NOTHING]
    coloured = [name for name in names if residual.white[name] < FALSE_ALARM / len(names)]
    follows = {name: relation(residual.parts[name], residual.drivers) for name in names}
    follows = {name: own.most for name, own in follows.items() if own.p_value < FOLLOWS / len(names)}
    sentences = [
        f"What the equations leave in {name} follows the motion (most of all {driver}): part of it is not in the model."
        for name, driver in follows.items()
    ]
    slow = [name for name in coloured if name not in follows and residual.whole]
    slow = {name: slow_part(residual.parts[name], noise[name], step_of(logs, name)) for name in slow}
    slow = {name: sizes for name, sizes in slow.items() if sizes[0] > LEFT or sizes[1] > LEFT_IN_ONE}
    for name, (every, _) in slow.items():
        sentences.append(
            f"What is slow in the residual of {name}, {every:.2g} times the noise, is hardly the sensor's, unless that has "
            "slow noise beside its white one: neighbours differ by white noise alone."
        )
    alone = [name for name in coloured if name not in follows and name not in slow]
    if alone:
        sentences.append(
            f"What the equations leave in {', '.join(alone)} is not white: coloured noise, or dynamics that are missing."
        )
    return coloured, sentences, bool(follows or slow)


def judged_least_squares(fit: Fit, logs: LogSet, solution: Solution, window: int) -> Fit:
    """An integral least-squares fit, over stretches of `window` samples, with its judgement: residual, and the bias that
    noise in the regressors (and what interpolation between the samples gets wrong) brings.

    Noise is added to the estimate's own motion, or to the measured one where the simulation does not follow it. White noise
    of the size that the sensors show; where the equations leave more than that, or something that is not
    white, first-order noise that would leave as much.
    """
    here = window_equations(fit.robot, logs, "speed", window)
    names, speeds, remembered = np.array(here.names), here.speeds, here.memory
    free = ~solution.held & np.array([status != "at_bound" for status in solution.status])
    usable = len(here) and np.isfinite(here.regressors).all() and np.isfinite(here.targets).all()
    unpredicted = replace(fit, notes=(_NOT_PREDICTED, *fit.notes))
    if not usable or not free.any() or not fit.noise:
        return judged_equations(unpredicted, logs)
    about = replace(here, targets=here.targets - here.regressors @ solution.theta)
    parts = {name: series(about, i) for i, name in enumerate(speeds) if name in fit.noise}
    del here, about  # large for long logs
    noise = {name: Colour.first_order(level, 0.0) for name, level in with_integration(logs, noise_scale(logs)).items()}
    simulated = followed_simulation(fit.robot, logs)
    motion = logs if simulated is None else twins_of(logs, simulated)
    # Speeds that never moved have no equations.
    weights = np.array([solution.noise[i] if name in fit.noise else np.inf for i, name in enumerate(speeds)])

    def response(noise: Mapping[str, Colour]) -> NoiseResponse | None:
        return noise_response(fit.robot, motion, window, free, noise, weights)

    by_noise = response(noise)
    if by_noise is None:
        return judged_equations(unpredicted, logs)
    white = {name: whiteness_of(parts[name], [own[speeds.index(name)] for own in by_noise.residuals]) for name in parts}
    levels = equation_noise(logs)
    more = {
        name: colour_in_stretches(parts[name], window)
        for name in parts
        if np.isfinite(np.concatenate([log.output(name) for log in logs])).any()
        and (fit.noise[name] > ABOVE * levels[name] or white[name] < FALSE_ALARM / len(parts))
    }
    if more:
        by_noise = response(noise | more) or by_noise
    errors = np.where(solution.errors() > 0, solution.errors(), np.inf)
    bias, known = by_noise.bias / errors, by_noise.known / errors
    clear = (np.abs(bias) > BIASED) & (np.abs(bias) > _CLEAR * known)
    clear &= np.array([status == "identified" for status in solution.status])
    biased = {str(name): float(b) for name, b in zip(names[clear], bias[clear], strict=True)}
    # The measured speeds share their noise with the residual.
    nothing = [np.zeros_like(log.outputs) for log in logs]
    driving = drivers(logs, nothing if simulated is None else simulated)
    found = judged_equations(fit, logs, Residual(parts, white, driving, whole=False), biased)
    if simulated is None or found.judgement is None or not found.judgement.trustworthy:
        return found
    moved = {name: fit[name].std_error for name in names if np.isfinite(fit[name].std_error)}
    lacking = neglected(fit.robot, logs, moved, with_integration(logs, noise_scale(logs)), remembered)
    if lacking is None or not lacking.p_value < LACKING:
        return found
    return judged(replace(fit, standard_errors="scatter"), found.judgement.doubted(lacking.sentence(fit)))


def judged_instruments(fit: Fit, logs: LogSet, parts: Mapping[str, Sequence[Array]], simulated: Sequence[Array]) -> Fit:
    """A fit by instrumental variables with its judgement: its equations' errors [T] of each log are the sensors' noise."""
    white = {name: whiteness(own).p_value for name, own in parts.items()}
    white = {name: 1.0 if np.isnan(p) else p for name, p in white.items()}
    residual = Residual(parts, white, drivers(logs, simulated), whole=True)
    return replace(judged_equations(fit, logs, residual), standard_errors="robust")
