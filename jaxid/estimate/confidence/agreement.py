"""How well a simulation agrees with logs, those that were held out above all: normalised RMS, fit in percent, tests of the
residual.

The residual is simulated minus measured. What noise alone would leave behind is known from the data
(`jaxid.noise_level`), so the numbers have a floor: a normalised RMS of 1, and a residual that is white, unrelated to
the inputs and Gaussian (`residual_tests`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...logs import Log, LogSet
from ...logs.readings import counting
from ..residual_tests import ChannelTests, residual_tests

Array = NDArray[np.float64]

_DIVERGED = 1e3  # times the largest measured value: no prediction any more


@dataclass(frozen=True)
class LogAgreement:
    """One log: normalised RMS over its channels and fit in percent of each; NaN where the simulation `diverged`."""

    normalised_rms: float
    fit_percent: dict[str, float]
    diverged: bool = False


@dataclass(frozen=True)
class Agreement:
    """How one model predicts a set of logs. Numbers are pooled over the logs on which its simulation did not diverge.

    - `normalised_rms`: RMS of the residual in units of the noise's standard deviation, all channels: 1 is the floor.
    - `fit_percent`: 100 (1 - |y - yhat| / |y - mean y|) of each channel.
    - `rms`, `mean`, `std` of the residual of each channel, in its unit.
    - `tests` of each channel; `by_log`; `diverged`: names of the logs that were left out of the numbers.
    - `simulated`: [samples, channels.measured] of each log; `residuals`: by channel and log name, [samples], NaN where
      not measured.
    """

    normalised_rms: float
    fit_percent: dict[str, float]
    rms: dict[str, float]
    mean: dict[str, float]
    std: dict[str, float]
    tests: dict[str, ChannelTests]
    by_log: dict[str, LogAgreement]
    diverged: tuple[str, ...] = ()
    simulated: dict[str, Array] = field(default_factory=dict, repr=False)
    residuals: dict[str, dict[str, Array]] = field(default_factory=dict, repr=False)


def fit_percent(parts: Sequence[Array], measured: Sequence[Array]) -> float:
    """100 (1 - |y - yhat| / |y - mean y|) over all logs: residual `parts`, `measured` [samples]; NaN if y rests."""
    residual, y = np.concatenate(parts), np.concatenate(measured)
    there = np.isfinite(residual)
    variation = float(np.linalg.norm(y[there] - y[there].mean())) if there.any() else 0.0
    return 100.0 * (1.0 - float(np.linalg.norm(residual[there])) / variation) if variation > 0 else float("nan")


def counted_channels(log: Log) -> tuple[str, ...]:
    """Channels by which a log judges a model: its outputs, or what was measured in the place of one that was not."""
    measured, found = log.measured, list[str]()
    for name in log.channels.outputs:
        found += (name,) if name in measured else log.channels.stand_ins(name)
    return tuple(name for name in dict.fromkeys(found) if name in measured)


def errors_of(log: Log, simulated: Array) -> dict[str, Array]:
    """Simulated minus measured [T] of every channel by which the log judges a model, NaN where nothing was measured that
    counts (`readings`).

    `simulated` is [T, channels.measured].
    """
    found, counts = {}, counting(log)
    for name in counted_channels(log):
        column = log.channels.measured.index(name)
        error = np.asarray(simulated)[:, column] - log.output(name)
        found[name] = np.where(counts[:, column], error, np.nan)
    return found


def diverging(logs: LogSet, simulated: Sequence[Array], noise: Mapping[str, float]) -> tuple[str, ...]:
    """Names of the logs on which a simulated value is not finite, or a thousand times what was measured anywhere."""
    order, found = logs.channels.measured, []
    largest = {
        name: max(float(np.nanmax(np.abs(log.output(name)))) for log in logs if name in counted_channels(log))
        for name in {name for log in logs for name in counted_channels(log) if name in noise}
    }
    for log, outputs in zip(logs, simulated, strict=True):
        own = {n: np.abs(np.asarray(outputs)[:, order.index(n)]).max() for n in counted_channels(log) if n in noise}
        if not all(top <= _DIVERGED * max(largest[name], noise[name]) for name, top in own.items()):
            found.append(log.name)
    return tuple(found)


def rms(values: Array) -> float:
    """Root mean square of the values that are not NaN, infinite where a square is; NaN if there is none."""
    values = values[~np.isnan(values)]
    with np.errstate(over="ignore"):
        return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def agreement(logs: LogSet, simulated: Sequence[Array], noise: Mapping[str, float]) -> Agreement:
    """Judge `simulated` outputs ([samples, channels.measured] of each log) in units of the `noise` of each channel.

    A log on which a simulated value is not finite, or a thousand times what was measured anywhere, is named in
    `diverged` and left out of the pooled numbers, which are NaN if no log remains.
    """
    counted = {log.name: counted_channels(log) for log in logs}
    channels = tuple(name for name in logs.channels.measured if any(name in names for names in counted.values()))
    diverged = diverging(logs, simulated, noise)
    by_log: dict[str, LogAgreement] = {}
    residuals: dict[str, dict[str, Array]] = {name: {} for name in channels}
    for log, outputs in zip(logs, simulated, strict=True):
        if log.name in diverged:
            nothing = dict.fromkeys(counted[log.name], float("nan"))
            by_log[log.name] = LogAgreement(float("nan"), nothing, True)
            continue
        error = errors_of(log, outputs)
        scaled = np.concatenate([e / noise[name] for name, e in error.items()])
        fits = {name: fit_percent([e], [log.output(name)]) for name, e in error.items()}
        by_log[log.name] = LogAgreement(rms(scaled), fits)
        for name, e in error.items():
            residuals[name][log.name] = e
    kept = {name: {n: np.asarray(e[np.isfinite(e)]) for n, e in own.items()} for name, own in residuals.items()}
    pooled = {name: np.concatenate([*own.values(), np.empty(0)]) for name, own in kept.items()}
    usable = [name for name in channels if pooled[name].size]
    nan = float("nan")
    return Agreement(
        normalised_rms=rms(np.concatenate([pooled[name] / noise[name] for name in channels])),
        fit_percent={
            name: fit_percent(list(residuals[name].values()), [logs[n].output(name) for n in residuals[name]])
            if name in usable
            else nan
            for name in channels
        },
        rms={name: rms(pooled[name]) for name in channels},
        mean={name: float(pooled[name].mean()) if name in usable else nan for name in channels},
        std={name: float(pooled[name].std()) if name in usable else nan for name in channels},
        tests={
            name: residual_tests(
                list(residuals[name].values()),
                {u: [logs[n].input(u) for n in residuals[name]] for u in logs.channels.inputs},
                name,
            )
            for name in usable
        },
        by_log=by_log,
        diverged=diverged,
        simulated={log.name: np.asarray(y) for log, y in zip(logs, simulated, strict=True)},
        residuals=residuals,
    )
