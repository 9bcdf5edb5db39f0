"""Whether an effect is worth adding: what it must close of the gap, beyond chance and beyond what another law had left."""

import numpy as np

from .._distributions import normal_beyond
from ..effects.curve import SHAPE
from .refit import Trial
from .telling_apart import SEPARATED, told_apart

LEAST_GAIN = 0.05
"""Share of the held-out gap below which an effect explains nothing."""
_LEAST_OF_FIRST = 0.02
"""Share of the first gap that a further effect must close: below, it may be the first effect's own imprecision."""
COARSE_LAW, COARSE_CURVE = (0.05, 0.08), (0.1, 0.15)
"""The same, and the RMS that is enough at any rate, for what an added formula or an added curve may have left of its own."""
NEARLY_ALL = 0.15
"""Share of the held-out gap up to which what is left of it says that an effect explains it, on however few stretches."""


def least_gain(before: Trial, first: Trial) -> float:
    """The least drop of the held-out RMS that explains something.

    After a first effect, less may be how far that one's law is from nature's: more so where it is a curve through few points.
    """
    added = before.robot.effects[len(first.robot.effects) :]
    coarse = COARSE_CURVE if any(effect.law == SHAPE for effect in added) else COARSE_LAW
    share, most = coarse if added else (0.0, 0.0)
    gap = first.held_out.gap
    return max(LEAST_GAIN * before.held_out.gap, _LEAST_OF_FIRST * gap, min(share * gap, most))


def _added(before: Trial, first: Trial) -> bool:
    return len(before.robot.effects) > len(first.robot.effects)


def could_matter(before: Trial, first: Trial) -> bool:
    """Whether anything that is still missing could close enough of the gap to matter, beside what has been added already."""
    return not _added(before, first) or before.held_out.gap >= least_gain(before, first)


def matters(before: Trial, after: Trial, first: Trial) -> bool:
    """Whether a further effect closes enough of the gap to be more than the imprecision of what was added before it."""
    gain = before.held_out.normalised_rms - after.held_out.normalised_rms
    return not _added(before, first) or gain >= least_gain(before, first)


def worth_it(before: Trial, after: Trial, first: Trial, tried: int) -> bool:
    """Whether an effect explains something, the number of candidates tried (effects and their shapes) accounted for."""
    gain = before.held_out.normalised_rms - after.held_out.normalised_rms
    # Where nearly all of the gap is closed, that was no chance, on however few stretches it was.
    closed = (
        after.held_out.gap < NEARLY_ALL * before.held_out.gap or told_apart(after.held_out, before.held_out) > SEPARATED
    )
    return gain >= least_gain(before, first) and closed and likelier(before, after, tried)


def likelier(before: Trial, after: Trial, tried: int) -> bool:
    """Whether an effect explains more of the fitted logs than chance does."""
    price = (after.free - before.free) * np.log(before.fitted.samples) + 2 * np.log(tried)
    return bool(before.squares - after.squares > price)


def worth_in_colour(before: Trial, after: Trial, tried: int) -> bool:
    """The same of whitened trials, whose chi-squared on the held-out logs, to which nothing was fitted, tells by itself.

    Were there no such effect, what it changes there, of size D in whitened units, would cost D on average, with a standard
    deviation of 2 sqrt(D). So a gain of g has at most the probability of sqrt(g) standard deviations, whatever D.
    """
    gained = before.held_out.squares - after.held_out.squares
    return likelier(before, after, tried) and gained > float(normal_beyond(before.held_out.false_alarm / 2)) ** 2
