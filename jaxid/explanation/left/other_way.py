"""Outputs that go the other way than the model says, or many times as far in one log as in the others, or as the model says
where others go as far: a sign or a unit.

Pre-flight knows the signs of robots that declare how their inputs mix, and units that no robot reaches. Of any other robot its
model says the same: a fit can make a gain zero, where it must not be negative, and no parameter turns one log alone. What is
added to such a model to follow its logs is no missing effect.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...estimate.output_error.estimated_start import estimated_start
from ...estimate.result import Fit
from ...logs import LogSet, noise_scale
from ...robots.robot import Robot
from .heldout import held_out_state, residuals_of

Array = NDArray[np.float64]

CHECK = "Check the columns before anything is added"
_AGAINST = -0.5
"""Correlation of an output with its simulation below which it goes the other way."""
_WITH = 0.3
"""The same above which a fit follows an output, whatever its start did."""
_FOLLOWS = 0.9
"""The same from which the two differ by a factor."""
_FACTOR = 2.5
"""Ratio of one log's factor to the others' from which it is another unit (3.6 for km/h): at a crawl friction makes two."""
_AS_FAR = 1.5
"""Ratio of two factors up to which they are one."""
_MOVES = 1.2
"""Standard deviation of an output, in those of its noise, from which it moves."""
_FEWEST = 50
_TOLD = 3


class _Seen(NamedTuple):
    """An output of one log beside its simulation: their correlation, and the factor from the one to the other."""

    log: str
    channel: str
    correlation: float
    factor: float


def _undriven(robot: Robot, logs: LogSet, noise: dict[str, float], channels: Sequence[str]) -> list[Array]:
    """What the robot would do without any input, from the states in which the logs begin, [T, channels] each."""
    levels = {name: noise[name] for name in channels}
    start = estimated_start(robot, logs, noise, {})
    still = LogSet([replace(log, inputs=np.zeros_like(log.inputs)) for log in logs])
    every = residuals_of(robot, still, levels, start)
    sizes = np.array([levels[name] for name in channels])
    read = [
        np.stack([log.output(n) if n in log.measured else np.full(len(log), np.nan) for n in channels], axis=1)
        for log in logs
    ]
    return [own + left * sizes for own, left in zip(read, every, strict=True)]


def _seen(robot: Robot, logs: LogSet, noise: dict[str, float], driven: bool = False) -> Iterator[_Seen]:
    """Every output that moves, in the logs and in the simulation; of the simulation only what the inputs make of it where
    `driven`: how a motion dies out says nothing of a sign."""
    state = held_out_state(robot, logs, noise)
    undriven = _undriven(robot, logs, noise, list(state.by_channel)) if driven else [None] * len(logs)
    for log, residual, still in zip(logs, state.residuals, undriven, strict=True):
        for i, name in enumerate(state.by_channel):
            if name not in log.measured or log.name in state.diverged:
                continue
            measured, level = log.output(name), state.noise[name]
            there = np.isfinite(measured) & np.isfinite(residual[:, i])
            own, theirs = measured[there], (measured + residual[:, i] * level)[there]
            theirs = theirs if still is None else theirs - still[there, i]
            if len(own) < _FEWEST or np.std(own) < _MOVES * level or np.std(theirs) < 0.5 * level:
                continue
            own, theirs = own - own.mean(), theirs - theirs.mean()
            product, length = float(own @ theirs), float(np.linalg.norm(theirs))
            # Of what moved alone: noise makes every correlation small.
            moved = np.sqrt(max(float(own @ own) - len(own) * level**2, 1e-300))
            yield _Seen(log.name, name, product / (moved * length), product / length**2)


def _turned(fitted: Sequence[_Seen], first: Sequence[_Seen]) -> dict[str, list[str]]:
    """The logs in which each output goes the other way: by the fitted model, or by the table's numbers where the fit does not
    follow it."""
    by_fit = {(one.log, one.channel): one.correlation for one in fitted}
    against = {place for place, correlation in by_fit.items() if correlation < _AGAINST}
    against |= {
        (one.log, one.channel)
        for one in first
        if one.correlation < _AGAINST and by_fit.get((one.log, one.channel), 0.0) < _WITH
    }
    found: dict[str, list[str]] = {}
    for log, channel in sorted(against):
        found.setdefault(channel, []).append(log)
    return found


def _in_both(one: dict[str, list[str]], other: dict[str, list[str]]) -> dict[str, list[str]]:
    """The logs that both say of a channel."""
    both = {channel: [log for log in logs if log in other.get(channel, ())] for channel, logs in one.items()}
    return {channel: logs for channel, logs in both.items() if logs}


def _other_units(fitted: Sequence[_Seen]) -> Iterator[tuple[str, str, float]]:
    """(log, output, factor) of outputs that go many times as far in one log as in most of the others."""
    for channel in dict.fromkeys(one.channel for one in fitted):
        own = [one for one in fitted if one.channel == channel and one.correlation > _FOLLOWS]
        if len(own) < 4:
            continue
        usual = float(np.median([one.factor for one in own]))
        far = [one for one in own if not usual / _FACTOR < one.factor < usual * _FACTOR]
        if len(far) <= len(own) / 3:
            yield from ((one.log, channel, one.factor / usual) for one in far)


def _beside_others(fitted: Sequence[_Seen]) -> Iterator[tuple[str, float, list[str]]]:
    """(output, factor, others) of outputs that go many times as far as the fitted model says in every log in which they move,
    where others go as far as it says: two columns that say the same of one motion in units that differ."""
    factors = {
        channel: [one.factor for one in fitted if one.channel == channel]
        for channel in dict.fromkeys(one.channel for one in fitted)
        if all(one.correlation > _FOLLOWS for one in fitted if one.channel == channel)
    }
    usual = {channel: float(np.median(own)) for channel, own in factors.items()}
    right = [channel for channel, own in factors.items() if all(1.0 / _AS_FAR < factor < _AS_FAR for factor in own)]
    for channel, own in factors.items():
        if right and all(usual[channel] / _AS_FAR < factor < usual[channel] * _AS_FAR for factor in own):
            if not 1.0 / _FACTOR < usual[channel] < _FACTOR:
                yield channel, usual[channel], right


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _TOLD} more" if len(names) > _TOLD else ""
    return ", ".join(names[:_TOLD]) + more


def other_way(fit: Fit, logs: LogSet, held_out: LogSet | None = None, first: Robot | None = None) -> str:
    """A sentence on the outputs of the logs that contradict the model by their sign or their size; empty where none do, where
    the fit does well, and for fits in windows. `first`: the robot as it is known to be, by default that of the table."""
    if fit.window is not None or fit.judgement is None or not (fit.judgement.doubt or _at_bounds(fit)):
        return ""
    more = [log for log in held_out or () if log.name not in logs.names]
    every = LogSet([*logs, *more])
    noise = noise_scale(LogSet(more) if more else logs, otherwise=logs)
    fitted = list(_seen(fit.robot, every, noise))
    table = fit.robot.defaults() if first is None else first.parameters
    # Of the table's own values some may lie beyond bounds that the user knows.
    start = {n: fit.robot.parameters[n].inside(table[n].value) for n in fit.free_names if n in table}
    beginning = fit.robot.with_values(**start)
    begun = list(_seen(beginning, every, noise))
    turned, units = _turned(fitted, begun), list(_other_units(fitted))
    if turned:
        driven = [list(_seen(robot, every, noise, driven=True)) for robot in (fit.robot, beginning)]
        turned = _in_both(turned, _turned(*driven))
    parts = [
        f"{channel} goes the other way than the model says in {_listed(names) if len(names) < len(every) else 'every log'} "
        "(its sign, that of an input, or columns that are exchanged)"
        for channel, names in turned.items()
    ]
    parts += [
        f"{channel} goes {by:.3g} times as far in {log} as in the other logs (its unit)" for log, channel, by in units
    ]
    beside = list(_beside_others(fitted))
    if beside:
        far = " and ".join(f"{channel} {by:.3g} times" for channel, by, _ in beside)
        parts.append(
            f"every log goes in {far} as far as the model says, and in {_listed(beside[0][2])} as far as it says (the unit or "
            "scale of the former, or of the latter)"
        )
    return f"{CHECK}: {'; '.join(parts)}." if parts else ""


def _at_bounds(fit: Fit) -> bool:
    """Whether a parameter ended on a bound, or is not determined."""
    return any(fit[name].status in ("at_bound", "not_identifiable") for name in fit.free_names)
