r"""What the sensors' noise does to integral least squares: how far it moves the estimate, and how its residual looks.

Measured speeds stand in the regressors (errors in variables), and which intervals are used depends on them. The estimate's
own motion is simulated, noise like the sensors' is added and, once more, its negative, and the equations are solved again:
what the two estimates have in common is the bias (with what interpolation between samples gets wrong), all that is linear
in the noise (the scatter) having gone: the parametric bootstrap with antithetic pairs (B. Efron and R. J. Tibshirani, An
Introduction to the Bootstrap, 1993, chapters 10 and 23). Half their difference is what noise alone leaves in the residual.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..._distributions import chi_squared_tail
from ...logs import Log, LogSet
from ...robots.robot import Robot
from ..noise_colour import Colour
from ..residual_tests import autocorrelation
from .window_equations import WindowEquations, equations_of_each

Array = NDArray[np.float64]
_PAIRS = 6
_ROWS = 750_000
"""Samples of noisy logs up to which they are worked on together."""
_LAGS = 8


def _noisy(logs: LogSet, noise: Mapping[str, Colour], seed: int) -> Iterator[list[Log]]:
    """The logs with noise added, and with its negative."""
    random, drawn = np.random.default_rng(seed), []
    for log in logs:
        drawn.append(np.stack([noise[name].drawn(random, len(log)) for name in log.channels.measured], axis=1))
    for sign in (1.0, -1.0):
        yield [replace(log, outputs=log.outputs + sign * own) for log, own in zip(logs, drawn, strict=True)]


def _solution(equations: WindowEquations, noise: Array, free: NDArray[np.bool_], prior: Array) -> Array:
    """Change [n] of the `free` parameters from the point that the residual `targets` are taken at."""
    weight = 1.0 / noise[equations.equation]
    F = np.concatenate([equations.regressors * weight[:, None], np.diag(prior)])[:, free]
    scale = np.linalg.norm(F, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    found = np.zeros(len(free))
    right = np.append(equations.targets * weight, np.zeros(len(prior)))
    found[free] = np.linalg.lstsq(F / scale, right, rcond=None)[0] / scale
    return found


def series(equations: WindowEquations, kind: int) -> list[Array]:
    """Residual of one speed's equations (the `targets` of equations about an estimate) by log [T], NaN where there is
    none."""
    values = np.full(len(equations.logs), np.nan)
    rows = equations.equation == kind
    values[equations.sample[rows]] = equations.targets[rows]
    return [values[equations.logs == number] for number in np.unique(equations.logs)]


@dataclass(frozen=True)
class NoiseResponse:
    """`bias` [n]: how far noise moves the estimate, known to `known` [n] (standard errors of the mean over the pairs).

    `residuals`: by pair and speed what noise leaves of each log [T].
    """

    bias: Array
    known: Array
    residuals: list[list[list[Array]]]


def noise_response(
    robot: Robot,
    motion: LogSet,
    window: int,
    free: NDArray[np.bool_],
    noise: Mapping[str, Colour],
    weights: Array,
) -> NoiseResponse | None:
    """What `noise` by channel does to the estimate of `robot`'s equations over stretches of `window` samples.

    `motion`: logs without noise, or with little. `free` [n]: parameters that were estimated, within their bounds;
    `weights` [speeds]: standard deviation of each speed's equations, as the estimate was weighted. None where the motion
    gives no equations.
    """
    table = [robot.parameters[name] for name in robot.parameters.free_names]
    theta = np.array([p.value for p in table])
    prior = np.array([1.0 / p.prior[1] if p.prior else 0.0 for p in table])

    def answer(found: WindowEquations) -> tuple[Array, list[list[Array]]] | None:
        """Change of the estimate, and what is left of each speed."""
        found = replace(found, targets=found.targets - found.regressors @ theta)
        fine = bool(np.isfinite(found.regressors).all() and np.isfinite(found.targets).all())
        if not (fine and len(found) > len(theta) and found.regressors[:, free].any(axis=0).all()):
            return None
        return _solution(found, weights, free, prior), [series(found, i) for i in range(len(weights))]

    moved, left = [], []
    together = max(1, min(_PAIRS, _ROWS // max(2 * sum(map(len, motion)), 1)))
    for first in range(0, _PAIRS, together):
        twins = (own for seed in range(first, min(first + together, _PAIRS)) for own in _noisy(motion, noise, seed))
        # No equations are kept.
        answers = [*map(answer, equations_of_each(robot, twins, "speed", window))]
        for one, other in zip(answers[::2], answers[1::2], strict=True):
            if one is None or other is None:
                continue
            moved.append((one[0] + other[0]) / 2.0)
            left.append(
                [[(a - b) / 2.0 for a, b in zip(*both, strict=True)] for both in zip(one[1], other[1], strict=True)]
            )
    if len(moved) < 2:
        return None
    return NoiseResponse(np.mean(moved, axis=0), np.std(moved, axis=0, ddof=1) / np.sqrt(len(moved)), left)


def whiteness_of(residual: list[Array], by_noise: list[list[Array]]) -> float:
    """p value of the residual [T] of each log being what white noise leaves there.

    Its autocorrelation is compared with that of what noise that is known to be white leaves: integrals over stretches
    correlate it by themselves.
    """
    lags = min(_LAGS, max(len(part) for part in residual) - 1)
    if sum(int(np.isfinite(part).sum()) for part in residual) < 3 * _LAGS:
        return 1.0
    rho, pairs = autocorrelation(residual, lags, mean=0.0)
    others = [autocorrelation(own, lags, mean=0.0)[0] for own in by_noise if any(np.isfinite(p).any() for p in own)]
    if not others:
        return 1.0
    expected = np.mean(others, axis=0)
    used = np.flatnonzero(pairs[1:] > 2 * _LAGS) + 1
    variance = (1.0 + 1.0 / len(others)) / pairs[used]
    return float(chi_squared_tail(np.sum((rho[used] - expected[used]) ** 2 / variance), len(used)))
