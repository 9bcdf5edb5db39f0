"""What passes for a change since the model lacks it in both sets: compared again with it in both.

Two sets of logs drive a robot differently. What its model lacks then shows more in one set than in the other, and a mechanism
that "appeared" in that one explains part of the difference, although it was there before. Or it was there, and has grown: what
"appeared" then has the size that it grew to.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...estimate.output_error.output_error import output_error
from ...estimate.result import Fit
from ...logs import LogError, LogSet
from ...parameters import ParameterError
from .candidates import of_numbers
from .first_look import FirstLook
from .joint import SIDES, Colours, Joint, Pair, numbers_on, refit, with_candidate

_MOST, _FEW = 8, 3
"""Mechanisms that are tried in both sets, and steps of their refits in one."""
_MUCH = 0.5
"""Share of what the best change explains from which a mechanism that came or went may have been there, of another size."""
_MORE = 0.005
"""Share of that by which its being there explains more: squares of a size that is some seven per cent of the change."""


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
    pair: Pair, look: FirstLook, refitted: Sequence[Joint], null: Joint, best: Joint, colours: Colours
) -> tuple[Joint, Joint] | None:
    """Of the mechanisms that appeared or vanished at the first `look` the one that explains most where both sets have it, in
    the same numbers or in their own, refitted in one (some are already) and in both; None where none explains more than the
    `best` change does. `null` is the refit without any."""
    rows = float(np.log(sum(int(own.there.sum()) for own in pair.sides.values())))
    explained = null.squares - best.squares
    scores = [score for score in look.scores if not score.own and score.gain > 0.0]
    first = {score.candidate.id: score for score in reversed(scores)}  # of both sides the likelier
    joints = [joint for joint in refitted if joint.candidate is not None]
    there = {joint.candidate.id for joint in joints if joint.candidate is not None}
    for score in sorted(first.values(), key=lambda s: -s.gain)[:_MOST]:
        if score.candidate.id not in there:
            start = score.delta if np.all(np.isfinite(score.delta)) else None
            joints.append(refit(pair, score.candidate, colours, best.theta, start, steps=_FEW))
    found: list[tuple[float, Joint, Joint]] = []
    for joint in joints:
        both = both_with(pair, joint, colours)
        if both.squares < best.squares:
            found.append((both.squares + rows * len(joint.delta), joint, both))
        elif null.squares - joint.squares > _MUCH * explained:
            each = _each_with_its_own(pair, joint, both, colours)
            cost = rows * len(each.delta)
            if each.squares + cost < best.squares - _MORE * explained:
                found.append((each.squares + 2.0 * cost, joint, each))
    return min(found, key=lambda own: own[0])[1:] if found else None


def fitted_with(
    before: Fit, after: Fit, logs: tuple[LogSet, LogSet], lacking: Joint, both: Joint
) -> tuple[Fit, Fit] | None:
    """Both fits again with what both sets lack; None where they were made in windows or do not follow."""
    if before.window is not None or lacking.candidate is None:
        return None
    found = []
    names = (*before.free_names, *(c.name for c in lacking.candidate.coordinates))
    for fit, own, side in zip((before, after), logs, SIDES, strict=True):
        robot = with_candidate(fit.robot, lacking.candidate)
        numbers = numbers_on(side, robot, names, both.candidate, both.theta, both.delta)
        start = {name: numbers[name] for name in names}
        try:
            found.append(output_error(robot, own, start=start))
        except (ParameterError, LogError):
            return None
    one, other = found
    return (one, other) if one.free_names == other.free_names else None
