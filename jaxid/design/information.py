"""What experiments would tell about the parameters: their Fisher information, all candidates as lanes of one program.

The information of a run is the sum over samples and channels of (dy/dtheta)(dy/dtheta)ᵀ / sigma², from forward-mode
sensitivities of the simulation; what was known before adds to it. Parameters count in units of their magnitude.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from numpy.typing import NDArray

from .._arrays import array
from .._compile import compiled
from .._float64 import in_float64
from ..estimate.output_error.direct import linearised_now
from ..estimate.output_error.setup import build, typical_values
from ..estimate.result import Fit
from ..logs import LogSet
from ..robots.robot import Robot
from ..simulation.rollout import Integrator, rollout

_VAGUE = 1e-4
"""Information that everyone has: a parameter is known to within a hundred times its magnitude."""
LANES = 32
"""Candidates tried at a time."""


class Trials(NamedTuple):
    """What N runs would do.

    `information` [N, n, n] about the parameters in units of their magnitude (zero where a simulation diverges), `outputs`
    [N, T, ny] of all measured channels, and `slope` [N, T, ny]: how the outputs change along the laboratory's `way`.
    """

    information: NDArray[np.float64]
    outputs: NDArray[np.float64]
    slope: NDArray[np.float64]


@partial(compiled, static_argnames=("robot", "names", "integrator"))
def _trials(
    robot: Robot,
    names: tuple[str, ...],
    integrator: Integrator,
    numbers: dict[str, Float[Array, ""]],
    magnitude: Float[Array, " n"],
    way: Float[Array, " n"],
    weight: Float[Array, " ny"],
    dt: Float[Array, " T"],
    thetas: Float[Array, "N n"],
    inputs: Float[Array, "N T nu"],
):
    start = {name: jnp.asarray(value, float) for name, value in robot.initial_state().items()}

    def one(theta, u):
        def outputs(x):
            return rollout(robot, {**numbers, **dict(zip(names, x, strict=True))}, start, u, dt, integrator)

        y, tangents = jax.vmap(lambda t: jax.jvp(outputs, (theta,), (t,)), out_axes=(None, -1))(jnp.diag(magnitude))
        # A channel without noise level is not measured, and may be one that has no finite sensitivity.
        slopes = jnp.where(weight[:, None] > 0, tangents * weight[:, None], 0.0).reshape(-1, len(names))
        information = slopes.T @ slopes
        return jnp.where(jnp.all(jnp.isfinite(information)), information, 0.0), y, tangents @ way

    return jax.vmap(one)(thetas, inputs)


class Laboratory:
    """Tries inputs on a robot by simulation from rest; `noise` is the standard deviation of each channel measured.

    There are three sets of parameters, `thetas` [3, n]: the robot's own, and two on opposite sides of it that differ by
    `doubt`, a share of its magnitude, in every parameter, up or down: that is `way` [n], in units of the magnitudes. `report`
    is told how many of many inputs have been simulated.
    """

    def __init__(
        self,
        robot: Robot,
        noise: Mapping[str, float],
        samples: int,
        interval: float,
        doubt: float,
        seed: int,
        report: Callable[[str], None] = lambda message: None,
    ):
        self.report = report
        self.robot, self.interval = robot, interval
        self.names = robot.parameters.free_names
        self.magnitude = typical_values(robot, {}, self.names)
        self.time = np.asarray(np.arange(samples) * interval, np.float64)
        self.weight = 1.0 / np.array([noise.get(channel, np.inf) for channel in robot.channels.measured])
        self._integrator = Integrator.suited(robot, interval)
        table = [robot.parameters[name] for name in self.names]
        own, lower, upper = (np.array([getattr(p, f) for p in table]) for f in ("value", "lower", "upper"))
        # No set leaves the bounds, and the two stay opposite.
        reach = np.minimum(doubt * self.magnitude, np.minimum(own - lower, upper - own))
        self.way = reach / self.magnitude * np.random.default_rng([seed, 1]).choice([-1.0, 1.0], len(own))
        self.thetas = own + np.array([[0.0], [1.0], [-1.0]]) * self.way * self.magnitude

    @in_float64
    def run(self, inputs: NDArray[np.float64], which: int = 0) -> Trials:
        """Try inputs [N, T, nu] with one set of parameters, `LANES` at a time: one compiled program does them all."""
        numbers = {name: jnp.asarray(value, float) for name, value in self.robot.parameters.numbers.items()}
        given = (self.magnitude, self.way, self.weight, np.full(len(self.time), self.interval))
        thetas = jnp.asarray(np.tile(self.thetas[which], (LANES, 1)))
        found = []
        for first in range(0, len(inputs), LANES):
            part = inputs[first : first + LANES]
            full = jnp.asarray(np.concatenate([part, np.zeros((LANES - len(part), *part.shape[1:]))]))
            trials = _trials(
                self.robot.structure, self.names, self._integrator, numbers, *map(jnp.asarray, given), thetas, full
            )
            found.append([np.asarray(x)[: len(part)] for x in trials])
            if len(inputs) > 2 * LANES:
                self.report(f"{first + len(part)} of {len(inputs)} inputs simulated")
        return Trials(*(np.concatenate(parts) for parts in zip(*found, strict=True)))

    def bend(self, own: Trials, up: Trials, down: Trials) -> NDArray[np.float64]:
        """How far outputs for the other two sets lie from where the sensitivities of the own one put them, in units of the
        distance from its outputs [N]; the larger of the two."""
        measured = self.weight > 0
        expected = own.slope[..., measured] * self.weight[measured]
        length = np.sqrt(np.sum(expected**2, axis=(1, 2)))
        found = np.zeros(len(length))
        for trials, sign in ((up, 1.0), (down, -1.0)):
            away = (trials.outputs - own.outputs)[..., measured] * self.weight[measured] - sign * expected
            found = np.maximum(found, np.sqrt(np.sum(away**2, axis=(1, 2))) / np.maximum(length, 1e-300))
        return np.where(length > 0, found, np.inf)


def criterion(information: NDArray[np.float64]) -> NDArray[np.float64]:
    """log det of information matrices [..., n, n]: the D-criterion. Half of it over n is the mean log of 1 / std error
    along the principal directions."""
    vague = _VAGUE * np.eye(information.shape[-1])
    return np.linalg.slogdet(information + vague)[1]


def std_errors(information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cramér-Rao standard errors [n] in units of the magnitudes."""
    vague = _VAGUE * np.eye(len(information))
    return np.sqrt(np.diag(np.linalg.inv(information + vague)))


@in_float64
def known(
    robot: Robot, already: Fit | LogSet | None, noise: Mapping[str, float], magnitude: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Information [n, n] about the free parameters, in units of `magnitude`, from a fit, from logs, or from priors."""
    names = robot.parameters.free_names
    if isinstance(already, LogSet):
        structure, problem, unknowns = build(robot, already, start={})
        sigma = [noise.get(name, float(problem.sigma[i])) for i, name in enumerate(already.channels.measured)]
        triangle = linearised_now(structure, replace(problem, sigma=array(sigma)), unknowns)
        jacobian = np.asarray(triangle.shared) / np.asarray(problem.bounds.slope(unknowns.z)) * magnitude
        return jacobian.T @ jacobian
    if already is None:
        priors = [robot.parameters[name].prior for name in names]
        return np.diag(
            [0.0 if prior is None else (m / prior[1]) ** 2 for prior, m in zip(priors, magnitude, strict=True)]
        )
    found = np.zeros((len(names), len(names)))
    shared = [n for n in names if n in already.free_names]
    rows = [already.free_names.index(n) for n in shared]
    covariance = already.covariance[np.ix_(rows, rows)]
    sure = np.flatnonzero(np.isfinite(np.diag(covariance)) & (np.diag(covariance) > 0))
    place = [names.index(shared[i]) for i in sure]
    scale = magnitude[place]
    # The pseudo-inverse: directions that the fit left open have no variance in its covariance, and no information.
    found[np.ix_(place, place)] = np.linalg.pinv(
        covariance[np.ix_(sure, sure)] / np.outer(scale, scale), hermitian=True
    )
    return found
