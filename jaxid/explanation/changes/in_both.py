"""What passes for a change since the model lacks it in both sets: compared again with it in both.

Two sets of logs drive a robot differently. What its model lacks then shows more in one set than in the other, and a mechanism
that "appeared" in that one explains part of the difference, although it was there before.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...estimate.output_error.output_error import output_error
from ...estimate.result import Fit
from ...logs import LogError, LogSet
from ...parameters import ParameterError
from .joint import Colours, Joint, Pair, refit, with_candidate


def both_with(pair: Pair, joint: Joint, colours: Colours) -> Joint:
    """The refit in which both sets have what the candidate of `joint`, a mechanism of the catalogue, gives to one of them."""
    assert joint.candidate is not None
    names = [c.name for c in joint.candidate.coordinates]
    robot = with_candidate(pair.robot, joint.candidate)
    robot = robot.with_values(**dict(zip(names, map(float, joint.delta), strict=True)))
    shared = replace(pair, robot=robot, free=(*pair.free, *names))
    return refit(shared, None, colours, np.concatenate([joint.theta, joint.delta]), None, joint.states)


def lacking_in_both(
    pair: Pair, best: Joint, mechanisms: Sequence[Joint], colours: Colours
) -> tuple[Joint, Joint] | None:
    """Of `mechanisms`, refits of what appeared or vanished, the one that explains more than the `best` change does where both
    sets have it, and that refit; None where none does."""
    found = [(joint, both_with(pair, joint, colours)) for joint in mechanisms]
    found = [own for own in found if own[1].squares < best.squares]
    return min(found, key=lambda own: own[1].squares) if found else None


def fitted_with(
    before: Fit, after: Fit, logs: tuple[LogSet, LogSet], lacking: Joint, both: Joint
) -> tuple[Fit, Fit] | None:
    """Both fits again with what both sets lack; None where they were made in windows or do not follow."""
    if before.window is not None or lacking.candidate is None:
        return None
    found = []
    for fit, own in zip((before, after), logs, strict=True):
        robot = with_candidate(fit.robot, lacking.candidate)
        names = (*before.free_names, *(c.name for c in lacking.candidate.coordinates))
        start = dict(zip(names, map(float, both.theta), strict=True))
        try:
            found.append(output_error(robot, own, start=start))
        except (ParameterError, LogError):
            return None
    one, other = found
    return (one, other) if one.free_names == other.free_names else None
