"""A past window of a moving one, and whether a later one contradicts it when it is simulated again.

A window that moved one way alone hardly tells dry friction from an offset, and its slopes there are no measure of what it
knows: the comparison of linearised estimates (`change.py`) then finds changes that are none.
"""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from ...parameters import ParameterError
from .change import Knowledge, solved, square_root
from .laid_out import Direct
from .window_minimum import Minimum, minimum


@dataclass(frozen=True)
class Past:
    """A window that ended at `time`: what it said `alone` in the lanes `d`, beside what was known `before` it."""

    time: float
    d: Direct
    alone: Minimum
    before: Knowledge | None


def last_before(past: list[Any], begins: float) -> Any:
    """The last of those by `time` that ended before a window `begins`, which later fits have no part in; None where none did.
    Those before it are forgotten."""
    while len(past) > 1 and past[1].time <= begins + 1e-9:
        past.pop(0)
    return past[0] if past and past[0].time <= begins + 1e-9 else None


def agrees(past: Past, now: Knowledge, decay: float) -> float:
    """How often what was known at the end of a past window and what a window says `now` would differ so much by chance, the
    past one simulated again. `decay`: what is left of what was known before that."""
    d, alone, here = past.d, past.alone, now.mean
    others = [(now.information, here + solved(now.information, now.pull - now.information @ here))]
    if past.before is not None:
        others.append((decay * past.before.information, past.before.mean))
    information = np.sum([weight for weight, _ in others], axis=0)
    pull = np.sum([weight @ centre for weight, centre in others], axis=0)
    mean = here + solved(information, pull - information @ here)
    root, least = square_root(information), np.inf
    for begun in (mean, alone.theta):
        with suppress(ParameterError):  # it diverges from there
            end = minimum(d, begun, alone.states, root, mean)
            least = min(least, end.squares + float(np.sum((root @ (end.theta - mean)) ** 2)))
    apart = sum(float((centre - mean) @ weight @ (centre - mean)) for weight, centre in others)
    more = max(least + apart - alone.squares, 0.0)
    return float(scipy.special.chdtrc(len(here), more)) if np.isfinite(more) else 0.0
