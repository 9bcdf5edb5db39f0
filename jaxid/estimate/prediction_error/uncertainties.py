"""Covariance of everything that was estimated, from the information or, where innovations are not white, a sandwich.

Where the innovations are independent and Gaussian the scores of single samples add up to the information itself. Where a
test rejects that, the covariance is I⁻¹ B I⁻¹ with B from the scores of blocks of time longer than the innovations
remember (White, Econometrica 50, 1982; Newey & West, ibid. 55, 1987), and no standard error gets smaller by it.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy.typing import NDArray

from ..._arrays import AnyArray
from ...logs import LogSet
from ..output_error.robust_covariance import memory
from ..residual_tests import normality, whiteness
from .filter import Model
from .likelihood import Problem, scores
from .scoring import seen_at

_MEMORIES, _SHORTEST, _FEWEST = 10.0, 10, 30
_UNSETTLED = 1.5
"""Standard deviation of an innovation, in units of the usual one, from which a log's start is not known yet."""
_SINGULAR = 1e-13


class Whitened(NamedTuple):
    """Whitened innovations [E, T, ny], zero where nothing was measured, their stated standard deviations [E, T, ny], and the
    scores [E, T, ny, p] of all samples."""

    innovations: NDArray[np.float64]
    deviations: NDArray[np.float64]
    scores: NDArray[np.float64]


def whitened(names: tuple[str, ...], model: Model, problem: Problem, x: Float[AnyArray, " p"]) -> Whitened:
    """Innovations and scores at `x`."""
    white, level, d_white, d_level = map(np.asarray, seen_at(names, model, problem, x))
    return Whitened(white, np.exp(0.5 * level), np.asarray(scores(white, level, d_white, d_level)[1]))


def doubts(found: Whitened, problem: Problem, channels: tuple[str, ...]) -> dict[str, str]:
    """What tests reject of the innovations by channel, in words; empty where nothing is."""
    there = np.asarray(problem.records.there)
    said: dict[str, str] = {}
    for i, channel in enumerate(channels):
        if not there[..., i].any():
            continue
        parts = [
            np.where(m, w, np.nan)[: np.flatnonzero(m)[-1] + 1] if m.any() else np.empty(0)
            for w, m in zip(found.innovations[..., i], there[..., i], strict=True)
        ]
        parts = [part for part in parts if part.size]
        words = []
        if whiteness(parts, channel).rejected:
            words.append("are not white")
        if normality(np.concatenate(parts), channel).rejected:
            words.append("are not Gaussian")
        if words:
            said[channel] = " and ".join(words)
    return said


def expected(logs: LogSet, found: Whitened) -> list[NDArray[np.float64]]:
    """Outputs [T, channels.measured] of each log that were expected one sample before; where none was measured, its last
    neighbour's."""
    outputs = []
    for log, white, deviation in zip(logs, found.innovations, found.deviations, strict=True):
        y = log.outputs - (white * deviation)[: len(log)]
        outputs.append(pd.DataFrame(y).ffill().bfill().fillna(0.0).to_numpy())
    return outputs


def stated(channels: tuple[str, ...], found: Whitened, problem: Problem) -> dict[str, float]:
    """Root mean square of the innovations' stated standard deviations by channel, but for the first samples of a log as long as
    they say how little is known of its start."""
    there = np.asarray(problem.records.there)
    levels = np.ones(len(channels))
    for i in range(len(channels)):
        measured, deviation = there[..., i], found.deviations[..., i]
        if not measured.any():
            continue
        usual = float(np.median(deviation[measured]))
        settled = np.logical_or.accumulate(measured & (deviation < _UNSETTLED * usual), axis=-1)
        levels[i] = np.sqrt(np.mean(deviation[measured & settled] ** 2)) or 1.0
    return {c: float(level) for c, level in zip(channels, levels, strict=True)}


def pseudo_inverse(information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Inverse of the information on what it determines, whatever the units."""
    diagonal = np.diag(information)
    scale = np.where(diagonal > 0, 1.0 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(information * np.outer(scale, scale))
    kept = values > _SINGULAR * max(values.max(), 1e-300)
    return (vectors[:, kept] / values[kept]) @ vectors[:, kept].T * np.outer(scale, scale)


def sandwich(
    found: Whitened,
    problem: Problem,
    information: NDArray[np.float64],
    white: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Covariance [p, p] from the scores of blocks; every standard error at least that of the covariance `white`, which holds
    for white innovations."""
    there = np.asarray(problem.records.there)
    samples = int(there.any(axis=-1).sum())
    length = int(
        np.clip(np.ceil(_MEMORIES * memory(found.innovations, there)), _SHORTEST, max(samples // _FEWEST, _SHORTEST))
    )
    by_sample = found.scores.sum(axis=2)
    starts = np.arange(0, by_sample.shape[1], length)
    blocks = np.concatenate([np.add.reduceat(rows, starts, axis=0) for rows in by_sample])
    blocks = blocks[np.any(blocks != 0.0, axis=1)]
    inverse = pseudo_inverse(information)
    covariance = inverse @ (blocks.T @ blocks) @ inverse
    least, own = np.sqrt(np.diag(white)), np.sqrt(np.diag(covariance))
    grow = np.where(own > 0, np.maximum(least, own) / np.where(own > 0, own, 1.0), 1.0)
    return covariance * np.outer(grow, grow)
