"""Noise that is not white: whether what a model leaves over is coloured noise and nothing else.

Neighbouring errors of many sensors are related: filtered speeds, differences of positions smoothed over some samples. The
residual of a complete model is then larger than the noise that differences of samples show, and not white, though nothing
is missing. Here it is whitened by an autoregression of each channel (`noise_colour`), so that the gains of candidates count
in independent samples, and held against what drove the robot.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ...estimate.judge import FAR, drivers, step_of
from ...estimate.jumps import without_jumps
from ...estimate.noise_colour import Colour, colour_of, innovations_related
from ...estimate.residual_tests import cross_correlation, relation
from ...logs import LogSet
from ...logs.noise import usual_size
from . import sensor_shape as shape_of
from .heldout import HeldOut
from .noisy_inputs import InputNoise

Array = NDArray[np.float64]

_FEWEST = 40
"""Samples of a log below which its noise has no shape."""
_ROUNDED = 0.5
"""Share of what is left, its variance, above which rounding makes the shape of it."""
GATES = 5
"""Tests among which the level is shared: what drove the robot, evenness among logs, bursts, shape, and the candidates."""


@dataclass(frozen=True)
class OnlyColour:
    """Nothing but coloured noise is left: the `colours` of the channels that are not white.

    `p_value` of all tests together, those of the shape, on which `simple` hangs, included. `faster` where it changes faster
    than the robot's inertia would let any force make it; `simple` where it is forgotten soon, or where short autoregressions
    leave nothing of it, as a sensor's filter makes it; `at_rest`: whether it is there while the robot stands (`at_rest.py`),
    None where the logs do not tell. `of_inputs`: the noise of the inputs that makes all of it, where that is what it is.
    `fed_back`: it follows the motion, as noise does that a controller makes commands of, and so do its innovations.
    """

    colours: dict[str, Colour]
    simple: bool
    faster: bool
    p_value: float = 1.0
    at_rest: bool | None = None
    of_inputs: InputNoise | None = None
    fed_back: bool = False

    @property
    def only_noise(self) -> bool:
        """Whether nothing is missing for it: noise of the sensors, or of the inputs."""
        return self.of_sensors or self.of_inputs is not None

    @property
    def of_sensors(self) -> bool:
        """Whether it is the sensors' noise: by its shape, or since it is there while the robot stands."""
        return self.simple or self.at_rest is True

    @property
    def phrase(self) -> str:
        """Which channels are coloured, and how."""
        each = []
        for name, colour in self.colours.items():
            near = f"{colour.correlation:.2f}"
            kind = f"AR(1), {near}" if colour.order == 1 else f"AR({colour.order}), neighbours {near}"
            each.append(f"{name} ({kind})")
        return ", ".join(each[:-1]) + " and " * (len(each) > 1) + each[-1] if each else "no channel"

    def to_dict(self) -> dict[str, Any]:
        """For explanation.json."""
        channels = {
            name: {"correlation": colour.correlation, "order": colour.order} for name, colour in self.colours.items()
        }
        own = {"channels": channels, "simple": self.simple, "faster_than_any_force": self.faster}
        own |= {} if self.at_rest is None else {"while_the_robot_stands": self.at_rest}
        own |= {"fed_back": True} if self.fed_back else {}
        return own if self.of_inputs is None else {**own, "noise_of_inputs": self.of_inputs.to_dict()}


def related(states: Sequence[tuple[HeldOut, LogSet]], of: Sequence[str], *, fed_back: bool = False) -> float:
    """p value of the residuals of the channels `of` following nothing that drove the robot, on all `states` and their logs.

    Two tests of each channel: regression on drivers against the same shifted in time (`relation`; of what is `fed_back`, its
    innovations), and of the whitened residual on the inputs of the last samples (`cross_correlation`).
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
    p_values = [1.0]
    for name, own in parts.items():
        same = {key: values for key, values in driving[name].items() if len(values) == len(own)}
        if not own or not same:
            return 0.0
        inputs = [key for key in same if key in states[0][1].channels.inputs]
        tests = [cross_correlation(own, same[key])[0].p_value for key in inputs]
        test = innovations_related if fed_back else relation
        p_values += [test(own, same).p_value, float(np.nanmin([*tests, 1.0])) * max(len(inputs), 1)]
    return min(2.0 * len(parts) * min(p_values), 1.0)


class _Tested(NamedTuple):
    """What the shape of logs with one colour of noise says: p values of its being noise at all, forgotten briefly, and made by
    a short filter, and whether it is faster than any force."""

    noise: float
    briefly: float
    simply: float
    faster: bool

    @classmethod
    def of(cls, colour: Colour, parts: Sequence[Array], memory: float, rounding: float, fed_back: bool) -> Self:
        """The tests of `parts` [T], one of each log. What is `fed_back` is followed in windows, and less so at their ends."""
        white = [colour.whiten(own, np.ones(len(own), bool)) for own in parts]
        steady = 1.0 if fed_back or shape_of.of_counts(colour, memory) else shape_of.steady(parts)
        return cls(
            min(shape_of.even(colour, parts), steady),
            shape_of.briefly(colour, parts, memory, rounding),
            shape_of.filtered_simply(colour, white, rounding),
            shape_of.fast(colour, memory) and not shape_of.beside_white(colour, rounding),
        )


def only_colour(
    states: Sequence[tuple[HeldOut, LogSet]], memory: float, *, fed_back: bool = False
) -> OnlyColour | None:
    """What is left on `states` (residuals with the logs they are of) if it is coloured noise by all that its shape and its
    relation to what drove the robot tell, at the level of the first state; else None. Whether a candidate explains it is for
    the screening to say.

    `memory` is the robot's time constant in samples. Noise that is `fed_back` may follow the motion, where its innovations do
    not; where these do, too, it is asked whether it changes faster than any force would make it.
    """
    first, _ = states[0]
    if any(state.diverged for state, _ in states) or not np.isfinite(first.normalised_rms):
        return None
    colours = colours_of([state for state, _ in states])
    coloured = {
        name: colour for name, colour in colours.items() if colour.order and not mostly_rounding(states, name, colour)
    }
    if not coloured:
        return None
    level, count = first.false_alarm / GATES, len(coloured)
    # The fitted logs have taken in some of what is missing; the held-out ones, which come first, have not.
    noise = 1.0
    for own in (states[:1], states):
        noise = min(noise, 2.0 * related(own, list(coloured), fed_back=fed_back))
        if noise < level:
            break
    follows = fed_back and noise < level
    if noise < level and not fed_back:
        return None
    noise = 1.0 if follows else noise
    shape, simple, faster = 1.0, True, True
    for name, colour in coloured.items():
        parts = [without_jumps(own[np.isfinite(own)]) for own in parts_of([state for state, _ in states], name)]
        parts = [own for own in parts if len(own) > _FEWEST]
        if not parts:
            return None
        rounding = _rounding(states, name)
        groups = [_Tested.of(*own, memory, rounding, fed_back) for own in shape_of.alike(colour, parts, level / count)]
        several = count * len(groups)
        noise = min(noise, several * min(group.noise for group in groups))
        briefly = several * min(group.briefly for group in groups)
        # No filter of usual length leaves so little of its noise in neighbouring differences.
        if noise < level or (first.by_channel.get(name, 0.0) > FAR and briefly < level):
            return None
        own = several * min(max(group.briefly, group.simply) for group in groups)
        fast = all(group.faster for group in groups)
        # What comes on some logs more than on others, and is as slow as the motion, may be a disturbance of these.
        own = own if fast or len(groups) == 1 else 0.0
        shape, simple = min(shape, own), simple and own >= level
        faster &= fast
    if fed_back and not (faster or (simple and not follows)):
        return None
    p_value = min(GATES * min(noise, shape), 1.0)
    return OnlyColour(coloured, simple and not follows, faster, p_value, fed_back=follows)


def mostly_rounding(states: Sequence[tuple[HeldOut, LogSet]], name: str, colour: Colour) -> bool:
    """Whether a channel of this `colour` leaves no more than its noise, and of that most is rounding, which stays as long as
    the speed does: its shape is that of the motion, and says nothing.

    A difference of two rounded positions has twice the error of one rounded value, and half of it back in the next.
    """
    first, _ = states[0]
    twice = 1.0 - 2.0 * min(max(colour.correlation, -0.5), 0.0)
    return first.by_channel.get(name, 0.0) <= 1.0 and twice * _rounding(states, name) > _ROUNDED


def _rounding(states: Sequence[tuple[HeldOut, LogSet]], name: str) -> float:
    """Share of a channel's residual, its variance, that rounding to the sensor's step makes."""
    step = max(step_of(logs, name) for _, logs in states)
    left = np.concatenate(
        [own * state.noise[name] for state, _ in states if name in state.noise for own in parts_of([state], name)]
    )
    return float(step**2 / 12.0 / max(usual_size(left) ** 2, 1e-300))


def parts_of(states: Sequence[HeldOut], name: str) -> list[Array]:
    """The residuals [T] of a channel on every log of `states`, NaN where not measured."""
    found = []
    for state in states:
        if name in state.by_channel:
            column = list(state.by_channel).index(name)
            found += [r[:, column] for r in state.residuals if np.isfinite(r[:, column]).any()]
    return found


def colours_of(states: Sequence[HeldOut]) -> dict[str, Colour]:
    """The colour of every channel, from all residuals, without what jumps and comes back."""
    names = dict.fromkeys(name for state in states for name in state.by_channel)
    return {name: colour_of([without_jumps(part) for part in parts_of(states, name)]) for name in names}


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
