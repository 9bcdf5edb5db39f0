"""Many starts in one batch, and the basins in which they end.

Output error can have several minima. Starts that are each parameter's value times or divided by up to a factor are
minimised side by side; those that end at the same cost are one basin. Each channel is weighted with the noise that the
minimum itself leaves, as in any output-error fit, so that costs are compared by their likelihood: half of N log(rms) more
for every channel of N samples. Weights that are the same for all would choose another minimum than the fit's where no model
comes down to the noise.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..._float64 import in_float64
from ..._origin import Origin, with_origin
from ..._table import html_table, text_table
from ...logs import LogError, LogSet
from ...parameters import ParameterError
from ...robots.given import check_choice, given_logs
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ..linear.integral_least_squares import linear_estimate
from ..result import Fit
from .direct import linearised_now
from .fleet import Fitted, fit_lanes
from .magnitudes import magnitudes
from .output_error import output_error
from .problem import Problem, Unknowns
from .setup import InitialStates, build, start_values

_SAME = 0.5
"""Difference of costs (half chi-squared) within which two starts ended in the same basin."""
_STEPS = 200


@dataclass(frozen=True)
class Basin:
    """Starts that ended at one cost: how many, its rise over the best (-log likelihood, which is half chi-squared where the
    noise is the same), and the parameters there."""

    starts: int
    rise: float
    parameters: dict[str, float]


@dataclass(frozen=True)
class MultiStart:
    """`fit` from the best of all starts; `basins`, best first; `lost`: starts from which nothing finite was reached."""

    fit: Fit
    basins: tuple[Basin, ...]
    lost: int
    origin: Origin | None = field(default=None, kw_only=True, compare=False, repr=False)

    @property
    def share(self) -> float:
        """Share of the starts that reached the best basin."""
        total = sum(basin.starts for basin in self.basins) + self.lost
        return self.basins[0].starts / total

    @property
    def sentence(self) -> str:
        """How many of the starts agree."""
        total = sum(basin.starts for basin in self.basins) + self.lost
        return (
            f"{self.basins[0].starts} of {total} starts reached the best optimum; {self.lost} reached nothing finite."
        )

    def to_pandas(self) -> pd.DataFrame:
        """A row for every basin, best first: `starts`, `rise` of the cost over the best, and each parameter there."""
        return pd.DataFrame([{"starts": b.starts, "rise": b.rise, **b.parameters} for b in self.basins])

    def _rows(self) -> list[tuple[str, ...]]:
        names = list(self.basins[0].parameters)
        rows = [("starts", "rise of cost", *names)]
        for basin in self.basins:
            rows.append((f"{basin.starts}", f"{basin.rise:.4g}", *(f"{basin.parameters[name]:.4g}" for name in names)))
        return rows

    def __repr__(self) -> str:
        return text_table(self._rows(), [self.sentence])

    def _repr_html_(self) -> str:
        return html_table(self._rows(), [self.sentence])


def _unlikelihood(problem: Problem, fitted: Fitted) -> NDArray[np.float64]:
    """-log likelihood [N] of minima, each channel's noise the one that it leaves, and what the priors say."""
    counts = np.asarray(problem.mask).sum(axis=(0, 1))
    squares = np.asarray(fitted.optimum.triangle.squares).sum(axis=1)
    least = np.finfo(float).tiny  # logs without noise, followed to the last digit
    with np.errstate(over="ignore", invalid="ignore"):
        level = np.asarray(fitted.sigma) * np.sqrt(squares / np.maximum(counts, 1))
        pulls = np.asarray(fitted.optimum.cost) - 0.5 * squares.sum(axis=1)
        return np.sum(np.where(counts > 0, counts * np.log(np.maximum(level, least)), 0.0), axis=1) + pulls


@with_origin
@in_float64
def multi_start(
    robot: Robot,
    logs: LogSet,
    *,
    starts: int = 32,
    factor: float = 10.0,
    seed: int = 0,
    initial_states: InitialStates = "auto",
    integrator: Integrator | None = None,
    report: Callable[[str], None] = lambda message: None,
) -> MultiStart:
    """Output error from `starts` starts, whose parameters are the robot's times or divided by up to `factor`.

    The first start is the integral least-squares estimate where there is one. Parameters whose value is 0 start within
    `factor` of what would matter in these logs, either sign. Raises `ParameterError` if no parameter is free or no start
    leads anywhere.
    """
    logs = given_logs(robot, logs)
    check_choice("initial_states", initial_states, InitialStates)
    values = start_values(robot, None)
    structure, problem, unknowns = build(robot, logs, start=values, initial=initial_states, integrator=integrator)
    rng = np.random.default_rng(seed)
    names = structure.names
    centre = np.array([values[name] for name in names])
    scale = magnitudes(problem, linearised_now(structure, problem, unknowns), centre)
    factors = np.exp(rng.uniform(-1, 1, (starts, len(names))) * np.log(factor))
    theta = np.where(centre != 0, centre * factors, scale * factors * rng.choice([-1.0, 1.0], factors.shape))
    try:
        linear = linear_estimate(robot, logs)[0].robot.parameters.numbers
        theta[0] = [linear[name] for name in names]
    except (ParameterError, LogError):
        pass
    theta = np.clip(theta, np.asarray(problem.bounds.lower), np.asarray(problem.bounds.upper))
    states = np.asarray(unknowns.states)
    lanes = Unknowns(problem.bounds.coordinates(np.asarray(theta)), np.broadcast_to(states, (starts, *states.shape)))
    report(f"{starts} starts side by side")
    own = {"held": np.broadcast_to(np.asarray(problem.held), theta.shape)}
    fitted = fit_lanes(structure, problem, own, lanes, max_steps=_STEPS, lanes=min(starts, 32))
    found, costs = fitted.optimum, _unlikelihood(problem, fitted)
    sound = np.isfinite(np.asarray(found.triangle.squares)).all(axis=(1, 2)) & np.isfinite(costs)
    if not sound.any():
        raise ParameterError(
            f"the simulation of {robot.name!r} diverges at every start; check the logs' units and signs"
        )
    ends = np.asarray(problem.bounds.physical(found.unknowns.z))
    order = [int(k) for k in np.argsort(np.where(sound, costs, np.inf)) if sound[k]]
    groups: list[list[int]] = []
    for k in order:
        if groups and costs[k] - costs[groups[-1][0]] < _SAME:
            groups[-1].append(k)
        else:
            groups.append([k])
    best = costs[order[0]]
    basins = tuple(
        Basin(len(group), float(costs[group[0]] - best), dict(zip(names, ends[group[0]].tolist(), strict=True)))
        for group in groups
    )
    report(f"{len(groups)} basins; going on from the best")
    fit = output_error(
        robot, logs, start=basins[0].parameters, initial_states=initial_states, integrator=integrator, windows=None,
        report=report,
    )  # fmt: skip
    return MultiStart(fit, basins, int(starts - sound.sum()))
