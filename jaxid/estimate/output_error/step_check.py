"""Whether the integration steps are short enough for this robot, asked of the result.

A step that suits one robot is too long for a smaller, faster one, and no residual shows it: Runge-Kutta with long steps has
time constants of its own, which can fit the data perfectly with wrong parameters. So the optimum is simulated again with
shorter steps. The difference, taken off the measurements, moves the estimates to where shorter steps would lead (deferred
correction; Stetter 1978, Numerische Mathematik 29), and this costs no program of its own. Where they would move noticeably,
the fit goes on with shorter steps, from where the correction leads, and is asked again with the noise that it has then: long
steps can misfit so much that, in units of what they leave, the next steps' own errors would not show.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...simulation.rollout import Integrator
from .evaluation import simulated
from .long_run import long_run_at
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns
from .solvers import DEFAULT, Solver, minimise_compiled

_FINER = 4
_VISIBLE = 0.1
"""Difference between the simulations, RMS in units of the noise, that is too large whatever the estimates do."""
_MOVED = 0.3
"""How far the estimates may move, all together, in standard errors that allow for a coloured residual."""
_LITTLE = 0.2
"""A way that is promised to be no longer need not be gone to see that it is short enough."""
_NEAR = 5e-4
"""Promised drop of the cost, that of 3 % of a standard error, at which the estimates are taken to be where they move to."""
_MOST = 64
"""Steps are shortened at most by this factor."""
_GAINED = 0.5
"""A difference that shorter steps do not shrink to this share is none of the integration: the simulation is chaotic."""
_NEARBY = 10.0
"""The same, beyond which a correction says nothing of where shorter steps lead."""
_SETTLED = 1e-3
"""Change of the correction, RMS in units of the noise, that is none."""
_STEPS = 20
_CORRECTIONS = 3
"""How often measurements are corrected anew for where the estimates have moved, before shorter steps are gone to."""
_NEGLIGIBLE = 1e-6
"""Difference between the simulations, in units of a channel's own RMS, below which no noise is small enough to ask for more:
logs of a simulation without noise."""
_LOST = 1.1
"""Where a channel's residual grows by more than this with shorter steps, their fit may have gone to another minimum."""

Settle = Callable[[Structure, Problem, Optimum], tuple[Problem, Optimum, int]]
"""The noise of every channel as an optimum leaves it, the optimum with that noise, and the iterations of both."""


class Checked(NamedTuple):
    """The problem, its optimum and what it was integrated with, `iterations` later. `error` is what still depends on the
    steps (RMS, in units of the noise); `note` a sentence where that could not be made small."""

    structure: Structure
    problem: Problem
    optimum: Optimum
    error: float
    note: str
    iterations: int


def _finer(structure: Structure, factor: int = _FINER) -> Structure:
    integrator = structure.integrator
    return structure._replace(integrator=Integrator(integrator.substeps * factor, integrator.friction))


def _difference(structure: Structure, problem: Problem, at: Unknowns) -> Float[np.ndarray, "E T ny"]:
    """Simulation with shorter steps minus that with these."""
    fine, plain = (np.asarray(simulated(one, problem, at)) for one in (_finer(structure), structure))
    with np.errstate(invalid="ignore"):  # both may be infinite
        return np.where(np.asarray(problem.mask), fine - plain, 0.0)


def _in_noise(problem: Problem, change: Float[np.ndarray, "E T ny"]) -> float:
    """RMS of a `change` of the outputs, in units of the noise."""
    seen = (change / np.asarray(problem.sigma))[np.asarray(problem.mask)]
    return float(np.sqrt(np.mean(seen**2))) if seen.size else 0.0


def _in_signal(problem: Problem, change: Float[np.ndarray, "E T ny"]) -> float:
    """Largest RMS of a channel's `change`, in units of the channel's own."""
    mask = np.asarray(problem.mask)
    power = [np.sum(np.where(mask, x, 0.0) ** 2, axis=(0, 1)) for x in (change, np.asarray(problem.outputs))]
    return float(np.sqrt(np.max(power[0][power[1] > 0] / power[1][power[1] > 0], initial=0.0)))


def _corrected(problem: Problem, change: Float[np.ndarray, "E T ny"]) -> Problem:
    """The problem for these steps whose minimum is that of shorter ones, by which the simulation changes by `change`."""
    return replace(problem, outputs=np.asarray(problem.outputs) - change)


def _moved(structure: Structure, problem: Problem, at: Unknowns, change, solver: Solver) -> Optimum:
    """The optimum if measurements are corrected by the `change`."""
    corrected = _corrected(problem, change)
    return minimise_compiled(structure, corrected, at, max_steps=_STEPS, solver=solver, until=_NEAR)


def _led_to(
    structure: Structure, problem: Problem, optimum: Optimum, change, found: Optimum, solver: Solver
) -> Unknowns:
    """Where shorter steps lead, as far as these can tell: the fixed point of the correction, of which `found` is the first
    step, or the optimum where it has none.

    It costs a simulation with the shorter steps where their own search would cost linearisations.
    """
    at = optimum.unknowns
    for number in range(_CORRECTIONS):
        found = _moved(structure, problem, at, change, solver) if number else found
        following = _difference(structure, problem, found.unknowns)
        error = _in_noise(problem, following - change)
        if not (np.isfinite(found.cost) and np.isfinite(error)):
            return optimum.unknowns
        at, change = found.unknowns, following
        if error <= _SETTLED:
            break
    return at


def _would_move(
    structure: Structure, problem: Problem, optimum: Optimum, change, solver: Solver
) -> tuple[float, Optimum]:
    """How far the estimates move, in standard errors, if measurements are corrected by the `change`, and where to.

    One linearisation promises half the square of that, and where that is little, nothing more is asked. Of a coloured residual
    the errors are those of its long-run variance.
    """
    one_error = np.sqrt(long_run_at(structure, problem, optimum.unknowns))
    corrected, at = _corrected(problem, change), optimum.unknowns
    moved = minimise_compiled(structure, corrected, at, max_steps=0, solver=solver, until=np.inf)
    promised = float(np.sqrt(2.0 * np.maximum(moved.promise, 0.0)) / one_error)
    if promised <= _LITTLE:
        return promised, moved
    moved = _moved(structure, problem, at, change, solver)
    step = np.asarray(moved.unknowns.z) - np.asarray(at.z)
    return float(np.linalg.norm(np.asarray(optimum.triangle.shared) @ step) / one_error), moved


def with_steps_checked(
    structure: Structure,
    problem: Problem,
    optimum: Optimum,
    settle: Settle,
    *,
    start: Unknowns | None = None,
    max_steps: int = 100,
    solver: Solver = DEFAULT,
    report: Callable[[str], None] = lambda message: None,
) -> Checked:
    """The optimum, minimised again with shorter steps where these matter, and with the noise that `settle` finds then.

    Shorter steps that fit worse are also tried from `start`, where the fit began; always by the same `solver` as the fit.
    Call under float64.
    """
    shortened, iterations, before = 1, 0, None
    while True:
        change = _difference(structure, problem, optimum.unknowns)
        error = _in_noise(problem, change)
        if not np.isfinite(error):
            note = "The simulation diverges with shorter integration steps; what fits is an artefact of long ones."
            return Checked(structure, problem, optimum, error, note, iterations)
        relative = _in_signal(problem, change)
        if relative <= _NEGLIGIBLE and error > _VISIBLE:
            note = (
                f"The logs have no noise to speak of: what is left is no more than the integration's own error ({relative:.1g} "
                "of the motion). The estimates are exact to about that, and standard errors mean nothing."
            )
            return Checked(structure, problem, optimum, error, note, iterations)
        at, moved = optimum.unknowns, None
        if error <= _VISIBLE:
            distance, moved = _would_move(structure, problem, optimum, change, solver)
            if distance <= _MOVED:
                return Checked(structure, problem, optimum, error, "", iterations)
        if shortened >= _MOST or (before is not None and error > _GAINED * _in_noise(problem, before)):
            note = (
                f"The simulation depends on its integration steps ({error:.2g} times the noise between steps and a quarter "
                "of them), so its parameters may be off by more than they say; the motion is chaotic or too fast for the "
                "sampling."
            )
            return Checked(structure, problem, optimum, error, note, iterations)
        if error <= _NEARBY:
            first = moved or _moved(structure, problem, at, change, solver)
            at = _led_to(structure, problem, optimum, change, first, solver)
        shortened, before = shortened * _FINER, change
        structure = _finer(structure)
        report("integration steps were too long; went on with shorter ones")
        longer, asked = np.asarray(problem.sigma), problem
        optimum = minimise_compiled(structure, asked, at, max_steps=max_steps, solver=solver)
        problem, optimum, more = settle(structure, asked, optimum)
        iterations += more
        if start is not None and np.any(np.asarray(problem.sigma) > _LOST * longer):
            other = minimise_compiled(structure, asked, start, max_steps=max_steps, solver=solver)
            other_problem, other, more = settle(structure, asked, other)
            iterations += more
            if np.sum(np.log(np.asarray(other_problem.sigma))) < np.sum(np.log(np.asarray(problem.sigma))) - 0.01:
                problem, optimum = other_problem, other
