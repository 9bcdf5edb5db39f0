"""Refit of a model with one more effect: all free parameters and the effect's own, weighed by the noise of the data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._float64 import in_float64
from ..estimate.levenberg_marquardt import Optimum, compile_ahead, minimise_compiled
from ..estimate.output_error import output_error
from ..estimate.problem import Unknowns, parameters_at
from ..estimate.result import Fit
from ..estimate.setup import build
from ..logs import LogSet
from ..robots.robot import Robot
from .heldout import HeldOut, held_out

_STEPS = 25
_FIRST_STEPS = 2  # from each of several starts, of which the best goes on
FEW_STEPS = 8
"""Enough to see whether a candidate is in the running."""


@dataclass(frozen=True)
class Trial:
    """A model refitted with its effects. `id` is the effect that the trial is about, `squares` chi-squared on the logs
    it was fitted to."""

    id: str
    robot: Robot
    squares: float
    free: int
    check: HeldOut
    initial_states: dict[str, dict[str, float]]

    @property
    def score(self) -> float:
        """What candidates are ranked by (smaller is better).

        The Bayesian information criterion on the logs fitted, plus chi-squared on those held out.
        """
        return self.squares + self.free * float(np.log(self.check.samples)) + self.check.squares


def _states(fit_states: Mapping[str, Mapping[str, float]], logs: LogSet, structure: Any, problem: Any):
    """Start of the initial states: those of an earlier fit where they are free."""
    own = np.zeros((len(logs), len(structure.state_names)))
    for e, log in enumerate(logs):
        for i, name in enumerate(structure.state_names):
            known = fit_states.get(log.name, {}).get(name)
            if known is not None:
                own[e, i] = (known - float(problem.start[name][e])) / float(problem.state_scale[i])
    return jnp.asarray(own)


@in_float64
def compile_refits(robots: Sequence[Robot], logs: LogSet) -> None:
    """Compile the refits of several robots at once; `refit` finds them compiled."""
    compile_ahead([build(robot, logs, start={}) for robot in robots])


@in_float64
def refit(
    robot: Robot,
    starts: Sequence[Mapping[str, float]],
    logs: LogSet,
    check: LogSet,
    noise: Mapping[str, float],
    initial_states: Mapping[str, Mapping[str, float]],
    max_steps: int = _STEPS,
) -> Trial:
    """Fit `robot` (with its effects) to `logs` from each of `starts`, and predict `check` with the best.

    `initial_states` are those of the model without the effect, where they had to be estimated.
    """
    first = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    sigma = np.array([noise.get(c, np.nan) for c in logs.channels.measured])
    tried: list[tuple[float, Optimum, Any]] = []
    structure: Any = None
    for start in starts:
        structure, problem, unknowns = build(robot, logs, start={**first, **start})
        problem = replace(problem, sigma=jnp.where(jnp.isfinite(sigma), sigma, problem.sigma))
        unknowns = Unknowns(unknowns.z, _states(initial_states, logs, structure, problem))
        steps = max_steps if len(starts) == 1 else _FIRST_STEPS
        optimum = minimise_compiled(structure, problem, unknowns, max_steps=steps)
        cost = float(optimum.cost)
        tried.append((cost if np.isfinite(cost) else np.inf, optimum, problem))
    _, optimum, problem = min(tried, key=lambda entry: entry[0])
    if len(starts) > 1:
        optimum = minimise_compiled(structure, problem, optimum.unknowns, max_steps=max_steps)
    values = dict(zip(structure.names, np.asarray(parameters_at(problem, optimum.unknowns.z)).tolist(), strict=True))
    found = robot.with_values(**values)
    states = {name: np.array(problem.start[name]) for name in robot.states}
    for i, name in enumerate(structure.state_names):
        states[name] = states[name] + np.asarray(problem.state_scale[i] * optimum.unknowns.states[:, i])
    return Trial(
        id=robot.effects[-1].id if robot.effects else "",
        robot=found,
        squares=float(jnp.sum(optimum.triangle.squares)),
        free=len(structure.names),
        check=held_out(found, check, noise),
        initial_states={log.name: {n: float(v[e]) for n, v in states.items()} for e, log in enumerate(logs)},
    )


def continued(trial: Trial, logs: LogSet, check: LogSet, noise: Mapping[str, float]) -> Trial:
    """The same refit carried on from where it stopped."""
    start = {name: trial.robot.parameters[name].value for name in trial.robot.parameters.free_names}
    again = refit(trial.robot, [start], logs, check, noise, trial.initial_states)
    return again if again.score < trial.score else trial


def in_full(trial: Trial, logs: LogSet) -> Fit:
    """The output-error fit of a trial's model, with its uncertainty."""
    start = {name: trial.robot.parameters[name].value for name in trial.robot.parameters.free_names}
    return output_error(trial.robot, logs, start=start, max_steps=60)
