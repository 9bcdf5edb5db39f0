"""A fit as it is asked for: what the caller chose, and the problem in arrays that comes of it, before anything is
minimised."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import jax
import numpy as np

from ...logs import LogSet
from ...logs.windows import in_windows
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ..result import Fit
from .conclude import Covariance
from .losses import Loss, Squares
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns
from .setup import InitialStates, Starts, StartValues, build, every_start
from .solvers import Solver, minimise_compiled, minimise_each
from .window_start import started
from .windows import approached

_STEPS_OF_MANY = 60
"""Steps at most of each of many starts."""


@dataclass(frozen=True)
class Options:
    """What a caller chose for a fit; see `output_error`."""

    initial_states: InitialStates
    integrator: Integrator | None
    loss: Loss
    solver: Solver
    covariance: Covariance
    clock_offset: bool
    max_steps: int
    report: Callable[[str], None]
    far_starts: bool = True
    """Whether starts further off are tried where the first, and those at hand, lead to a poor minimum."""

    @property
    def squares(self) -> bool:
        """Whether the loss is that of least squares."""
        return isinstance(self.loss, Squares)

    def minimise(self, structure: Structure, problem: Problem, unknowns: Unknowns) -> Optimum:
        """The minimum that the solver finds from `unknowns`."""
        return minimise_compiled(structure, problem, unknowns, max_steps=self.max_steps, solver=self.solver)


class Posed(NamedTuple):
    """A fit of `robot` to `logs`, which are the `whole` ones or their windows of `window` seconds.

    `unknowns` is where the search begins. `values` are the start values by symbol, of many starts their medians; `start`
    is what the caller gave, or `values` where that were many.
    """

    robot: Robot
    whole: LogSet
    logs: LogSet
    window: float | None
    structure: Structure
    problem: Problem
    unknowns: Unknowns
    values: dict[str, float]
    start: StartValues


def posed(robot: Robot, whole: LogSet, options: Options, start: Starts, window: float | None) -> Posed:
    """The fit in arrays; of many starts, the one whose minimum is best. Call under float64.

    Raises `ParameterError` for unknown or no free parameters.
    """
    logs, initial = whole, options.initial_states
    if window is not None:
        logs, initial = in_windows(whole, window), "estimate"
    starts = every_start(robot, start)
    many = start is not None and not isinstance(start, Fit | Mapping)
    # The middle of the starts sets the magnitudes in which all of them move: one wild start must not.
    values = {name: float(np.median([own[name] for own in starts])) for name in starts[0]} if many else starts[0]
    structure, problem, unknowns = build(
        robot, logs, start=values, initial=initial, integrator=options.integrator, clock_offset=options.clock_offset
    )
    if window is not None:
        problem = started(whole, structure, problem)
        if not many:
            unknowns = approached(structure, problem, unknowns)
    if not options.squares:
        problem = replace(problem, weight=np.ones(problem.mask.shape))
    if many:
        unknowns = _best_of(starts, structure, problem, unknowns, options.solver)
        options.report(f"best of {len(starts)} starts chosen")
    one = start if start is None or isinstance(start, Fit | Mapping) else values
    return Posed(robot, whole, logs, window, structure, problem, unknowns, values, one)


def _best_of(
    starts: list[dict[str, float]], structure: Structure, problem: Problem, unknowns: Unknowns, solver: Solver
) -> Unknowns:
    """The best of many starts, all minimised in one compiled batch."""
    coordinates = [problem.bounds.coordinates(np.asarray([own[n] for n in structure.names])) for own in starts]
    states = np.broadcast_to(np.asarray(unknowns.states), (len(starts), *unknowns.states.shape))
    everywhere = Unknowns(np.stack(coordinates), np.asarray(states))
    optima = minimise_each(structure, problem, everywhere, max_steps=_STEPS_OF_MANY, solver=solver)
    costs = np.nan_to_num(np.asarray(optima.cost), nan=np.inf)
    best = int(np.argmin(costs))
    return jax.tree.map(lambda x: np.asarray(np.asarray(x)[best]), optima.unknowns)
