"""Is a held-out error what delays that scatter leave?

Of commands or samples that each come late by a time of their own a model can foretell the mean alone; what is left is larger
than the noise, though nothing is missing. A law of this kind (`Effect.draws`) says how large, and how much neighbours have
in common: as much as draws of it leave.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..._distributions import normal_tail
from ..._float64 import in_float64
from ...effects import laws_of
from ...estimate.confidence.agreement import rms
from ...estimate.output_error.estimated_start import estimated_start
from ...estimate.result import Fit
from ...logs import Log, LogSet, noise_scale
from ...robots.draw import Draw
from ...robots.effect import Effect
from ...robots.robot import Robot
from ...robots.signal_path import overrides
from ...simulation.simulate import integrator_for, simulate
from ..left.heldout import HeldOut, held_out_state, scaled_residuals, structure
from ..refits.candidate_refits import Report
from ..refits.refit import Trial, continued, in_full
from .denser import bare_of
from .reconsider import refitted_like, with_effects
from .steps import Step
from .telling_apart import clearly_better, told_apart_from

_DRAWS = 60
_FEW = 15
"""Draws by each value of what their size tells."""
_SEED = 41

Residuals = list[NDArray[np.float64]]


@in_float64
def by_chance(fit: Fit, logs: LogSet, held_out: LogSet, state: HeldOut) -> HeldOut:
    """`state`, which `fit` leaves on the `held_out` logs, marked as left by chance where one of its effects scatters and draws
    of it leave as much: by size and by autocorrelations, at the level at which complete models are called incomplete.

    Of the fitted `logs` they must leave no less than the fit does: what is missing may show in few logs only.
    """
    scattering = next((effect for effect in fit.robot.effects if _scatters(effect)), None)
    if scattering is None or state.adequate or state.diverged or state.simulated_freely is not None:
        return state
    ways = range(len(scattering.draws(fit.robot.parameters.numbers, fit.robot)))
    drawn = [way for way in ways if _as_drawn(fit, scattering, way, held_out, state)]
    of_fitted = held_out_state(fit.robot, logs, noise_scale(logs, otherwise=held_out)) if drawn else state
    return replace(state, by_chance=any(_as_drawn(fit, scattering, way, logs, of_fitted, True) for way in drawn))


def _scatters(effect: Effect) -> bool:
    return overrides(type(effect), "draws")


def _as_drawn(fit: Fit, effect: Effect, way: int, held_out: LogSet, state: HeldOut, no_more: bool = False) -> bool:
    """Whether the `state` is like draws of `effect` in one `way` of several: two tests, each of them from both sides; or that
    it is `no_more` than they are."""
    draws = list(_draws(fit, effect, way, held_out, state, [_own_numbers(fit, effect, k) for k in range(_DRAWS)]))
    where = [np.mean(np.square(own), axis=0) for own in zip(*draws, strict=True)]
    seen = np.array(_measures(state.residuals))
    drawn = np.array([_measures(own) for own in draws])
    if not no_more and not _where_drawn(state.residuals, draws, where, state.false_alarm):
        return False
    if not (np.all(seen > 0) and np.all(drawn > 0)):  # too few samples for autocorrelations
        return False
    seen, drawn = np.log(seen), np.log(drawn)
    spread = np.std(drawn, axis=0, ddof=1)
    spread[0] = np.hypot(spread[0], state.noise_error)
    if no_more:
        return bool(2.0 * normal_tail((seen[0] - np.mean(drawn[:, 0])) / spread[0]) >= state.false_alarm)
    far = np.abs(seen - np.mean(drawn, axis=0)) / spread
    return bool(np.all(np.isfinite(far)) and all(4.0 * float(normal_tail(one)) >= state.false_alarm for one in far))


def _where_drawn(
    seen: Sequence[NDArray[np.float64]], draws: Sequence[Residuals], where: Residuals, level: float
) -> bool:
    """Whether what is left is large `where` draws leave much, mean squares of each sample, as far as draws themselves are."""

    def misplaced(residuals: Sequence[NDArray[np.float64]]) -> float:
        r, v = (np.concatenate([own.ravel() for own in each]) for each in (residuals, where))
        there = np.isfinite(r) & np.isfinite(v) & (v > 0.0)
        # Of its own size: how large it is on the whole is another test's.
        return float(np.mean(r[there] ** 2 / v[there]) / np.mean(r[there] ** 2) * np.mean(v[there]))

    own = np.log([misplaced(each) for each in draws])
    far = (np.log(misplaced(seen)) - np.mean(own)) / np.std(own, ddof=1)
    return bool(4.0 * float(normal_tail(far)) >= level)


def _measures(residuals: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """Size of a residual, and how much neighbours have in common."""
    return rms(np.concatenate(list(residuals))), structure(residuals)[0]


def _draws(
    fit: Fit, effect: Effect, way: int, held_out: LogSet, state: HeldOut, numbers: Sequence[dict[str, float]]
) -> Iterator[Residuals]:
    """Residuals of `fit` on logs in which its delays have come out otherwise, by each of the `numbers`, and the noise, too."""
    random = np.random.default_rng(_SEED)
    robot, bare = fit.robot, bare_of(fit.robot, effect)
    start = estimated_start(robot, held_out, state.noise)
    usual = scaled_residuals(held_out, _simulated(robot, held_out, start, 1), state.noise)
    draws = [effect.draws(p, robot)[way] for p in numbers]

    def drawn(draw: Draw, of: str, signal: NDArray[np.float64], log: Log) -> NDArray[np.float64]:
        return draw.once(signal, log.time, random) if draw.of == of else signal

    logs = LogSet(
        replace(log, name=f"{log.name} {k}", inputs=drawn(draw, "inputs", log.inputs, log))
        for k, draw in enumerate(draws)
        for log in held_out
    )
    every = iter(_simulated(bare, logs, start, len(draws)))
    for draw in draws:
        outputs = [drawn(draw, "outputs", np.asarray(next(every)), log) for log in held_out]
        once = scaled_residuals(held_out, outputs, state.noise)
        yield [a - b + random.normal(size=a.shape) for a, b in zip(once, usual, strict=True)]


def _simulated(robot: Robot, logs: LogSet, start, times: int) -> Residuals:
    many = {name: np.tile(np.asarray(values), times) for name, values in start.items()}
    return simulate(robot, logs, start=many, integrator=integrator_for(robot, logs))


def _own_numbers(fit: Fit, effect: Effect, seed: int) -> dict[str, float]:
    """The model's numbers, those of the effect drawn by their standard errors where these are known."""
    random = np.random.default_rng([_SEED, seed])
    numbers = dict(fit.robot.parameters.numbers)
    for name in [name for name in fit.free_names if name.startswith(effect.key(""))]:
        error = fit[name].std_error
        moved = numbers[name] + (random.normal() * error if np.isfinite(error) else 0.0)
        numbers[name] = float(np.clip(moved, fit.robot.parameters[name].lower, fit.robot.parameters[name].upper))
    return numbers


def _by_size(trial: Trial, effect: Effect, logs: LogSet, noise: dict[str, float]) -> list[Robot]:
    """The robot of a trial with what the size of what is left on the `logs` tells of its `effect` held there, by each of the
    ways of chance."""
    robot = trial.robot
    numbers = robot.parameters.numbers
    ((name, values),) = effect.told_by_size(numbers, robot).items()
    fit, left = in_full(trial, logs, noise), held_out_state(robot, logs, noise)
    tried = [numbers | {name: value} for value in values for _ in range(_FEW)]
    seen, found = np.log(left.normalised_rms), []
    for way in range(len(effect.draws(numbers, robot))):
        sizes = np.log([rms(np.concatenate(own)) for own in _draws(fit, effect, way, logs, left, tried)])
        means = np.maximum.accumulate(sizes.reshape(len(values), _FEW).mean(axis=1))
        value = float(np.interp(seen, means, values))
        found.append(robot.change(name, free=False).with_values(**{name: value}))
    return found


def rather_by_chance(
    steps: list[Step], current: Trial, base: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float], say: Report
) -> tuple[list[Step], Trial]:
    """A delay that scatters in the place of one of the effects found, where that is as likely and what is left is what it
    leaves by chance. Those of which this holds are not told apart."""
    present = {effect.id for effect in current.robot.effects}
    for place, step in enumerate(steps):
        if step.chosen.id not in present or current.angles:
            continue
        found: list[Trial] = []
        for law in _scattering(step, base.robot, present - {step.chosen.id}):
            owners = {effect.id: current.robot for effect in current.robot.effects if effect.id != step.chosen.id}
            trial = replace(current, id=law.id)
            if (trial.id, trial.law) != (step.chosen.id, law.law):
                say(f"refitting with {law.title} instead of {step.chosen.title}")
                trial = refitted_like(with_effects(base.robot, owners) + law, current, logs, held_out, noise)
                trial = continued(replace(trial, id=law.id), logs, held_out, noise)
            # How sure a difference is, its own scatter says: what chance leaves comes with the changes of command.
            if clearly_better(current.fitted, trial.fitted):
                continue
            for own in _held_by_size(trial, law, current, logs, held_out, noise):
                state = by_chance(in_full(own, logs, noise), logs, held_out, own.held_out)
                if state.by_chance:
                    say(f"{law.title}: what is left, {state.normalised_rms:.3f} x noise, is what its scatter leaves")
                    found.append(own.leaving(state))
                    break
        if found:
            ranked = sorted(found, key=lambda trial: trial.score)
            best, others = ranked[0], [trial for trial in ranked if trial.id != ranked[0].id]
            laws = [trial for trial in ranked if trial.id == best.id]
            ids = {trial.id for trial in found}
            # What is as likely and leaves what nothing accounts for is no rival any more.
            rest = [t for t in step.trials if t.id not in ids and told_apart_from(best, t)]
            new = replace(
                step,
                trials=(best, *others, *rest),
                equivalent=tuple(dict.fromkeys(trial.id for trial in others)),
                laws=tuple(laws),
                laws_alike=tuple(trial.law for trial in laws[1:]),
                after=best,
            )
            return [*steps[:place], new, *steps[place + 1 :]], best
    return steps, current


def _held_by_size(
    trial: Trial, law: Effect, current: Trial, logs: LogSet, held_out: LogSet, noise: dict[str, float]
) -> Iterator[Trial]:
    """The trial; with what the size of what is left tells held there and the rest refitted, one for each way of chance."""
    if not law.told_by_size(trial.robot.parameters.numbers, trial.robot):
        yield trial
        return
    for robot in _by_size(trial, law, logs, noise):
        own = refitted_like(robot, trial, logs, held_out, noise)
        if not clearly_better(current.fitted, own.fitted):
            yield replace(own, id=trial.id)


def _scattering(step: Step, robot: Robot, present: set[str]) -> list[Effect]:
    """The laws that scatter of the mechanisms that were tried at a step."""
    tried = [trial.id for trial in step.trials if trial.id not in present]
    return [law for identifier in tried for law in laws_of(robot, identifier) if _scatters(law)]
