"""Coloured noise of which a controller makes commands: generalised least squares in the place of output error.

In a closed loop the noise of the sensors is in the commands, too. White noise is in those to come alone, and does no harm.
Coloured noise still lasts when these act: the residual of the right model is then related to what moves the robot, as if
something were missing, and output error strays by several of its standard errors. Its innovations are not: so the
estimates are those of the whitened residual (a prediction error method with a model of the noise, in closed loop as right as
in an open one: Ljung, System Identification, 1999, section 13.4; Aitken 1935).
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ..noise_colour import Colour, colour_of, made_white
from .evaluation import sensitivities_at
from .feedback import closed
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
    kept = [(log, own) for log, own in zip(logs, left, strict=True) if np.isfinite(own).any()]
    return closed([log for log, _ in kept], [own for _, own in kept], logs.channels.inputs)


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
    at, best, found = unknowns, np.inf, unknowns
    for _ in range(_STEPS):
        if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
            break
        theta = np.asarray(parameters_at(problem, at.z))
        rows = _Rows.of(
            problem, theta, np.asarray(at.states), *(made_white(colours, x, mask) for x in (residual, jacobian))
        )
        if rows.squares > best:
            break
        done, best, found = rows.squares > best - _ENOUGH, rows.squares, at
        if done:
            break
        step, states = rows.step()
        at = Unknowns(np.asarray(problem.bounds.coordinates(theta + step)), np.asarray(at.states) + states)
        residual, jacobian = (np.asarray(x) for x in sensitivities_at(structure, problem, at))
    return InALoop(found, colours)


class _Rows(NamedTuple):
    """Residuals [R] and their derivatives by the parameters [R, n] and by a log's own initial states [R, s] of every log, its
    states' priors last; those of the parameters' priors [n]; which parameters are `free` [n], and states [E, s]."""

    logs: list[tuple[Array, Array, Array]]
    prior: Array
    stiffness: Array
    free: NDArray[np.bool_]
    state_free: NDArray[np.bool_]

    @classmethod
    def of(cls, problem: Problem, theta: Array, states: Array, residual: Array, jacobian: Array) -> Self:
        """The rows at parameters `theta` [n] and `states` [E, s], from whitened residuals and sensitivities."""
        n, s = len(theta), states.shape[1]
        state_free, free = np.asarray(problem.state_free), np.asarray(problem.free)
        root = np.sqrt(np.asarray(problem.state_precision)) * np.asarray(problem.state_scale)
        logs = []
        for e, own in enumerate(residual):
            J, pull = jacobian[e].reshape(own.size, -1), np.where(state_free[e], root, 1.0)
            r = np.concatenate([own.ravel(), np.where(state_free[e], pull * states[e], 0.0)])
            logs.append((r, np.concatenate([J[:, :n], np.zeros((s, n))]), np.concatenate([J[:, n:], np.diag(pull)])))
        stiffness = np.where(free, np.sqrt(np.asarray(problem.prior_precision)), 0.0)
        return cls(logs, stiffness * (theta - np.asarray(problem.prior_mean)), stiffness, free, state_free)

    @property
    def squares(self) -> float:
        """The sum of squares, priors included."""
        return float(sum(np.sum(r**2) for r, _, _ in self.logs) + np.sum(self.prior**2))

    def step(self) -> tuple[Array, Array]:
        """The step of least squares of the parameters [n] and of every log's initial states [E, s]."""
        columns, left, onto = [np.diag(self.stiffness)[:, self.free]], [self.prior], []
        for r, J, own in self.logs:
            answer = np.linalg.lstsq(own.T @ own, own.T, rcond=None)[0]
            columns.append(J[:, self.free] - own @ (answer @ J[:, self.free]))
            left.append(r - own @ (answer @ r))
            onto.append(answer)
        matrix = np.concatenate(columns)
        size = np.linalg.norm(matrix, axis=0)
        size = np.where(size > 0, size, np.inf)
        step = np.zeros(len(self.free))
        step[self.free] = -np.linalg.lstsq(matrix / size, np.concatenate(left), rcond=1e-10)[0] / size
        states = np.stack([-answer @ (r + J @ step) for answer, (r, J, _) in zip(onto, self.logs, strict=True)])
        return step, np.where(self.state_free, states, 0.0)
