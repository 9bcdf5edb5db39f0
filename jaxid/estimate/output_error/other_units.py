"""A fit that failed since a column is in another unit than the robot's: degrees for radians, revolutions a minute, km/h.

Numbers alone do not show it where the robot turns little. The model does: with that column in its right unit it follows the
logs, and with no other.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from ...logs import LogError, LogSet
from ...parameters import ParameterError
from ..result import Fit

_USUAL: Mapping[str, tuple[tuple[str, float], ...]] = MappingProxyType(
    {
        "rad": (("degrees", np.pi / 180.0),),
        "rad/s": (("degrees a second", np.pi / 180.0), ("revolutions a minute", np.pi / 30.0)),
        "m": (("millimetres", 1e-3), ("centimetres", 1e-2)),
        "m/s": (("km/h", 1.0 / 3.6), ("mm/s", 1e-3), ("cm/s", 1e-2)),
    }
)
"""What columns are in beside SI units, and the scales that make SI units of them."""
_LESS = 3.0
"""Times less that the model leaves of the noise once a column is in its unit."""


def _scaled(logs: LogSet, name: str, scale: float) -> LogSet:
    """The logs with a column, of inputs or of outputs, times so much."""
    found = []
    for log in logs:
        if name in log.channels.inputs:
            factors = np.array([scale if own == name else 1.0 for own in log.channels.inputs])
            found.append(replace(log, inputs=log.inputs * factors))
        else:
            factors = np.array([scale if own == name else 1.0 for own in log.channels.measured])
            found.append(replace(log, outputs=log.outputs * factors))
    return LogSet(found)


def _columns(logs: LogSet) -> Iterator[tuple[str, str, float]]:
    """Columns that all logs have, with what they may be in and the scale that it takes."""
    channels = logs[0].channels
    there = [name for name in channels.measured if all(name in log.measured for log in logs)]
    for name in (*there, *channels.inputs):
        for words, scale in _USUAL.get(channels.units.get(name, ""), ()):
            yield name, words, scale


def in_other_units(fit: Fit, logs: LogSet, again: Callable[[LogSet], Fit]) -> str:
    """A sentence on a column with which, taken for another unit, a model that failed follows its logs; empty where there is
    none. `again` is the same fit to other logs. Call under float64."""
    judgement = fit.judgement
    if judgement is None or judgement.verdict != "failed":
        return ""
    best, least = "", judgement.normalised_rms / _LESS
    for name, words, scale in _columns(logs):
        try:
            other = again(_scaled(logs, name, scale)).judgement
        except (ParameterError, LogError):
            continue
        if other is not None and other.verdict != "failed" and other.normalised_rms < least:
            least = other.normalised_rms
            best = (
                f"Taken for {words}, {name} fits: the model then leaves {least:.3g} times the noise, and "
                f"{judgement.normalised_rms:.3g} times as it is. Map that column with the scale {scale:.6g}."
            )
    return best
