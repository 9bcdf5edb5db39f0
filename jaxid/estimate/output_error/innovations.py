"""What a window's residual holds beyond what its own initial state has taken: one-step innovations, white if the noise is.

An initial state that is estimated from a window of fifty samples takes two or three of them with it, and what it leaves is not
white, however white the noise: neighbours are related by minus a few percent, which over thousands of samples no test misses.
Recursive residuals undo that (Brown, Durbin & Evans, J. R. Statist. Soc. B 37, 1975): each sample against what those before it
say of the initial state, in units of how well they say it. Of white noise they are white and of its own size.
"""

import numpy as np
from jaxtyping import Float

from .evaluation import sensitivities_at
from .problem import Problem, Structure, Unknowns

_VAGUE = 1e-6
"""Information on an initial state before its window, as a share of what the window gives: none to speak of."""
_TELLING = 10.0
"""Variance of an innovation, in units of the noise's, from which the sample tells the initial state and not the noise."""


def innovations(structure: Structure, problem: Problem, at: Unknowns) -> Float[np.ndarray, "E T ny"]:
    """Innovations (simulated minus measured) of every window in units of the noise; NaN where nothing was measured and for the
    first samples, which only tell the initial state. Call under float64."""
    residual, jacobian = (np.asarray(x) for x in sensitivities_at(structure, problem, at))
    own = jacobian[..., len(structure.names) :] * np.asarray(problem.state_free, float)[:, None, None, :]
    there = np.asarray(problem.mask)
    E, T, ny, s = own.shape
    stiff = np.asarray(problem.state_precision) * np.asarray(problem.state_scale) ** 2
    told = np.sum(own**2, axis=(1, 2))
    variance = 1.0 / np.maximum(stiff + _VAGUE * told, np.finfo(float).tiny)
    P = np.where(np.asarray(problem.state_free) & (told > 0), variance, 0.0)[:, :, None] * np.eye(s)
    off, found = np.zeros((E, s)), np.full((E, T, ny), np.nan)
    for t in range(T):
        for c in range(ny):
            x, ok = own[:, t, c], there[:, t, c]
            if not ok.any():
                continue
            gain = np.einsum("eij,ej->ei", P, x) * ok[:, None]
            size = 1.0 + np.einsum("ei,ei->e", x, gain)
            error = residual[:, t, c] - np.einsum("ei,ei->e", x, off)
            found[:, t, c] = np.where(ok & (size < _TELLING), error / np.sqrt(size), np.nan)
            off = off + gain * (error / size)[:, None]
            P = P - gain[:, :, None] * gain[:, None, :] / size[:, None, None]
    return found
