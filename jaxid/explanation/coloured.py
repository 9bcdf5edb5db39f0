"""Noise that is not white: whether what a model leaves over is coloured noise and nothing else.

Neighbouring errors of many sensors are related: filtered speeds, differences of positions smoothed over some samples. The
residual of a complete model is then larger than the noise that differences of samples show, and not white, though nothing
is missing. Here it is whitened by an autoregression of each channel (`noise_colour`), so that the gains of candidates count
in independent samples, and held against what drove the robot.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._distributions import chi_squared_tail, normal_beyond
from ..estimate.judge import FAR, drivers
from ..estimate.noise_colour import Colour, colour_of
from ..estimate.residual_tests import cross_correlation, ljung_box, related_squares, relation
from ..logs import LogSet
from ..logs.noise import usual_size, white_level
from .heldout import FALSE_ALARM, HeldOut

Array = NDArray[np.float64]

_SIMPLE = 2
"""Order up to which an autoregression that leaves nothing is a sensor's filter."""
_LAGS = 20
_FOLLOWS = 0.002
"""How often noise is taken to follow what drove the robot, all channels and tests together."""
_SLACK = 0.05
"""Ratio (its logarithm) of two levels of one noise that a wrong autoregression may explain."""
_SHORTEST, _BLOCK_LAGS = 8, 3
"""Samples of the shortest means that tell slow from fast, and the lags over which these are held to be white."""
_BRIEF = 0.1
"""p value above which they are: where there is doubt, it is said."""
_FASTER = 0.5
"""Memory of the noise in time constants of the robot up to which no force makes it: inertia would have smoothed that."""


@dataclass(frozen=True)
class OnlyColour:
    """Nothing but coloured noise is left: the `colours` of the channels that are not white.

    `faster` where it changes faster than the robot's inertia would let any force make it; `simple` where it does, or where
    short autoregressions leave nothing of it, as a sensor's filter makes it.
    """

    colours: dict[str, Colour]
    simple: bool
    faster: bool

    @property
    def phrase(self) -> str:
        """Which channels are coloured, and how."""
        each = []
        for name, colour in self.colours.items():
            kind = f"AR(1), {colour.correlation:.2f}" if colour.order == 1 else f"neighbours {colour.correlation:.2f}"
            each.append(f"{name} ({kind})")
        return ", ".join(each[:-1]) + " and " * (len(each) > 1) + each[-1]

    def to_dict(self) -> dict[str, Any]:
        """For explanation.json."""
        channels = {
            name: {"correlation": colour.correlation, "order": colour.order} for name, colour in self.colours.items()
        }
        return {"channels": channels, "simple": self.simple, "faster_than_any_force": self.faster}


def unrelated(states: Sequence[tuple[HeldOut, LogSet]], of: Sequence[str], false_alarm: float) -> bool:
    """Whether the residuals of the channels `of` follow nothing that drove the robot, on all `states` and their logs together.

    Two tests of each channel, `false_alarm` for all of them: regression on drivers against the same shifted in time
    (`relation`), and of the whitened residual on the inputs of the last samples (`cross_correlation`).
    """
    parts: dict[str, list[Array]] = {name: [] for name in of}
    driving: dict[str, dict[str, list[Array]]] = {name: {} for name in of}
    for state, logs in states:
        names = list(state.by_channel)
        simulated = []
        for log, residual in zip(logs, state.residuals, strict=True):
            every = np.full((len(log), len(logs.channels.measured)), np.nan)
            for i, name in enumerate(names):
                every[:, logs.channels.measured.index(name)] = log.output(name) + residual[:, i] * state.noise[name]
            simulated.append(every)
        for name in of:
            kept = [k for k, r in enumerate(state.residuals) if np.isfinite(r[:, names.index(name)]).any()]
            if not kept:
                continue
            parts[name] += [state.residuals[k][:, names.index(name)] for k in kept]
            for key, values in drivers(LogSet([logs[k] for k in kept]), [simulated[k] for k in kept]).items():
                driving[name].setdefault(key, []).extend(values)
    least = false_alarm / (2 * len(parts))
    for name, own in parts.items():
        same = {key: values for key, values in driving[name].items() if len(values) == len(own)}
        if not own or not same or relation(own, same)[0] < least:
            return False
        inputs = [key for key in same if key in states[0][1].channels.inputs]
        tests = [cross_correlation(own, same[key])[0].p_value for key in inputs]
        if np.nanmin([*tests, 1.0]) * max(len(inputs), 1) < least:
            return False
    return True


def _portmanteau(parts: Sequence[Array], fitted: int) -> float:
    """p value of `parts` being white, `fitted` coefficients of an autoregression taken off."""
    statistic, freedom = ljung_box(parts, _LAGS, mean=0.0)
    return float(chi_squared_tail(statistic, max(freedom - fitted, 1)))


def _brief(parts: Sequence[Array], samples: int) -> bool:
    """Whether noise has nothing left that lasts for `samples`: means over as many, every other one, are white."""
    means = []
    for own in parts:
        blocks = (
            (own[: len(own) // samples * samples] if samples else own[:0]).reshape(-1, max(samples, 1)).mean(axis=1)
        )
        means.append(blocks[::2] / max(usual_size(own), 1e-300))
    if samples < _SHORTEST or sum(map(len, means)) < 4 * _BLOCK_LAGS:
        return False
    statistic, freedom = ljung_box(means, _BLOCK_LAGS, mean=0.0)
    return float(chi_squared_tail(statistic, freedom)) > _BRIEF


def _even(colour: Colour, parts: Sequence[Array], white: Sequence[Array]) -> bool:
    """Whether every log has as much of the noise as its own differences say, and no stretch of it has more than others.

    Errors of a model come where the motion makes them: on one log, or in stretches. A sensor may be noisier on one log; its
    differences are, too. Of noise with the autocorrelations rho, a variance of n samples has 1 + 2 sum rho^2 times the
    uncertainty of independent ones, that from third differences 2.31 times (see `heldout.py`).
    """
    rho = colour.correlations
    inflated = 1.0 + 2.0 * float(np.sum(rho[1:] ** 2))
    third = float(np.sqrt((20.0 - 30.0 * rho[1] + 12.0 * rho[2] - 2.0 * rho[3]) / 20.0))
    # The residuals' third differences, as the noise of the data is estimated; usual sizes, so that outliers do not count.
    sizes = [usual_size(own) / max(white_level(own), 1e-300) * third for own in parts]
    errors = [np.sqrt((inflated + 2.31) / (2.0 * len(own))) for own in parts]
    limit = float(normal_beyond(0.5 * _FOLLOWS / len(parts)))
    if any(abs(np.log(size)) > limit * error + _SLACK for size, error in zip(sizes, errors, strict=True)):
        return False
    return related_squares(white) > _FOLLOWS


def only_colour(states: Sequence[tuple[HeldOut, LogSet]], memory: float) -> OnlyColour | None:
    """What is left on `states` (residuals with the logs they are of) if it is coloured noise by all that its shape and its
    relation to what drove the robot tell; else None. Whether a candidate explains it is for the screening to say.

    `memory` is the robot's time constant in samples.
    """
    first, _ = states[0]
    if any(state.diverged for state, _ in states) or not np.isfinite(first.normalised_rms):
        return None
    colours = colours_of([state for state, _ in states])
    coloured = {name: colour for name, colour in colours.items() if colour.order}
    if not coloured or max(first.by_channel.values()) > FAR:
        return None
    # The fitted logs have taken in some of what is missing; the held-out ones, which come first, have not.
    if not all(unrelated(own, list(coloured), _FOLLOWS / 2) for own in (states[:1], states)):
        return None
    simple, faster = True, True
    for name, colour in coloured.items():
        parts = [own[np.isfinite(own)] for own in parts_of([state for state, _ in states], name)]
        parts = [own for own in parts if len(own) > 2 * _LAGS]
        white = [colour.whiten(own, np.ones(len(own), bool)) for own in parts]
        if not white or not _even(colour, parts, white):
            return None
        # One level for all logs, of which one may be noisier than the others.
        white = [own / max(usual_size(own), 1e-300) for own in white]
        short = colour.order <= _SIMPLE and _portmanteau(white, colour.order) > FALSE_ALARM
        fast = colour.memory < _FASTER * memory
        brief = fast and _brief(parts, round(_FASTER * memory))
        simple &= (short or brief) and not colour.on_white
        faster &= fast and not colour.on_white
    return OnlyColour(coloured, simple, faster)


def parts_of(states: Sequence[HeldOut], name: str) -> list[Array]:
    """The residuals [T] of a channel on every log of `states`, NaN where not measured."""
    found = []
    for state in states:
        if name in state.by_channel:
            column = list(state.by_channel).index(name)
            found += [r[:, column] for r in state.residuals if np.isfinite(r[:, column]).any()]
    return found


def colours_of(states: Sequence[HeldOut]) -> dict[str, Colour]:
    """The colour of every channel, from all residuals."""
    names = dict.fromkeys(name for state in states for name in state.by_channel)
    return {name: colour_of(parts_of(states, name)) for name in names}


def whitened(state: HeldOut, colours: Mapping[str, Colour]) -> HeldOut:
    """The state with its residuals whitened, so that their squares count in independent samples."""
    found = []
    for residual in state.residuals:
        there = np.isfinite(residual)
        columns = [
            colours[name].whiten(np.nan_to_num(residual[:, i]), there[:, i]) for i, name in enumerate(state.by_channel)
        ]
        found.append(np.where(there, np.stack(columns, axis=1), np.nan))
    return replace(state, residuals=tuple(found))
