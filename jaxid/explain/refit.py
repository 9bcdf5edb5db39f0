"""Refit of a model with one more effect: all free parameters and the effect's own, weighed by the noise of the data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from .._float64 import in_float64
from ..estimate.globalise import shortened
from ..estimate.levenberg_marquardt import compile_ahead, minimise_compiled
from ..estimate.output_error import output_error
from ..estimate.problem import Problem, Structure, Unknowns, parameters_at
from ..estimate.result import Fit
from ..estimate.setup import build
from ..logs import LogSet
from ..robots.robot import Robot
from ..simulate.driven import driven_angles
from .heldout import HeldOut, held_out

_STEPS = 25
_DRIVEN_STEPS, _HORIZON_STEPS = 10, 5
_SHORTEST, _LONGER, _LEAST_LONGER = 1.5, 1.35, 1.02
"""First horizon [s], by how much it grows, and by how much at least before growing is given up."""
_LOST, _HOPELESS = 1.5, 5.0
"""Growth of the cost per sample at which a longer horizon has lost the way, and cost at which there is none."""
_HORIZONS = 16
"""Most horizons that are tried."""
_WEAKER = (1.0, 0.1, 0.01)
"""Shares of an effect's first guess that are tried one after another while the simulation diverges."""
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
        total = self.squares + self.free * float(np.log(self.check.samples)) + self.check.squares
        return total if np.isfinite(total) else np.inf


def _states(fit_states: Mapping[str, Mapping[str, float]], logs: LogSet, structure: Any, problem: Any):
    """Start of the initial states: those of an earlier fit where they are free."""
    own = np.zeros((len(logs), len(structure.state_names)))
    for e, log in enumerate(logs):
        for i, name in enumerate(structure.state_names):
            known = fit_states.get(log.name, {}).get(name)
            if known is not None:
                own[e, i] = (known - float(problem.start[name][e])) / float(problem.state_scale[i])
    return jnp.asarray(own)


def _as_driven(problem: Problem, robot: Robot, logs: LogSet) -> Problem | None:
    """The problem with the wheels' angles as driven, if the effect added last repeats with them; None otherwise.

    While such an effect is not yet right, a simulated angle soon leaves the true one, and from there nothing leads back.
    """
    repeats = bool(robot.effects) and "wheel_angles" in robot.effects[-1].needs
    driven = dict(driven_angles(robot, logs)) if repeats else {}
    if not driven:
        return None
    shown = jnp.array([name not in driven for name in logs.channels.measured])
    return replace(problem, driven=driven, mask=problem.mask & shown)


def _over_longer_and_longer(structure: Structure, problem: Problem, unknowns: Unknowns) -> Unknowns:
    """Minimise over the logs' first seconds, and over more and more of them: by less where the way was lost."""
    longest = float(jnp.max(jnp.sum(problem.dt, axis=1)))
    seconds, longer, before = _SHORTEST, _LONGER, np.inf
    for _ in range(_HORIZONS):
        if seconds >= longest or longer <= _LEAST_LONGER:
            break
        current = shortened(problem, seconds)
        optimum = minimise_compiled(structure, current, unknowns, max_steps=_HORIZON_STEPS)
        cost = float(optimum.cost) / float(jnp.sum(current.mask))
        if before == np.inf and not cost < _HOPELESS:
            break
        if np.isfinite(cost) and cost < _LOST * before:
            unknowns, before = optimum.unknowns, max(cost, 0.5)
            seconds, longer = seconds * longer, min(longer**1.5, _LONGER)
        else:
            seconds, longer = seconds / longer * longer**0.5, longer**0.5
    return unknowns


@in_float64
def compile_refits(robots: Sequence[Robot], logs: LogSet) -> None:
    """Compile the refits of several robots at once; `refit` finds them compiled."""
    tasks = []
    for robot in robots:
        structure, problem, unknowns = build(robot, logs, start={})
        tasks.append((structure, problem, unknowns))
        as_driven = _as_driven(problem, robot, logs)
        if as_driven is not None:
            tasks.append((structure, as_driven, unknowns))
    compile_ahead(tasks)


@in_float64
def refit(
    robot: Robot,
    starts: Sequence[Mapping[str, float]],
    logs: LogSet,
    check: LogSet,
    noise: Mapping[str, float],
    initial_states: Mapping[str, Mapping[str, float]],
    max_steps: int = _STEPS,
    rival: float = np.inf,
) -> Trial:
    """Fit `robot` (with its effects) to `logs` from each of `starts`, and predict `check` with the best.

    `initial_states` are those of the model without the effect, where they had to be estimated. `rival` is the lowest
    chi-squared of other candidates: an effect that repeats with the wheels' angles and comes not below it although it is
    told the angles is not followed up.
    """
    sigma = np.array([noise.get(c, np.nan) for c in logs.channels.measured])
    known = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    structure, problem, _ = build(robot, logs, start={**known, **starts[0]})
    problem = replace(problem, sigma=jnp.where(jnp.isfinite(sigma), sigma, problem.sigma))
    as_driven = _as_driven(problem, robot, logs) if len(starts) > 1 else None
    states = _states(initial_states, logs, structure, problem)
    own = [name for name in structure.names if robot.effects and name.startswith(f"{robot.effects[-1].id}.")]
    tried: list[tuple[float, Unknowns]] = []
    for start in starts:
        for weaker in _WEAKER if len(starts) > 1 else (1.0,):
            values = {**known, **start}
            values |= {name: weaker * values[name] for name in own}
            z = problem.bounds.coordinates(jnp.array([values[name] for name in structure.names]))
            steps = max_steps if len(starts) == 1 else _FIRST_STEPS if as_driven is None else _DRIVEN_STEPS
            optimum = minimise_compiled(structure, as_driven or problem, Unknowns(z, states), max_steps=steps)
            tried.append((float(jnp.nan_to_num(optimum.cost, nan=jnp.inf)), optimum.unknowns))
            if np.isfinite(tried[-1][0]) and not bool(optimum.diverged):
                break
    cost, unknowns = min(tried, key=lambda entry: entry[0])
    if as_driven is not None and 2 * cost < rival:
        unknowns = _over_longer_and_longer(structure, problem, unknowns)
    if len(starts) > 1:
        optimum = minimise_compiled(structure, problem, unknowns, max_steps=max_steps)
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
