"""Whether an effect is worth adding: what it must close of the gap, beyond chance and beyond what another law had left."""

from collections.abc import Mapping, Sequence

import numpy as np

from ..._distributions import normal_beyond
from ...effects.curve import SHAPE
from ...logs import LogSet
from ..left.heldout import HeldOut
from ..policy import current_policy
from ..refits.prescribed_angles import predicted
from ..refits.refit import Trial
from .denser import bare_of
from .telling_apart import told_apart

_MOST = 0.5
"""Share of a gap on held-out logs, which chose nothing, that is most of it."""
_LEAST_BEHIND = 100.0
"""Score by which a trial may always lag behind the best after a few steps and still be in the running."""
_UNDONE = 0.99
"""Share of what an error of a sensor does that the refitted parameters of the rest undo, from which on it is another unit of
the same motion, such as one scale of all sensors, rather than an error: what little it explains, the rest explains."""

_NO_CHANCE = 50.0
"""Chi-squared of whitened samples, beyond its price, from which no colour of noise that was taken for another makes it."""
_WORSE = 1.1
"""Held-out error of one law or name over another's from which on it is clearly worse: chance moves that of a thousand
samples by some hundredths."""


def least_gain(before: Trial, first: Trial) -> float:
    """The least drop of the held-out RMS that explains something.

    After a first effect, less may be how far that one's law is from nature's: more so where it is a curve through few points.
    """
    added = before.robot.effects[len(first.robot.effects) :]
    policy = current_policy()
    least = max(policy.least_gain * before.held_out.gap, policy.least_of_first * first.held_out.gap)
    return max(least, coarseness(any(effect.law == SHAPE for effect in added), first.held_out)) if added else least


def coarseness(curve: bool, first: HeldOut) -> float:
    """What of the `first` gap an added formula, or an added `curve` through few points, may have left of its own."""
    policy = current_policy()
    if curve:
        return min(2.0 * policy.coarse_share * first.gap, policy.coarse_curve - 1.0)
    return min(policy.coarse_share * first.gap, policy.coarse_law - 1.0)


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
    policy = current_policy()
    gain = before.held_out.normalised_rms - after.held_out.normalised_rms
    # Where most of the gap is closed on logs that chose nothing, that was no chance, on however few stretches it was.
    closed = gain > _MOST * before.held_out.gap or told_apart(after.held_out, before.held_out) > policy.separated
    return gain >= least_gain(before, first) and closed and likelier(before, after, tried)


def likelier(before: Trial, after: Trial, tried: int) -> bool:
    """Whether an effect explains more of the fitted logs than chance does."""
    return _beyond(before, after, tried) > 0.0


def _beyond(before: Trial, after: Trial, tried: int) -> float:
    """By how much more of chi-squared on the fitted logs than chance could, `tried` candidates accounted for."""
    price = (after.free - before.free) * np.log(before.fitted.samples) + 2 * np.log(tried)
    return float(before.squares - after.squares - price)


def worth_in_colour(before: Trial, after: Trial, tried: int) -> bool:
    """The same of whitened trials, whose chi-squared on the held-out logs, to which nothing was fitted, tells by itself.

    Were there no such effect, what it changes there, of size D in whitened units, would cost D on average, with a standard
    deviation of 2 sqrt(D). So a gain of g has at most the probability of sqrt(g) standard deviations, whatever D. Where
    held-out logs hardly ask for it, D is too small for that; what is no chance at all on the fitted ones they need only bear
    out.
    """
    gained = before.held_out.squares - after.held_out.squares
    least = float(normal_beyond(before.held_out.false_alarm / 2)) ** 2
    return _beyond(before, after, tried) > (0.0 if gained > least else _NO_CHANCE) and gained > 0.0


def undone(trial: Trial, before: Trial, held_out: LogSet, noise: Mapping[str, float]) -> bool:
    """Whether the trial's effect is one of a sensor, and the rest of the model was refitted to undo what it does."""
    effect = trial.effect
    if effect is None or effect.where != "sensor" or trial.angles:
        return False
    without = predicted(bare_of(trial.robot, effect), held_out, noise).squares - trial.held_out.squares
    gained = before.held_out.squares - trial.held_out.squares
    # Where it runs away without the effect, it has not been made up for, but is needed.
    return bool(np.isfinite(without) and without > gained / (1.0 - _UNDONE))


def holds_as_well(trial: Trial, current: Trial) -> bool:
    """Whether `trial` predicts the held-out logs about as well as `current`: what follows the fitted logs better, and others
    clearly worse, explains no more. Anything does that stays finite where `current` runs away."""
    if trial.held_out.diverged or current.held_out.diverged:
        return not trial.held_out.diverged
    return trial.held_out.normalised_rms <= _WORSE * current.held_out.normalised_rms


def in_the_running(trials: Sequence[Trial], base: Trial) -> float:
    """The score below which a trial of `base` with a further effect is refitted to the end."""
    best = min((trial.score for trial in trials), default=base.score)
    return best + max(_LEAST_BEHIND, current_policy().in_the_running * (base.score - best))
