"""Judge a fit by its residual.

The residual (simulated minus measured, of the fitted logs) is held against the noise that the data shows without any
model, against white noise, against what drove the robot, against the measured motion, and against the residuals of other
parameters (the start, the linear estimate). A fit that fails there has no standard errors: what they say holds for a model
that follows the logs.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..logs import LogSet
from ..logs.noise import as_sampled, usual_size
from .confidence.agreement import counted_channels, diverging, errors_of, rms
from .judgement import Judgement, Verdict
from .noise_colour import innovations_related
from .odd_log import odd_log
from .offset import offset
from .prior_conflict import prior_conflicts
from .residual_tests import FALSE_ALARM, FEWEST, autocorrelation, bursts, independent, relation, uneven, whiteness
from .result import Estimate, Fit
from .rounding import less_rounding, step_of
from .slow_part import SLOW, slow_part

Array = NDArray[np.float64]

POOR = 2.0
"""Root mean square of the residual, in units of the noise, from which a residual that follows the motion is poor."""
FAR = 10.0
"""The same of any residual: no colour of a sensor's noise hides that much of it from its differences over four samples."""
ABOVE = 1.2
"""Normalised RMS that is worth a word."""
_UNEXPLAINED = 0.5
"""Share of the motion's variance above which a fit that leaves it does not follow the logs."""
_INTEGRATION = 1e-4
"""Residual in units of the motion's standard deviation that may be the simulation's own error."""
_OWN_ERRORS = 3.0
"""How many times what shorter integration steps change of a position may be the simulation's own error."""
_FOLLOWS_LARGE = 0.01
"""The same where the residual is `POOR` in size and coloured: then a doubt is worth more than a false alarm is dear."""
NOTHING = 0.1
"""Residual in units of the noise that only logs without noise can have: rounding and integration, whatever it follows."""
_WORSE = 1.02
"""Ratio of two residuals (RMS) above which the first is worse."""
FOLLOWS = 0.002
"""p value below which a residual follows the motion. Against slow noise the test rejects a few times too often."""
LOST = (
    "Check the columns first, in every log: signs, units, which is which. Where they are right and a free simulation loses its "
    "way, short windows with initial states of their own (multiple shooting), the closed loop, or prediction error can follow."
)
"""What helps where a free simulation does not follow the logs."""
_NO_NOISE = (
    "The logs hold no noise: standard errors say only how well rounding and integration agree, and the truth may be many of "
    "them away."
)
_WANDERS = (
    "The residual wanders as disturbances of the motion make it (floor, slip, gears): if it is they, prediction error, which "
    "has noise of the process beside that of the sensors, fits it better."
)
_WANDERS_LIKE_A_SENSOR = (
    "The residual wanders as disturbances of the motion make it (floor, slip, gears), or slow noise of a sensor: if it is the "
    "motion, prediction error, which has noise of the process beside that of the sensors, fits it better; if it is the "
    "sensor, these estimates are the better ones. A log of the robot at rest tells."
)
_FEW_ROWS = (
    'Output error with `loss="cauchy"` (`--loss cauchy`) gives such samples little weight and lists them (`outliers`): look '
    "there which of the two they are."
)
_ENDLESS = 1e100  # a number whose square is still one
TAILS = 1.5
"""Root mean square of a residual, in units of its usual size, from which single samples make it: of Gaussian noise one, of
Student's with three degrees of freedom 1.4."""
_PULLED = 3.0
"""The same from which a few samples may have pulled the fit so far off that the others leave more than noise, too."""
LEFT, LEFT_IN_ONE = 0.7, 1.0
"""Slow part of a residual, in units of white noise, from which a fit is poor, of all logs and of one. It is not the sensor's,
so that nothing says that the estimates stand; from here on it is too much of the residual to be passed over."""


def _usual(parts: Sequence[Array]) -> float:
    return usual_size(np.concatenate(parts))


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:-1]) + (" and " if len(names) > 1 else "") + names[-1]


def _times(value: float) -> str:
    return f"{value:.2f}" if value < 10 else f"{value:.3g}"


def _until(u: Array) -> Array:
    """The input [T] that acted until each sample: the one of the sample before."""
    return np.append(u[:1], u[:-1])


def drivers(logs: LogSet, simulated: Sequence[Array]) -> dict[str, list[Array]]:
    """What a residual may follow: the inputs that acted until it was measured, and the simulated motion, its square with its
    sign, and its direction.

    The input of a sample acts after it. A controller makes it from what was measured there, noise included: with that noise
    it is related, whatever the model.
    """
    found = {name: [_until(log.input(name)) for log in logs] for name in logs.channels.inputs}
    for i, name in enumerate(logs.channels.measured):
        counted = any(name in counted_channels(log) for log in logs)
        if not counted and not any(logs.channels.stood_in(name, log.measured) for log in logs):
            continue
        own = [np.nan_to_num(np.asarray(y)[:, i]) for y in simulated]
        level = max(rms(np.concatenate(own)), 1e-300)
        found[name] = own
        found[f"{name}|{name}|"] = [y * np.abs(y) / level for y in own]
        found[f"the direction of {name}"] = [np.tanh(10.0 * y / level) for y in own]
    names = [name for name in logs.channels.outputs if name in found]
    for k, one in enumerate(names):
        for other in names[k + 1 :]:
            found[f"{one} {other}"] = [a * b for a, b in zip(found[one], found[other], strict=True)]
    return found


def _wandering(parts: Sequence[Array]) -> bool:
    """Whether the residual wanders as disturbances of the motion make it: slowly, its changes whiter than itself."""
    rho, _ = autocorrelation(parts, 5, mean=0.0)
    changes, _ = autocorrelation([np.diff(part) for part in parts], 5)
    return bool(rho[1] > SLOW and np.abs(changes[1:]).max() < rho[1])


def judge(
    logs: LogSet,
    simulated: Sequence[Array],
    noise: Mapping[str, float],
    *,
    others: Mapping[str, Sequence[Array]] | None = None,
    own_error: Mapping[str, float] | None = None,
    moved: Sequence[Array] | None = None,
    unrelated: Collection[str] = (),
    fed_back: bool = False,
) -> Judgement:
    """Judge a fit by what it simulates of the logs it was fitted to.

    **Arguments:**

    - `simulated`: [T, channels.measured] of each log, at the estimate.
    - `noise`: standard deviation of each channel's noise, from the data alone (`noise_scale`).
    - `others`: what other parameters simulate, by words such as "its own start"; the fit must not be worse.
    - `own_error`: of channels that are positions, what the simulation's own error was seen to be, in the channel's unit.
    - `moved`: the motion [T, channels.measured] of each log which a residual may follow, where it is not what is simulated.
    - `unrelated`: channels whose residual is known to follow the motion by chance alone.
    """
    noise = with_integration(logs, noise, own_error)
    channels = [c for c in logs.channels.measured if any(c in counted_channels(log) for log in logs)]
    lost = diverging(logs, simulated, noise)
    errors = [errors_of(log, y) for log, y in zip(logs, simulated, strict=True)]
    if len(lost) == len(logs):
        why = ("The simulation diverges on every log.",)
        return Judgement("failed", np.nan, dict.fromkeys(channels, np.nan), False, why, LOST)
    kept = [k for k, log in enumerate(logs) if log.name not in lost]
    parts = {c: [errors[k][c] for k in kept if c in errors[k]] for c in channels}
    parts = {c: own for c, own in parts.items() if own}
    by_channel = {c: rms(np.concatenate(own)) / noise[c] for c, own in parts.items()}
    pooled = rms(np.concatenate([np.concatenate(own) / noise[c] for c, own in parts.items()]))

    failures = [f"The simulation diverges on {_listed(lost)}."] if lost else []
    for c, own in parts.items():
        y = np.concatenate([logs[k].output(c) for k in kept if c in errors[k]])
        left = rms(np.concatenate(own)) ** 2 / max(float(np.nanvar(y)), 1e-300)
        if by_channel[c] > POOR and left > _UNEXPLAINED:
            failures.append(
                f"The model does not follow {c}: its error of {rms(np.concatenate(own)):.3g} ({_times(by_channel[c])} "
                f"times the noise) is {np.sqrt(left):.2g} times what {c} varies by."
            )
    for words, other in (others or {}).items():
        names = [logs[k].name for k in kept]
        rival, rival_level = _pooled(logs, other, noise, names)
        # A fit that weighs its channels by what it leaves of each may leave much of one for the sake of another.
        if pooled > max(ABOVE, _WORSE * rival) and _pooled(logs, simulated, noise, names)[1] > _WORSE * rival_level:
            failures.append(
                f"The fit is worse than {words}: it leaves {_times(pooled)} times the noise, that {_times(rival)}."
            )

    # What rounding makes of slow speeds is a function of these, and nothing that the model lacks.
    told = {
        c: less_rounding([logs[k].output(c) + errors[k][c] for k in kept if c in errors[k]], own, step_of(logs, c))
        for c, own in parts.items()
    }
    series = {c: [as_sampled(part) for part in own] for c, own in told.items()}
    coloured = [c for c, own in series.items() if whiteness(own).p_value < FALSE_ALARM / len(parts)]
    outlying = [c for c, own in parts.items() if by_channel[c] > max(ABOVE, TAILS * _usual(own) / noise[c])]
    # Beside what most samples leave more than noise of, those far off say nothing, unless it is they that pull the fit away.
    above = [c for c, own in parts.items() if _usual(own) > ABOVE * noise[c]]
    pulled = [c for c in above if c in outlying and by_channel[c] * noise[c] > _PULLED * _usual(parts[c])]
    outlying = [] if len(pulled) < len(above) else outlying
    pulled = [c for c in pulled if c in outlying]
    driving = drivers(LogSet([logs[k] for k in kept]), [(moved or simulated)[k] for k in kept])
    follows = {}
    for c in parts:
        if by_channel[c] < NOTHING or c in unrelated:
            continue
        there = [c in errors[k] for k in kept]
        mine = {name: [x for x, ok in zip(own_, there, strict=True) if ok] for name, own_ in driving.items()}
        found = (innovations_related if fed_back and c in coloured else relation)(told[c], mine)
        large = pooled > POOR and c in coloured
        # Without rounding, which is most of some sensors' noise, a model's errors show that are nothing beside it.
        size = np.sqrt(found.share) * rms(np.concatenate(told[c])) / noise[c]
        little = size < NOTHING and told[c][0] is not parts[c][0]
        if found.p_value < (_FOLLOWS_LARGE if large else FOLLOWS) / len(parts) and not little:
            follows[c] = found.most
    sentences = list(failures)
    if pooled > ABOVE or failures:
        sentences.append(f"The residual is {_times(pooled)} times the noise that the sensors show (RMS).")
    odd = odd_log([logs[k].name for k in kept], [errors[k] for k in kept], noise, POOR) if pooled > ABOVE else ""
    if odd:
        sentences.append(odd)
    for c, name in follows.items():
        sentences.append(
            f"What is left in {c} follows the motion (most of all {name}): part of it is not in the model."
        )
    # A position's starts with its first reading, noise included.
    means = {c: offset(own, noise[c], ABOVE) for c, own in parts.items() if c not in logs.channels.positions}
    offsets = {c: mean for c, mean in means.items() if mean and c not in follows}
    for c, mean in offsets.items():
        size, way = f"{abs(mean):.3g} {logs.channels.units.get(c, '')}".rstrip(), "less" if mean > 0 else "more"
        sentences.append(
            f"What is measured of {c} is {size} {way} than the model makes on average ({_times(abs(mean) / noise[c])} times "
            "the noise): its sensor has an offset, or the model lacks something that is there all the time."
        )
    slow = {c: slow_part(series[c], noise[c], step_of(logs, c)) for c in coloured if c not in follows}
    slow = {c: sizes for c, sizes in slow.items() if sizes[0] > LEFT or sizes[1] > LEFT_IN_ONE}
    if slow:
        several = len(kept) > 1
        sizes = _listed([_times(every) + f" (on one log {_times(most)})" * several for every, most in slow.values()])
        sentences.append(
            f"Neighbouring residuals of {_listed(list(slow))} differ by white noise alone; what is slow in them, {sizes} times "
            "the noise, is then rather motion that the model does not make (dynamics that it lacks, inputs that were not "
            "those, disturbances), unless the sensor has slow noise beside its white one."
        )
    alone = [c for c in coloured if c not in follows and c not in slow]
    # So large that it is the sensor's only if it is as even as a sensor's noise.
    limit = _FOLLOWS_LARGE / (2 * max(len(alone), 1))
    bursty = [c for c in alone if pooled > POOR and min(bursts(series[c]), uneven(series[c])) < limit]
    # A few far samples pull squares off, and decide by themselves which part of the motion they happen to fall on.
    glitches = [c for c in outlying if c in bursty or c in follows or c in pulled]
    if glitches and not odd:
        sentences.append(
            f"A few samples of {_listed(glitches)} make it that large: outliers (a sensor that failed for a "
            "moment), or something brief that the model lacks (a push, a slip)."
        )
    uneven_ones = [c for c in bursty if c not in glitches]
    if uneven_ones:
        sentences.append(
            f"What is left in {_listed(uneven_ones)} comes in bursts or on one log more than on another, as no sensor's noise "
            "does: the model lacks something, or inputs were not those that were logged."
        )
    few = [c for c in alone if c not in bursty and pooled > POOR and independent(series[c]) < FEWEST]
    untested = [
        c
        for c, own in series.items()
        if by_channel[c] > POOR and sum(int(np.isfinite(part).sum()) for part in own) < FEWEST
    ]
    if untested:
        sentences.append(
            f"The logs hold fewer than {FEWEST} samples of {_listed(untested)}: nothing tells whether so large a residual is "
            "the sensor's or what the model lacks."
        )
    if few:
        sentences.append(
            f"What is left in {_listed(few)} changes so slowly that these logs hold fewer than {FEWEST} independent samples of "
            "it: nothing tells whether it is the sensor's or what the model lacks."
        )
    alone = [c for c in alone if c not in bursty and c not in few]
    if alone and pooled > FAR:
        sentences.append(
            f"The residual of {_listed(alone)} is not white, and too large for any colour of the sensor's noise: the model "
            "lacks something, or something disturbs it."
        )
    elif alone and pooled > POOR:
        sentences.append(
            f"The residual of {_listed(alone)} is not white and larger than the noise that the data shows: either the "
            "sensor's noise is coloured, and the estimates stand, or the model lacks something, and they do not. A log of "
            "the robot at rest would tell."
        )
    elif alone:
        sentences.append(
            f"The residual of {_listed(alone)} is not white: coloured noise, or dynamics that are missing."
        )
    far = pooled > FAR or (pooled > POOR and bool(follows))
    verdict: Verdict = "sound"
    if failures:
        verdict = "failed"
    elif far or follows or offsets or slow or bursty or few or untested or pulled:
        verdict = "poor"
    elif coloured or (pooled > POOR and not outlying):
        verdict = "coloured"
    better = LOST if failures and not lost else ""
    if not better and glitches and not odd:
        better = _FEW_ROWS
    elif verdict == "sound" and outlying:
        better = (
            f"A few samples of {_listed(outlying)} lie far from all others and make it that large: outliers, which squares "
            'give too much weight; output error with `loss="cauchy"` (`--loss cauchy`) gives them little.'
        )
    wandering = [c for c in coloured if by_channel[c] > ABOVE and _wandering(series[c])]
    if not better and wandering:
        # What follows the motion, is slow above white noise, or is uneven, is not the sensor's.
        doubtful = any(c not in follows and c not in slow and c not in bursty for c in wandering)
        better = _WANDERS_LIKE_A_SENSOR if doubtful else _WANDERS
    return Judgement(verdict, pooled, by_channel, not coloured, tuple(sentences), better, follows=follows)


def with_integration(
    logs: LogSet, noise: Mapping[str, float], own_error: Mapping[str, float] | None = None
) -> dict[str, float]:
    """The noise, not below what a simulation's own error may be.

    Of a speed that is a share of how far it varies. A position goes on and on, which says nothing of that error: where it is
    known (`own_error`), a few times as much is allowed for, and no more.
    """
    found, known = {}, own_error or {}
    for name in logs.channels.measured:
        y = np.concatenate([log.output(name) for log in logs])
        spread = float(np.nanstd(y)) if np.isfinite(y).any() else 0.0
        least = _INTEGRATION * spread
        if name in known:
            least = min(least, _OWN_ERRORS * known[name])
        found[name] = max(noise[name], least)
    return found


def _pooled(
    logs: LogSet, simulated: Sequence[Array], noise: Mapping[str, float], names: Sequence[str]
) -> tuple[float, float]:
    """Normalised RMS on the named logs, endless where the simulation is not finite: of all samples, and the channels' geometric
    mean, which is the likelihood's where each channel's noise is what its residual shows."""
    found: dict[str, list[Array]] = {}
    for log, y in zip(logs, simulated, strict=True):
        if log.name in names:
            y = np.clip(np.nan_to_num(np.asarray(y), nan=_ENDLESS), -_ENDLESS, _ENDLESS)
            for c, error in errors_of(log, y).items():
                found.setdefault(c, []).append(error / noise[c])
    each = [np.concatenate(own) for own in found.values()]
    levels = [np.log(max(rms(own), 1e-300)) for own in each]
    mean = np.average(levels, weights=[np.isfinite(own).sum() for own in each])
    return rms(np.concatenate(each)), float(np.exp(mean))


def judged(fit: Fit, judgement: Judgement, white: Mapping[str, float] | None = None) -> Fit:
    """The fit with its judgement, which comes first among its notes.

    `white`: standard errors as they would be if the residual were white, where they are others than the fit's.
    One that failed has not converged, whatever its optimiser says, and none of its parameters is identified.
    """
    if white is None and fit.standard_errors == "white":
        white = {name: estimate.std_error for name, estimate in fit.parameters.items()}
    contradicted = prior_conflicts(fit.robot.parameters, fit.parameters, white)
    if contradicted and judgement.verdict != "failed":
        judgement = replace(judgement.doubted(contradicted), better="")
    worth_a_note = judgement.verdict != "sound" or judgement.better
    notes = (judgement.sentence, *fit.notes) if worth_a_note else fit.notes
    if judgement.normalised_rms < NOTHING:
        notes = (*notes, _NO_NOISE)
    fit = replace(fit, judgement=judgement, notes=notes)
    if judgement.verdict != "failed":
        return fit
    unknown = float("nan")

    def doubted(estimate: Estimate) -> Estimate:
        status = "not_identifiable" if estimate.status == "identified" else estimate.status
        return Estimate.of(estimate.value, unknown, estimate.unit, status)

    return replace(
        fit,
        converged=False,
        reason="the fit failed, as its residual says",
        parameters={name: doubted(e) for name, e in fit.parameters.items()},
        combinations={name: doubted(e) for name, e in fit.combinations.items()},
        covariance=np.full_like(fit.covariance, unknown),
    )
