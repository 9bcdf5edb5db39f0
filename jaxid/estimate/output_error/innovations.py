"""What a window's residual holds beyond what its own initial state has taken: one-step innovations, white if the noise is.

An initial state that is estimated from a window of fifty samples takes two or three of them with it, and what it leaves is not
white, however white the noise: neighbours are related by minus a few percent, which over thousands of samples no test misses.
Recursive residuals undo that (Brown, Durbin & Evans, J. R. Statist. Soc. B 37, 1975): each sample against what those before it
say of the initial state, in units of how well they say it. Of white noise they are white and of its own size.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .evaluation import sensitivities_at
from .problem import Problem, Structure, Unknowns

_VAGUE = 1e-6
"""Information on an initial state before its window, as a share of what the window gives: none to speak of."""
_TELLING = 10.0
"""Variance of an innovation, in units of the noise's, from which the sample tells the initial state and not the noise."""


class Innovations(NamedTuple):
    """Of every sample of every window, in units of the noise; NaN where nothing was measured and for the first samples, which
    only tell the initial state. `white`: the innovations (predicted minus measured), each over its own standard deviation,
    one channel after the other. `ahead`: what the samples before a sample predict of it, less what was measured: the
    measurement and this have nothing of the sample's noise."""

    white: Float[np.ndarray, "E T ny"]
    ahead: Float[np.ndarray, "E T ny"]


def innovations(structure: Structure, problem: Problem, at: Unknowns) -> Innovations:
    """The innovations of every window. Call under float64."""
    residual, own = _linearised(structure, problem, at)
    white, ahead = _recursive(residual[None], own, problem)
    return Innovations(white[0], ahead[0])


def of_noise_alone(
    structure: Structure, problem: Problem, at: Unknowns, noise: Float[np.ndarray, "R E T ny"]
) -> Innovations:
    """The innovations [R, E, T, ny] that `noise`, in units of each channel's, would leave of a complete model."""
    _, own = _linearised(structure, problem, at)
    return Innovations(*_recursive(-noise, own, problem))


def _linearised(structure: Structure, problem: Problem, at: Unknowns) -> tuple[np.ndarray, np.ndarray]:
    """Residuals [E, T, ny] and their derivatives by the windows' own initial states [E, T, ny, s]."""
    residual, jacobian = (np.asarray(x) for x in sensitivities_at(structure, problem, at))
    return residual, jacobian[..., len(structure.names) :] * np.asarray(problem.state_free, float)[:, None, None, :]


def _recursive(residual: np.ndarray, own: np.ndarray, problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """White and plain innovations [R, E, T, ny] of residuals [R, E, T, ny]."""
    there = np.asarray(problem.mask)
    E, T, ny, s = own.shape
    stiff = np.asarray(problem.state_precision) * np.asarray(problem.state_scale) ** 2
    told = np.sum(own**2, axis=(1, 2))
    variance = 1.0 / np.maximum(stiff + _VAGUE * told, np.finfo(float).tiny)
    P = np.where(np.asarray(problem.state_free) & (told > 0), variance, 0.0)[:, :, None] * np.eye(s)
    off, found, ahead = (
        np.zeros((len(residual), E, s)),
        np.full(residual.shape, np.nan),
        np.full(residual.shape, np.nan),
    )
    for t in range(T):
        ahead[:, :, t] = residual[:, :, t] - np.einsum("eci,rei->rec", own[:, t], off)
        for c in range(ny):
            x, ok = own[:, t, c], there[:, t, c]
            if not ok.any():
                continue
            gain = np.einsum("eij,ej->ei", P, x) * ok[:, None]
            size = 1.0 + np.einsum("ei,ei->e", x, gain)
            error = residual[:, :, t, c] - np.einsum("ei,rei->re", x, off)
            found[:, :, t, c] = np.where(ok & (size < _TELLING), error / np.sqrt(size), np.nan)
            off = off + gain * (error / size)[:, :, None]
            P = P - gain[:, :, None] * gain[:, None, :] / size[:, None, None]
    return found, np.where(np.isfinite(found), ahead, np.nan)
