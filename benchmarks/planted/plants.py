"""What software can plant exactly in a recording that is there already.

Behind the robot a measurement may come late, through a filter, scaled, off by a constant or by one that drifts. Before it the
recorded input is replaced by the one from which the planted effect would have made the recorded input. Every function takes a
log and returns one; the truth by name of the mechanism stands beside it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from jaxid import Log

Array = NDArray[np.float64]
Plant = Callable[[Log], Log]


@dataclass(frozen=True)
class Planted:
    """One effect in one set: how it is planted, the `mechanisms` that are right answers (alone, or declared together; none
    where nothing new is to be said), whether an answer of nothing is right as well, since the robot's own parameters may take
    it up, and the true size of parameters by mechanism and parameter."""

    name: str
    plant: Plant
    mechanisms: tuple[str, ...] = ()
    may_be_absorbed: bool = False
    sizes: Mapping[tuple[str, str], float] = field(default_factory=dict)


def _without(log: Log, first: int, last: int) -> Log:
    """The log without its `first` and `last` rows."""
    whole = len(log)
    return log.window(log.time[first], log.time[whole - last - 1] + 0.5 * log.sampling_interval)


def late(samples: int) -> Plant:
    """All measurements `samples` rows late."""

    def plant(log: Log) -> Log:
        outputs = np.full_like(log.outputs, np.nan)
        outputs[samples:] = log.outputs[:-samples]
        outputs[:samples] = log.outputs[0]
        return _without(replace(log, outputs=outputs), samples, 0)

    return plant


def one_late(channel: str, samples: int) -> Plant:
    """One channel `samples` rows late."""

    def plant(log: Log) -> Log:
        outputs, j = np.array(log.outputs), log.channels.measured.index(channel)
        outputs[samples:, j] = log.outputs[:-samples, j]
        return _without(replace(log, outputs=outputs), samples, 0)

    return plant


def filtered(seconds: float) -> Plant:
    """Every measurement through a first-order filter that takes the straight line between two samples for the signal."""

    def plant(log: Log) -> Log:
        found = np.array(log.outputs)
        for k, h in enumerate(np.diff(log.time)):
            keep = np.exp(-h / seconds)
            slope = (log.outputs[k + 1] - log.outputs[k]) / h
            found[k + 1] = log.outputs[k + 1] - slope * seconds + (found[k] - log.outputs[k] + slope * seconds) * keep
        return replace(log, outputs=found)

    return plant


def scaled(channel: str, factor: float) -> Plant:
    """One measurement larger by a factor."""

    def plant(log: Log) -> Log:
        outputs = np.array(log.outputs)
        outputs[:, log.channels.measured.index(channel)] *= factor
        return replace(log, outputs=outputs)

    return plant


def biased(channel: str, offset: float, rate: float = 0.0) -> Plant:
    """One measurement off by `offset`, and by `rate` more every second from the log's beginning."""

    def plant(log: Log) -> Log:
        outputs = np.array(log.outputs)
        outputs[:, log.channels.measured.index(channel)] += offset + rate * (log.time - log.time[0])
        return replace(log, outputs=outputs)

    return plant


def quantised(step: float) -> Plant:
    """Every measurement in whole steps."""
    return lambda log: replace(log, outputs=np.round(log.outputs / step) * step)


def with_rows_lost(share: float, seed: int) -> Plant:
    """A share of the rows, but the first and the last, lost at random; those in which an input changed stay."""

    def plant(log: Log) -> Log:
        random = np.random.default_rng(seed)
        stays = random.uniform(size=len(log)) >= share
        stays[1:] |= np.any(np.diff(log.inputs, axis=0) != 0, axis=1)
        stays[[0, -1]] = True
        return Log(log.name, log.time[stays], log.inputs[stays], log.outputs[stays], log.channels)

    return plant


def behind_a_dead_zone(width: float, places: tuple[int, ...] | None = None) -> Plant:
    """Commands of which a driver that swallows `width` would have made the recorded inputs."""

    def plant(log: Log) -> Log:
        inputs, chosen = np.array(log.inputs), list(places or range(log.inputs.shape[1]))
        inputs[:, chosen] += width * np.sign(inputs[:, chosen])
        return replace(log, inputs=inputs)

    return plant


def behind_a_limit(limit: float, most: float, seed: int) -> Plant:
    """Commands beyond a `limit` at which the recorded inputs, of two levels, are cut off: each chip another, up to `most`
    times the limit."""

    def plant(log: Log) -> Log:
        random, inputs = np.random.default_rng(seed), np.array(log.inputs)
        begins = np.flatnonzero(np.any(np.diff(inputs, axis=0) != 0, axis=1)) + 1
        for a, b in zip([0, *begins], [*begins, len(inputs)], strict=True):
            full = np.abs(inputs[a:b]) > 0.999 * limit
            inputs[a:b] = np.where(full, inputs[a:b] * random.uniform(1.0, most), inputs[a:b])
        return replace(log, inputs=inputs)

    return plant


def behind_a_gain(place: int, factor: float) -> Plant:
    """Commands of one input which a driver stronger by `factor` made the recorded ones of."""

    def plant(log: Log) -> Log:
        inputs = np.array(log.inputs)
        inputs[:, place] /= factor
        return replace(log, inputs=inputs)

    return plant
