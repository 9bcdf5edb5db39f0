"""Comparing fits: each simulates the same held-out logs, whose noise is the yardstick of all."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from .._float64 import in_float64
from .._origin import with_origin
from .._renamed import renamed
from ..estimate.confidence.agreement import Agreement, agreement
from ..estimate.confidence.prediction_spread import prediction_sentence
from ..estimate.output_error.estimated_start import estimated_start
from ..estimate.output_error.windows import followed
from ..estimate.prediction_error.predict import predict
from ..estimate.result import Fit, checked_fit
from ..estimate.slow_sensors import no_larger_than_left
from ..logs import Log, LogError, LogSet, noise_scale
from ..logs.unusable import without_unusable
from ..simulation.simulate import simulate
from ..simulation.start import initial_states
from . import tables as tab
from .comparison import Comparison

HORIZONS = (1, 10)
"""Samples ahead that a model with process noise predicts, beside its free simulation."""
_PUBLISHED = ("Table", "section")
_LESS = 0.9
"""Share of the held-out error that a model must come below without readings that tell nothing of the motion."""
_SAME_ROBOT = 1.2
"""Ratio of a known constant and the published one beyond which the robot is another one."""


def _labels(fits: Sequence[Fit]) -> tuple[str, ...]:
    """A label for each fit: its method, numbered where several used the same."""
    methods = [fit.method for fit in fits]
    seen: dict[str, int] = {}
    labels = []
    for method in methods:
        seen[method] = seen.get(method, 0) + 1
        labels.append(f"{method} {seen[method]}" if methods.count(method) > 1 else method)
    return tuple(labels)


def _fitted_start(fit: Fit, logs: LogSet) -> dict[str, np.ndarray] | None:
    """The initial states that the fit estimated for these logs, where it did so for all of them."""
    if not all(set(fit.robot.states) <= set(fit.initial_states.get(log.name, {})) for log in logs):
        return None
    return {name: np.array([fit.initial_states[log.name][name] for log in logs]) for name in fit.robot.states}


def _on_the_outputs_clock(fit: Fit, logs: LogSet, outputs: list[np.ndarray], fitted: bool) -> list[np.ndarray]:
    """Simulated outputs [T, channels] as the outputs' clock shows them, where the fit found that of the inputs ahead of it:
    each `fitted` log by its own offset, others by the mean."""
    if not fit.clock_offsets:
        return outputs
    found = []
    for log, y in zip(logs, outputs, strict=True):
        offset = fit.clock_offsets[log.name].value if fitted and log.name in fit.clock_offsets else _mean_offset(fit)
        found.append(np.stack([np.interp(log.time + offset, log.time, column) for column in y.T], axis=1))
    return found


def _on_the_inputs_clock(fit: Fit, logs: LogSet) -> LogSet:
    """Logs whose outputs stand at the times that the inputs' clock shows, to look for the states in which they begin."""
    if not fit.clock_offsets:
        return logs
    moved = []
    for log in logs:
        at, outputs = log.time - _mean_offset(fit), np.full(log.outputs.shape, np.nan)
        for k, column in enumerate(log.outputs.T):
            there = np.isfinite(column)
            if there.any():
                outputs[:, k] = np.interp(at, log.time[there], column[there], left=np.nan, right=np.nan)
        moved.append(replace(log, outputs=outputs))
    return LogSet(moved)


def _mean_offset(fit: Fit) -> float:
    """The mean clock offset [s] of the fitted logs."""
    return float(np.mean([offset.value for offset in fit.clock_offsets.values()]))


def on_fitted(fits: Mapping[str, Fit], logs: LogSet, noise: Mapping[str, float]) -> dict[str, list[np.ndarray]]:
    """What every fit simulates of the logs that were fitted, outputs [samples, channels.measured] of each: in windows, where a
    fit needed them, else from the initial states that it estimated."""
    windows = [fit.window for fit in fits.values() if fit.window is not None]
    if windows:
        return {label: followed(f.robot, logs, min(windows), noise) for label, f in fits.items()}
    seen = {label: simulate(f.robot, logs, start=_fitted_start(f, logs)) for label, f in fits.items()}
    return {label: _on_the_outputs_clock(fits[label], logs, outputs, True) for label, outputs in seen.items()}


def _published(fits: Sequence[Fit]) -> dict[str, float]:
    """Defaults of the robots' tables that come from a publication; none if the owner knows that it is not of this robot."""
    found: dict[str, float] = {}
    for fit in reversed(fits):
        own = {n: p.value for n, p in fit.robot.defaults().items() if p.source.startswith(_PUBLISHED)}
        known = [(fit.robot.parameters[n].value, v) for n, v in own.items() if n not in fit.free_names]
        if all(1.0 / _SAME_ROBOT <= a / b <= _SAME_ROBOT for a, b in known if a and b):
            found |= own
    return found


def _same_data(one: Log, other: Log) -> bool:
    return one.outputs.shape == other.outputs.shape and np.array_equal(one.outputs, other.outputs, equal_nan=True)


def _notes(fits: Mapping[str, Fit], held_out: LogSet, fit: LogSet | None) -> tuple[str, ...]:
    notes = []
    for label, found in fits.items():
        if not (found.converged or found.failed):
            notes.append(f"{tab.title_of(label)}: {found.reason}.")
        notes += [f"{tab.title_of(label)}: {note}" for note in found.notes]
        if found.clock_offsets:
            notes.append(
                f"{tab.title_of(label)} simulates held-out logs with the inputs' clock {1e3 * _mean_offset(found):.3g} ms "
                "ahead of the outputs', as in the fitted ones on average."
            )
    robot = next(iter(fits.values())).robot
    windows = [found.window for found in fits.values() if found.window is not None]
    if windows:
        notes.append(
            f"Every model predicts in windows of {min(windows):.3g} s, each from the initial state that suits it best: a "
            "free simulation of these logs says nothing."
        )
    for log, moving in zip(held_out, initial_states(robot, held_out).uncertain, strict=True):
        if moving and not windows:
            notes.append(f"{log.name} starts in motion: every model starts from the initial state that suits it best.")
    known = [own for found in fits.values() if found.origin is not None for own in found.origin.logs.get("logs", ())]
    for log in held_out:
        used = [other.name for other in fit or () if _same_data(log, other)]
        used += [own.name for own in known if own.sha256 == log.sha256]
        if used:
            notes.append(f"{log.name} was also fitted (as {used[0]}): it says nothing about unseen motion.")
    return tuple(notes)


def _usable(fits: Mapping[str, Fit], held_out: LogSet) -> tuple[LogSet, str]:
    """The held-out logs without readings that tell nothing of the motion, and a sentence on that, where those make much of
    what the best model leaves; else as they are."""
    (usable,), said = without_unusable(held_out)
    if not said:
        return held_out, ""
    with_them, without = (
        min(_free(fit, logs, noise_scale(logs)).normalised_rms for fit in fits.values()) for logs in (held_out, usable)
    )
    if not without < _LESS * with_them:
        return held_out, ""
    return usable, (
        f"Left out of the held-out logs, since they tell nothing of the motion: {'; '.join(said)}. With them the best model "
        f"leaves {with_them:.3g} times the noise."
    )


def _free(fit: Fit, logs: LogSet, noise: Mapping[str, float]) -> Agreement:
    """How a free simulation agrees with logs, those that begin in motion from the initial state that suits it best."""
    return agreement(logs, simulate(fit.robot, logs, start=estimated_start(fit.robot, logs, noise)), noise)


def _set(logs: Sequence[Log]) -> LogSet:
    return logs if isinstance(logs, LogSet) else LogSet(logs)


@renamed(check="held_out")
@with_origin
@in_float64
def compare(
    *fits: Fit, held_out: LogSet | Log, fit: LogSet | None = None, truth: Mapping[str, float] | None = None
) -> Comparison:
    """Compare estimates on logs that none of them has seen.

    **Arguments:**

    - `fits`: what the estimators returned, of one robot or of variants with the same channels.
    - `held_out`: logs that were not fitted. Every model simulates them from known initial states (at rest, or as the log
      says; those of a log that starts in motion are estimated), with nothing measured fed back; the noise that residuals
      are measured in comes from these logs alone. Models with process noise predict them some samples ahead, too.
    - `fit`: the logs that were fitted, to show both sides.
    - `truth`: true values by symbol, where they are known; else published values stand beside the estimates.

    Raises `ValueError` without a fit and `LogError` if the logs' channels are not the robot's.
    """
    if not fits:
        raise ValueError("There is nothing to compare; give at least one fit, as in compare(fit, held_out=logs).")
    for other in fits:
        checked_fit(other)
    held_out = LogSet([held_out]) if isinstance(held_out, Log) else _set(held_out)
    fit = None if fit is None else _set(fit)
    named = dict(zip(_labels(fits), fits, strict=True))
    for label, found in named.items():
        for logs in (held_out, fit):
            if logs is not None and logs.channels != found.robot.channels:
                raise LogError(
                    f"{logs[0].name} has the channels {list(logs.channels)} and the robot of {label} has "
                    f"{list(found.robot.channels)}; compare with logs of that robot."
                )
    windows = [f.window for f in fits if f.window is not None]
    held_out, left_out = (held_out, "") if windows else _usable(named, held_out)
    noise = noise_scale(held_out)
    predicted, fitted, said = {}, {}, [left_out] * bool(left_out)
    starts = (
        {}
        if windows
        else {label: estimated_start(f.robot, _on_the_inputs_clock(f, held_out), noise) for label, f in named.items()}
    )
    if windows:
        simulated = {label: followed(f.robot, held_out, min(windows), noise) for label, f in named.items()}
    else:
        simulated = {label: simulate(named[label].robot, held_out, start=start) for label, start in starts.items()}
        simulated = {label: _on_the_outputs_clock(named[label], held_out, y, False) for label, y in simulated.items()}
    for outputs in simulated.values():
        noise = no_larger_than_left(held_out, outputs, noise)
    if fit is not None:
        level = noise_scale(fit)
        again = on_fitted(named, fit, level)
        for outputs in again.values():
            level = no_larger_than_left(fit, outputs, level)
        fitted = {label: agreement(fit, seen, level) for label, seen in again.items()}
    for label, f in named.items():
        predicted[label] = agreement(held_out, simulated[label], noise)
        if windows:
            continue
        start = starts[label]
        far = [np.concatenate([*own.values()]) / noise[c] for c, own in predicted[label].residuals.items() if own]
        seen = fitted[label].normalised_rms if label in fitted else 0.0
        sentence = prediction_sentence(f, predicted[label].normalised_rms, held_out, noise, fit, start, far, seen)
        said += [f"{tab.title_of(label)}: {sentence}"] if sentence else []
    ahead = {
        label: {k: agreement(held_out, predict(f, held_out, k), noise) for k in HORIZONS}
        for label, f in named.items()
        if f.disturbance is not None
    }
    references = {name: float(value) for name, value in truth.items()} if truth is not None else _published(fits)
    for found in reversed(fits) if references else ():
        fixed = {n: v for n, v in found.robot.parameters.numbers.items() if n not in found.free_names}
        numbers = {**found.robot.defaults().numbers, **(fixed if truth is not None else {}), **references}
        for name, (function, _, _) in found.robot.combinations.items():
            references.setdefault(name, float(function(numbers)))
    kind = "true" if truth is not None else "published"
    return Comparison(
        named, held_out, noise, predicted, fitted, kind, references, (*said, *_notes(named, held_out, fit)), ahead
    )
