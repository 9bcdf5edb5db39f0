"""Whether two sets of logs differ at all, and which of several refits are told apart."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chndtrinc

from ..._distributions import chi_squared_beyond, chi_squared_tail, student_tail
from ...estimate.confidence.agreement import rms
from ...estimate.noise_colour import Colour
from ...estimate.result import Fit
from ...logs import LogSet, noise_level
from ...robots.robot import Robot
from ...simulation.scaled import scales_of
from ..left.at_rest import shown_at_rest, standing
from ..left.coloured import OnlyColour, only_colour
from ..left.heldout import HeldOut, held_out_state
from ..level import current_level
from .candidates import Side
from .change import POWER
from .first_look import Score
from .joint import SIDES, Pair

Array = NDArray[np.float64]
_LARGER = 1.1
"""Ratio of two sets' residuals below which it is no news that one model follows one of them less well."""


def differ_at_all(before: Fit, after: Fit) -> float:
    """p value of the two fits' estimates if the truth were one: by their covariances (Wald)."""
    difference = np.array(
        [after.robot.parameters[n].value - before.robot.parameters[n].value for n in before.free_names]
    )
    covariance = np.asarray(before.covariance) + np.asarray(after.covariance)
    known = np.isfinite(np.diag(covariance)) & (np.diag(covariance) > 0)
    if not known.any():
        return 1.0
    size = np.sqrt(np.diag(covariance)[known])
    scaled = covariance[np.ix_(known, known)] / np.outer(size, size)
    values, vectors = np.linalg.eigh(scaled)
    told = values > 1e-8 * values.max()
    statistic = float(np.sum((vectors[:, told].T @ (difference[known] / size)) ** 2 / values[told]))
    return float(chi_squared_tail(statistic, int(told.sum())))


def _levels(logs: LogSet, residual: Array, there: NDArray[np.bool_], sigma: Array) -> Array:
    """Logarithm of each log's residual in units of the noise that its own neighbouring samples show."""
    found = []
    for e, log in enumerate(logs):
        noise = noise_level(LogSet([log]))
        own = []
        for i, name in enumerate(logs.channels.measured):
            level = noise.get(name, np.nan)
            if there[e, :, i].any() and np.isfinite(level) and level > 0:
                own.append(np.sqrt(np.mean(residual[e, there[e, :, i], i] ** 2)) * sigma[i] / level)
        if own:
            found.append(np.log(np.sqrt(np.mean(np.square(own)))))
    return np.array(found)


class Worse(NamedTuple):
    """That a model follows one of two sets less well than the other, by this `ratio`: its `p_value`, and what it is in a
    sentence where that is noise as slow as the motion."""

    p_value: float
    ratio: float
    noise: str = ""


def follows_one_worse(pair: Pair, residuals: Mapping[Side, Array], slow: bool = False) -> Worse:
    """Whether the model follows one set's logs less well than the other's: what is in one set only and in no candidate. Their
    noise may differ; it is taken from each log itself, and what has the shape of a sensor's filter and is faster than any
    force is noise as well; where all else is alike, what is as `slow` as the motion, too."""
    levels = []
    for side in SIDES:
        own = pair.sides[side]
        levels.append(_levels(own.logs, residuals[side], own.there, own.sigma))
    if min(map(len, levels)) < 2:
        return Worse(1.0, 1.0)
    ratio = float(np.exp(abs(levels[1].mean() - levels[0].mean())))
    variances = [own.var(ddof=1) / len(own) for own in levels]
    samples = [s.there.sum() / max(len(s.logs), 1) for s in pair.sides.values()]
    floor = [1.0 / max(n, 1.0) / len(own) for n, own in zip(samples, levels, strict=True)]
    spread = sum(max(v, f) for v, f in zip(variances, floor, strict=True))
    freedom = sum(map(len, levels)) - 2
    p = 2.0 * float(student_tail(np.log(ratio) / np.sqrt(spread), freedom))
    worse = SIDES[int(levels[1].mean() > levels[0].mean())]
    if not (ratio > _LARGER and p < current_level()):
        return Worse(p if ratio > _LARGER else 1.0, ratio)
    found, stands = _only_colour(pair, worse, residuals[worse])
    if found is not None and ((found.simple and found.faster) or stands):
        return Worse(1.0, ratio)
    if found is not None and found.simple and slow:
        said = (
            f"The set {worse} is followed {ratio:.2f} times less well than the other, in units of what neighbouring samples "
            f"show: what is left of it is coloured noise of {found.phrase}, which follows nothing that drove the robot."
        )
        return Worse(1.0, ratio, said)
    return Worse(p, ratio)


def _only_colour(pair: Pair, side: Side, residual: Array) -> tuple[OnlyColour | None, bool]:
    """What is left of one set, `residual` [E, T, ny] in units of the noise, where all of it is coloured noise; and whether that
    is there while the robot stands."""
    own = pair.sides[side]
    names = own.logs.channels.measured
    told = [i for i in range(len(names)) if own.there[:, :, i].any()]
    parts = [
        np.where(own.there[e, : len(log)], residual[e, : len(log)], np.nan)[:, told] for e, log in enumerate(own.logs)
    ]
    pooled = np.concatenate(parts)
    state = HeldOut(
        normalised_rms=rms(pooled),
        by_channel={names[i]: rms(pooled[:, k]) for k, i in enumerate(told)},
        residuals=tuple(parts),
        noise={names[i]: float(own.sigma[i]) for i in told},
        p_white=0.0,
    )
    scales = scales_of(pair.robot, own.logs)
    found = only_colour([(state, own.logs)], scales.time / scales.interval)
    if found is None or (found.simple and found.faster):
        return found, False
    left = [(state, own.logs)]
    return found, shown_at_rest(pair.robot, left, standing(pair.robot, left), found.colours, scales) is True


def noticed_from(score: Score, chance: float) -> Array:
    """The smallest size of each coordinate of a candidate that is noticed with a probability of `POWER` where one that is there
    by `chance` alone is called a change."""
    k = len(score.errors)
    shift = float(chndtrinc(chi_squared_beyond(chance, k), k, 1.0 - POWER))
    return np.sqrt(shift) * score.errors


def predicted(robot: Robot, logs: LogSet, sigma: Mapping[str, float], colours: Mapping[str, Colour]) -> list[Array]:
    """Whitened residuals [T, channels] of every held-out log."""
    state = held_out_state(robot, logs, dict(sigma))
    found: list[Any] = []
    for residual in state.residuals:
        there = np.isfinite(residual)
        columns = [
            colours[name].whiten(np.nan_to_num(residual[:, i]), there[:, i]) for i, name in enumerate(state.by_channel)
        ]
        found.append(np.stack(columns, axis=1))
    return found
