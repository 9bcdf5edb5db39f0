"""Refit of a model with one more effect: all free parameters and the effect's own, weighed by the noise of the data."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..._arrays import array
from ..._float64 import in_float64
from ...estimate.confidence.agreement import rms
from ...estimate.output_error.astray import past_the_astray
from ...estimate.output_error.conclude import Covariance, simulated_at
from ...estimate.output_error.from_optimum import initial_states_at
from ...estimate.output_error.in_turns import compile_ahead
from ...estimate.output_error.losses import Loss
from ...estimate.output_error.magnitudes import effects as changes_by
from ...estimate.output_error.optimum import Optimum
from ...estimate.output_error.output_error import refined
from ...estimate.output_error.problem import Problem, Structure, Unknowns
from ...estimate.output_error.setup import build
from ...estimate.output_error.solvers import minimise_compiled
from ...estimate.output_error.window_start import started
from ...estimate.output_error.windows import approached
from ...estimate.result import Fit
from ...logs import LogSet
from ...logs.windows import Windows
from ...parameters import ParameterError
from ...robots.effect import Effect
from ...robots.robot import Robot
from ...simulation.integrated_angles import integrated_angles
from ...simulation.simulate import integrator_for
from ..left.heldout import HeldOut, state_left
from .prescribed_angles import (
    PRESCRIBED_STEPS,
    by_name,
    chi_squared,
    fit_with_prescribed_angles,
    followed_up,
    predicted,
    states_from,
    with_prescribed_angles,
)
from .smoothed_angles import Angles
from .unseen_heights import RAN_AWAY, UNSEEN, held_level, ran_away, unseen_by

_STEPS = 25
_WEAKER = (1.0, 0.1, 0.01)
"""Shares of an effect's first guess that are tried one after another while the simulation diverges."""
_FIRST_STEPS = 2  # from each of several starts, of which the best goes on
_EXPLAINED = 1.1
"""Residual, in units of the noise, below which the middle log is explained: one that stands out may be due to the minimum."""
FEW_STEPS = 8
"""Enough to see whether a candidate is in the running."""
_FASTER, _FASTEST = 2.0, 128
"""A refit ran away where it leads to more integration steps a sample than this many times its own, and than this many: to
motions so fast that nothing in the logs tells how fast."""


@dataclass(eq=False)
class Prediction:
    """What a model leaves of logs that it was not fitted to: worked out once, when it is first asked for."""

    robot: Robot
    logs: LogSet
    noise: Mapping[str, float]
    left: HeldOut | None = None

    def __call__(self) -> HeldOut:
        if self.left is None:
            self.left = predicted(self.robot, self.logs, self.noise)
        return self.left


@dataclass(frozen=True)
class Known:
    """The same, where it is known."""

    left: HeldOut

    def __call__(self) -> HeldOut:
        return self.left


@dataclass(frozen=True)
class Trial:
    """A model refitted with its effects.

    `id` is the effect that the trial is about, `squares` chi-squared on the logs it was fitted to, `fitted` what it leaves of
    these. `predicts` works out what it leaves of the others, which of most trials nobody asks: where wheels' angles have to be
    prescribed, it takes as long as the refit. `angles` are those of the wheels in the fitted logs, if they have to be
    prescribed. `in_colour` is its score among others once coloured noise is whitened (`coloured.py`).
    """

    id: str
    robot: Robot
    squares: float
    free: int
    fitted: HeldOut
    predicts: Callable[[], HeldOut]
    initial_states: dict[str, dict[str, float]]
    angles: Angles | None = None
    in_colour: float | None = None

    @property
    def held_out(self) -> HeldOut:
        """What it leaves of the logs that it was not fitted to."""
        return self.predicts()

    def leaving(self, held_out: HeldOut) -> "Trial":
        """The same, of which is known what it leaves of the logs that it was not fitted to."""
        return replace(self, predicts=Known(held_out))

    @property
    def effect(self) -> Effect | None:
        """The effect that the trial is about, None where its model has none."""
        return next((effect for effect in self.robot.effects if effect.id == self.id), None)

    @property
    def law(self) -> str:
        """The law by which the effect that the trial is about was added."""
        return self.effect.law if self.effect is not None else ""

    @property
    def title(self) -> str:
        """The effect, and its law where it has several, as identifiers."""
        return f"{self.id} ({self.law})" if self.law else self.id

    @property
    def score(self) -> float:
        """What candidates are ranked by (smaller is better).

        The Bayesian information criterion on the logs fitted: those held out are there to judge, and choose nothing.
        """
        if self.in_colour is not None:
            return self.in_colour
        total = self.squares + self.free * float(np.log(max(self.fitted.samples, 1)))
        return total if np.isfinite(total) else np.inf


@in_float64
def compile_refits(robots: Sequence[Robot], logs: LogSet, angles: Angles | None = None) -> None:
    """Compile the refits of several robots at once; `refit` finds them compiled."""
    tasks = []
    for robot in robots:
        structure, problem, unknowns = build(robot, logs, start={})
        shown = angles or (integrated_angles(robot, logs) if robot.effects[-1].repeats else {})
        tasks += [(structure, with_prescribed_angles(problem, logs, shown), unknowns)] if shown else []
        tasks += [] if angles else [(structure, problem, unknowns)]
    compile_ahead(tasks)


@in_float64
def refit(
    robot: Robot,
    starts: Sequence[Mapping[str, float]],
    logs: LogSet,
    held_out: LogSet,
    noise: Mapping[str, float],
    initial_states: Mapping[str, Mapping[str, float]],
    max_steps: int = _STEPS,
    rival: float = np.inf,
    angles: Angles | None = None,
) -> Trial:
    """Fit `robot` (with its effects) to `logs` from each of `starts`, and predict `held_out` with the best.

    `initial_states` are those of the model without the effect, where they had to be estimated. `angles` are the wheels'
    angles of a model for which they have to be prescribed. Where only the effect added last repeats with the wheels, it is
    first fitted with prescribed angles, then simulated freely; if that does not come near, they stay prescribed. `rival` is
    the lowest chi-squared of other candidates: such an effect that does not come below it even so is not followed up.
    """
    sigma = np.array([noise.get(c, np.nan) for c in logs.channels.measured])
    known = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    structure, free, _ = build(robot, logs, start={**known, **starts[0]})
    if isinstance(logs, Windows):
        free = started(logs.whole, structure, free)
    free = replace(free, sigma=array(np.where(np.isfinite(sigma), sigma, np.asarray(free.sigma))))
    repeats = len(starts) > 1 and robot.effects[-1].repeats
    angles = dict(integrated_angles(robot, logs)) if repeats else dict(angles or {})
    problem = with_prescribed_angles(free, logs, angles) if angles else free
    states = states_from(initial_states, logs, structure, problem)
    if isinstance(logs, Windows) and not initial_states:
        z = problem.bounds.coordinates(array([{**known, **starts[0]}[name] for name in structure.names]))
        states = approached(structure, problem, Unknowns(z, states)).states
    own = [name for name in structure.names if robot.effects and name.startswith(f"{robot.effects[-1].id}.")]
    first_steps = max_steps if len(starts) == 1 else PRESCRIBED_STEPS if repeats and angles else _FIRST_STEPS
    tried: list[Optimum] = []
    for start in starts:
        for weaker in _WEAKER if len(starts) > 1 else (1.0,):
            values = {**known, **start}
            values |= {name: robot.parameters[name].inside(weaker * values[name]) for name in own}
            z = problem.bounds.coordinates(array([values[name] for name in structure.names]))
            tried.append(minimise_compiled(structure, problem, Unknowns(z, states), max_steps=first_steps))
            if np.isfinite(tried[-1].cost) and not bool(tried[-1].diverged):
                break
    optimum = min(tried, key=lambda optimum: float(np.nan_to_num(optimum.cost, nan=np.inf)))
    if repeats and angles and chi_squared(problem, optimum, free) < rival:
        problem, optimum = followed_up(robot, logs, noise, structure, free, optimum.unknowns, max_steps)
    elif len(starts) > 1:
        problem = free if repeats else problem
        optimum = minimise_compiled(structure, problem, optimum.unknowns, max_steps=max_steps)
    if max_steps >= _STEPS and not isinstance(logs, Windows):
        optimum = past_the_astray(
            problem, optimum, partial(minimise_compiled, structure, max_steps=max_steps), _EXPLAINED
        )
    values, squares = by_name(structure, problem, optimum.unknowns), chi_squared(problem, optimum, free)
    most = max(_FASTER * structure.integrator.substeps, _FASTEST)
    if not _can_be_simulated(robot, values, held_out, most):  # it ran away
        values, squares = {name: {**known, **starts[0]}[name] for name in structure.names}, np.inf
    changes = dict(zip(structure.names, changes_by(problem, optimum.triangle).tolist(), strict=True))
    found = robot.with_values(**values)
    unseen = unseen_by(found, changes)
    found = held_level(found, unseen)
    if np.isfinite(squares) and any(
        changes[name] * abs(found.parameters[name].value - values[name]) > UNSEEN for name in unseen
    ):  # what it was left at was of consequence
        start = {name: found.parameters[name].value for name in found.parameters.free_names}
        states = initial_states_at(robot, logs, structure, problem, optimum.unknowns)
        return refit(found, [start], logs, held_out, noise, states, max_steps, angles=problem.prescribed or None)
    return Trial(
        id=robot.effects[-1].id if robot.effects else "",
        robot=found,
        squares=squares,
        free=len(structure.names) - len(unseen),
        fitted=_fitted(structure, problem, optimum, logs, free),
        predicts=Prediction(found, held_out, noise),
        initial_states=initial_states_at(robot, logs, structure, problem, optimum.unknowns),
        angles=problem.prescribed or None,
    )


def _can_be_simulated(robot: Robot, values: Mapping[str, float], logs: LogSet, most: float) -> bool:
    """Whether `robot` with these values is anything that at most so many steps a sample follow on `logs`."""
    if not all(map(np.isfinite, values.values())):
        return False
    sizes = {n: robot.parameters[n].typical for effect in robot.effects for n in values if n.startswith(effect.key(""))}
    if any(size and abs(values[name]) > RAN_AWAY * size for name, size in sizes.items()):
        return False
    try:
        return integrator_for(robot.with_values(**values), logs).substeps <= most
    except ParameterError:
        return False


def refit_from_itself(robot: Robot, like: Trial, logs: LogSet, held_out: LogSet, noise: Mapping[str, float]) -> Trial:
    """`robot` refitted from its own values, and from the initial states of the trial `like`, which has its angles."""
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    return refit(robot, [start], logs, held_out, noise, like.initial_states, angles=like.angles)


def _fitted(structure: Structure, problem: Problem, optimum: Optimum, logs: LogSet, free: Problem) -> HeldOut:
    """What an optimum leaves on the logs that it was fitted to: of all channels that count in `free`, so that models compare,
    those that measure a prescribed angle not a number."""
    counts, counted = (np.any(np.asarray(own.mask), axis=(0, 1)) for own in (free, problem))
    sigma, names = np.asarray(problem.sigma), logs.channels.measured
    noise = {n: float(sigma[i]) for i, n in enumerate(names) if bool(counts[i])}
    state = state_left(logs, simulated_at(structure, problem, optimum.unknowns, logs), noise)
    shown = np.array([bool(counted[names.index(n)]) for n in noise])
    if shown.all():
        return state
    residuals = tuple(np.where(shown, own, np.nan) for own in state.residuals)
    return replace(state, residuals=residuals, normalised_rms=rms(np.concatenate(residuals)))


def _sharper_and_sharper(effects: tuple[Effect, ...]) -> Iterator[tuple[Effect, ...]]:
    """The effects as they are, and with their edges narrower and narrower until they are sharp."""
    yield effects
    while effects != (effects := tuple(effect.sharper for effect in effects)):
        yield effects


def continued(trial: Trial, logs: LogSet, held_out: LogSet, noise: Mapping[str, float]) -> Trial:
    """The same refit carried on from where it stopped, and with sharp edges where they were blurred to be found.

    From elsewhere, too, where its effect says that the search may have ended in the worse of two optima.
    """
    for effects in _sharper_and_sharper(trial.robot.effects):
        start = {name: trial.robot.parameters[name].value for name in trial.robot.parameters.free_names}
        model = replace(trial.robot, effects=effects)
        again = refit(model, [start], logs, held_out, noise, trial.initial_states, angles=trial.angles)
        # Where no sample lies within an edge, a sharper one is as likely, and the law.
        trial = replace(again, id=trial.id) if again.score <= trial.score * (1.0 + 1e-9) else trial
    elsewhere = trial.effect.elsewhere(trial.robot) if trial.effect is not None else {}
    if elsewhere:
        here = {name: trial.robot.parameters[name].value for name in trial.robot.parameters.free_names}
        start = {**here, **elsewhere}
        again = refit(trial.robot, [start], logs, held_out, noise, trial.initial_states, angles=trial.angles)
        trial = replace(again, id=trial.id) if again.score < trial.score else trial
    return trial


def in_full(
    trial: Trial,
    logs: LogSet,
    noise: Mapping[str, float],
    *,
    loss: Loss | str = "squares",
    covariance: Covariance = "auto",
) -> Fit:
    """The output-error fit of a trial's model, with its uncertainty; `loss` and `covariance` as of `output_error`.

    Where wheels' angles have to be prescribed, the loss is that of squares.
    """
    robot = replace(trial.robot, effects=tuple(effect.sharp for effect in trial.robot.effects))

    def fitted(robot: Robot) -> Fit:
        start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
        if trial.angles:
            return fit_with_prescribed_angles(robot, logs, noise, start, trial.initial_states)
        return refined(robot, logs, start, loss=loss, covariance=covariance)

    fit = fitted(robot)
    while gone := ran_away(fit.robot):
        fit = fitted(held_level(fit.robot, gone))
    return fit
