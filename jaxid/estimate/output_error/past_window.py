"""What a moving window knew once a window had come, and whether a later one contradicts it when that window is simulated again.

A window that moved one way alone hardly tells dry friction from an offset, and its slopes there are no measure of what it
knows: the comparison of linearised estimates (`change.py`) then finds changes that are none.
"""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import scipy

from ...parameters import ParameterError
from .change import Knowledge, solved, square_root
from .laid_out import Direct
from .window_minimum import Minimum, minimum


@dataclass(frozen=True)
class Past:
    """What was `known` once a window had come; of it, what the window `alone` said in the lanes `d`, beside what was known
    `before` it."""

    known: Knowledge
    d: Direct | None = None
    alone: Minimum | None = None
    before: Knowledge | None = None


def agrees(past: Past, now: Knowledge, decay: float) -> float:
    """How often what was known and what a window says `now` would differ so much by chance, the last window of what was known
    simulated again; zero where there is none. `decay`: what is left of what was known before that."""
    d, alone, here = past.d, past.alone, now.mean
    if d is None or alone is None:
        return 0.0
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
