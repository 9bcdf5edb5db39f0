"""What passes for a change since the model lacks it in both sets: compared again with it in both.

Two sets of logs drive a robot differently. What its model lacks then shows more in one set than in the other, and a mechanism
that "appeared" in that one explains part of the difference, although it was there before. Or it was there, and has grown: what
"appeared" then has the size that it grew to. A constant of the table that is wrong in both passes for a change likewise.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...estimate.output_error.output_error import output_error
from ...estimate.result import Fit
from ...logs import LogError, LogSet
from ...parameters import ParameterError
from .candidates import Candidate, of_numbers
from .first_look import FirstLook
from .joint import SIDES, Colours, Joint, Pair, numbers_on, refit, with_candidate
from .trials import NEARLY, Trial, price

_MOST, _FEW = 8, 3
"""Mechanisms that are tried in both sets, and steps of their refits in one."""
_MUCH = 0.5
"""Share of what the best change explains from which a mechanism that came or went may have been there, of another size."""
_MORE = 0.005
"""Share of that by which its being there explains more: squares of a size that is some seven per cent of the change."""
_LITTLE = 0.2
"""Share of a constant's change that is left of it where both sets have another value than the table's, if it did not change."""


def _shared(pair: Pair, joint: Joint) -> Pair:
    """The pair of which both sets have what the candidate of `joint`, a mechanism of the catalogue, gives to one of them."""
    assert joint.candidate is not None
    names = [c.name for c in joint.candidate.coordinates]
    robot = with_candidate(pair.robot, joint.candidate)
    robot = robot.with_values(**dict(zip(names, map(float, joint.delta), strict=True)))
    return replace(pair, robot=robot, free=(*pair.free, *names))


def both_with(pair: Pair, joint: Joint, colours: Colours) -> Joint:
    """The refit in which both sets have what the candidate of `joint`, a mechanism of the catalogue, gives to one of them."""
    theta = np.concatenate([joint.theta, joint.delta])
    return refit(_shared(pair, joint), None, colours, theta, None, joint.states)


def _each_with_its_own(pair: Pair, joint: Joint, both: Joint, colours: Colours) -> Joint:
    """The refit in which both sets have it, each in numbers of its own, from that in which these are the same."""
    assert joint.candidate is not None
    shared = _shared(pair, joint)
    names = [c.name for c in joint.candidate.coordinates]
    grown = of_numbers(shared.robot, joint.candidate.id, names)
    return refit(shared, grown, colours, both.theta, None, both.states)


def lacking_in_both(
    pair: Pair, look: FirstLook, trials: Sequence[Trial], null: Joint, best: Trial, colours: Colours, poor: bool
) -> tuple[Candidate, Joint] | None:
    """Of the mechanisms that appeared or vanished at the first `look` the one that explains most where both sets have it, in
    the same numbers or in their own, with that refit (in one set some of the `trials` are refitted already); None where none
    explains more than the `best` change does. `null` is the refit without any. Numbers of its own in each set follow whatever
    two `poor` fits leave: of another mechanism than the best they have to explain more by as much as tells two changes beside
    such."""
    rows = price(pair)
    explained = null.squares - best.joint.squares
    scores = [score for score in look.scores if not score.own and score.gain > 0.0]
    first = {score.candidate.id: score for score in reversed(scores)}  # of both sides the likelier
    joints = [(t.joint, t.score.candidate) for t in trials if not t.score.own]
    there = {candidate.id for _, candidate in joints}
    for score in sorted(first.values(), key=lambda s: -s.gain)[:_MOST]:
        if score.candidate.id not in there:
            start = score.delta if np.all(np.isfinite(score.delta)) else None
            joints.append((refit(pair, score.candidate, colours, best.joint.theta, start, steps=_FEW), score.candidate))
    grown = best.joint.squares - _MORE * explained
    other = min(grown, min(t.joint.squares for t in trials) - NEARLY * explained) if poor else grown
    found: list[tuple[float, Candidate, Joint]] = []
    for joint, candidate in joints:
        both = both_with(pair, joint, colours)
        if both.squares < best.joint.squares:
            found.append((both.squares + rows * len(joint.delta), candidate, both))
        elif null.squares - joint.squares > _MUCH * explained:
            each = _each_with_its_own(pair, joint, both, colours)
            cost = rows * len(each.delta)
            if each.squares + cost < (grown if candidate.id == best.score.candidate.id else other):
                found.append((each.squares + 2.0 * cost, candidate, each))
    return min(found, key=lambda own: own[0])[1:] if found else None


def constants_of_both(pair: Pair, likely: Sequence[Joint], colours: Colours) -> tuple[tuple[str, ...], Joint] | None:
    """Constants of the table that one of the `likely` changes moves in one set, and that hardly change where both sets may have
    other values than the table's, with the refit in which they do, if that explains as much as any of these; None where there
    is none."""
    most = min(joint.squares for joint in likely)
    asked: set[tuple[str, ...]] = set()
    for joint in likely:
        fixed = tuple(own for own in (joint.candidate.own if joint.candidate else ()) if own not in pair.free)
        if not fixed or fixed in asked:
            continue
        asked.add(fixed)
        both = _of_both(pair, joint, fixed, colours)
        same = tuple(own for own in fixed if abs(_moved(both, own)) < _LITTLE * abs(_moved(joint, own)))
        if same and same != fixed:
            both = _of_both(pair, joint, same, colours)
        if same and both.squares + price(pair) * len(same) < most:
            return same, both
    return None


def _of_both(pair: Pair, joint: Joint, constants: Sequence[str], colours: Colours) -> Joint:
    """The change of `joint` again, with the `constants` of both sets beside it."""
    shared = replace(pair, free=(*pair.free, *constants))
    theta = np.concatenate([joint.theta, [pair.robot.parameters[name].value for name in constants]])
    return refit(shared, joint.candidate, colours, theta, joint.delta, joint.states)


def _moved(joint: Joint, parameter: str) -> float:
    """By how much a change moves a parameter."""
    assert joint.candidate is not None
    return float(next(d for c, d in zip(joint.candidate.coordinates, joint.delta, strict=True) if c.of == parameter))


def fitted_with(
    before: Fit, after: Fit, logs: tuple[LogSet, LogSet], lacking: Candidate | Sequence[str], both: Joint
) -> tuple[Fit, Fit] | None:
    """Both fits again with what both sets lack, a mechanism or constants to be estimated, from the refit of `both`; None where
    they were made in windows or do not follow."""
    if before.window is not None:
        return None
    mechanism = lacking if isinstance(lacking, Candidate) else None
    freed = [c.name for c in lacking.coordinates] if isinstance(lacking, Candidate) else list(lacking)
    found, names = [], (*before.free_names, *freed)
    for fit, own, side in zip((before, after), logs, SIDES, strict=True):
        robot = with_candidate(fit.robot, mechanism)
        for name in freed if mechanism is None else ():
            robot = robot.change(name, free=True)
        carries = with_candidate(robot, both.candidate)
        numbers = numbers_on(side, carries, names, both.candidate, both.theta, both.delta)
        start = {name: numbers[name] for name in names}
        try:
            found.append(output_error(robot, own, start=start))
        except (ParameterError, LogError):
            return None
    one, other = found
    return (one, other) if one.free_names == other.free_names else None
