"""Coloured noise of which a controller makes commands: generalised least squares in the place of output error.

In a closed loop the noise of the sensors is in the commands, too. White noise is in those to come alone, and does no harm.
Coloured noise still lasts when these act: the residual of the right model is then related to what moves the robot, as if
something were missing, and output error strays by several of its standard errors. Its innovations are not: so the
estimates are those of the whitened residual (a prediction error method with a model of the noise, in closed loop as right as
in an open one: Ljung, System Identification, 1999, section 13.4; Aitken 1935).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ..noise_colour import Colour, colour_of, made_white
from .evaluation import sensitivities_at
from .feedback import feedback
from .problem import Problem, Structure, Unknowns, parameters_at

Array = NDArray[np.float64]
_STEPS = 4
_ENOUGH = 0.01
"""Drop of the sum of squares below which a step is the last."""


class InALoop(NamedTuple):
    """Estimates by generalised least squares, and the `colours` of the weighted residual's channels, in their order."""

    unknowns: Unknowns
    colours: tuple[Colour, ...]


def _closed(logs: LogSet, residual: Array, mask: NDArray[np.bool_]) -> bool:
    """Whether any input follows what the model leaves of the outputs, beyond doubt."""
    left = [np.where(mask[e, : len(log)], residual[e, : len(log)], np.nan) for e, log in enumerate(logs)]
    kept = [e for e, own in enumerate(left) if np.isfinite(own).any()]
    own = [left[e] for e in kept]
    every = list(logs)
    return any(feedback([every[e].input(name) for e in kept], own, name).closed for name in logs.channels.inputs)


def in_a_loop(structure: Structure, problem: Problem, unknowns: Unknowns, logs: LogSet) -> InALoop | None:
    """The estimates for noise that a controller feeds back, from the optimum `unknowns`; None where no loop is closed, or the
    noise is white. Call under float64."""
    if structure.robot.controlled or problem.weight is not None:
        return None
    mask = np.asarray(problem.mask)
    residual, jacobian = (np.asarray(x) for x in sensitivities_at(structure, problem, unknowns))
    if not (np.isfinite(residual).all() and _closed(logs, residual, mask)):
        return None
    colours = tuple(
        colour_of([r[there] for r, there in zip(residual[..., c], mask[..., c], strict=True)])
        for c in range(residual.shape[-1])
    )
    if not any(colour.order for colour in colours):
        return None
    n, at, best = len(structure.names), unknowns, np.inf
    found = unknowns
    for _ in range(_STEPS):
        if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
            break
        r, J = made_white(colours, residual, mask), made_white(colours, jacobian, mask)
        squares = float(np.sum(r**2))
        if squares > best:
            break
        done, best, found = squares > best - _ENOUGH, squares, at
        if done:
            break
        step, states = _step(problem, n, r, J)
        theta = np.asarray(parameters_at(problem, at.z)) + step
        at = Unknowns(np.asarray(problem.bounds.coordinates(theta)), np.asarray(at.states) + states)
        residual, jacobian = (np.asarray(x) for x in sensitivities_at(structure, problem, at))
    return InALoop(found, colours)


def _step(problem: Problem, n: int, residual: Array, jacobian: Array) -> tuple[Array, Array]:
    """The step of least squares of the parameters [n] and of every log's initial states [E, s]."""
    E = len(residual)
    free, stiff = np.asarray(problem.free), np.asarray(problem.state_precision) * np.asarray(problem.state_scale) ** 2
    rows, left, answers = [], [], []
    for e in range(E):
        J, r = jacobian[e].reshape(-1, jacobian.shape[-1]), residual[e].ravel()
        own = J[:, n:]
        local = own.T @ own + np.diag(np.where(np.asarray(problem.state_free[e]), stiff, 1.0))
        onto = np.linalg.lstsq(local, own.T, rcond=None)[0] if own.shape[1] else np.zeros((0, len(r)))
        rows.append(J[:, :n][:, free] - own @ (onto @ J[:, :n][:, free]))
        left.append(r - own @ (onto @ r))
        answers.append((onto, J[:, :n], r))
    columns = np.concatenate(rows)
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0, size, np.inf)
    step = np.zeros(n)
    step[free] = -np.linalg.lstsq(columns / size, np.concatenate(left), rcond=1e-10)[0] / size
    states = np.stack([-onto @ (r + J @ step) for onto, J, r in answers])
    return step, np.where(np.asarray(problem.state_free), states, 0.0)
