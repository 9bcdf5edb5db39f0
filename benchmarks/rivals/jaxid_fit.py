"""jaxid's own fits of the eight-experiment problem.

`core` is the compiled Levenberg-Marquardt on the structured problem, from the same start as the rivals.
`public_estimate` and `public_known` are `jaxid.output_error` as a user calls it, with every initial state free (it then
searches the caster's angle globally and estimates the noise as well) and with the runs taken to start at rest, caster
trailing.
"""

import time
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from jaxid import PIONEER, Integrator, Log, LogSet, Pioneer, float64, output_error
from jaxid.estimate.output_error.levenberg_marquardt import BestDampingLevenbergMarquardt
from jaxid.estimate.output_error.problem import Problem, Structure, Unknowns, parameters_at
from jaxid.estimate.output_error.setup import build
from jaxid.estimate.output_error.solvers import minimise_compiled

from .pioneer_problem import FREE, SAMPLING, SIGMA, STATE_SCALE, SUBSTEPS, FitProblem
from .reached import Clock, Reached

INTEGRATOR = Integrator(SUBSTEPS)


def robot_of(problem: FitProblem) -> Pioneer:
    """The Pioneer with the seven parameters free."""
    robot = Pioneer()
    robot = robot.with_values(**{k: v for k, v in problem.numbers.items() if k in robot.parameters})
    return robot.with_parameters(robot.parameters.with_free(*FREE))


def logs_of(problem: FitProblem) -> LogSet:
    """The experiments as logs."""
    time = np.arange(problem.inputs.shape[1]) * SAMPLING
    return LogSet(
        Log.from_arrays(
            f"experiment {e + 1}",
            time,
            dict(zip(PIONEER.inputs, problem.inputs[e].T, strict=True)),
            dict(zip(PIONEER.outputs, problem.outputs[e].T, strict=True)),
            PIONEER,
        )
        for e in range(problem.experiments)
    )


def built(problem: FitProblem) -> tuple[Structure, Problem, Unknowns]:
    """jaxid's problem with all initial states free, in the benchmark's weights."""
    start = dict(zip(FREE, problem.start, strict=True))
    structure, arrays, unknowns = build(
        robot_of(problem), logs_of(problem), start=start, initial="estimate", integrator=INTEGRATOR
    )
    return structure, replace(arrays, sigma=jnp.asarray(SIGMA)), unknowns


def point_of(problem: FitProblem, structure: Structure, arrays: Problem, unknowns: Unknowns) -> np.ndarray:
    theta = dict(zip(structure.names, np.asarray(parameters_at(arrays, unknowns.z)), strict=True))
    states = np.asarray(unknowns.states) * np.asarray(arrays.state_scale) / STATE_SCALE
    return np.concatenate([np.array([theta[name] for name in FREE]) / problem.scale, states.ravel()])


def core(problem: FitProblem, max_linearisations: int = 100) -> Reached:
    """`minimise_compiled` from the common start, its own stopping rule."""
    with float64():
        structure, arrays, unknowns = built(problem)
        optimum = jax.block_until_ready(minimise_compiled(structure, arrays, unknowns, max_steps=max_linearisations))
        x = point_of(problem, structure, arrays, optimum.unknowns)
        reason = "converged" if bool(optimum.converged) else f"not converged in {max_linearisations} steps"
        return Reached(x, int(optimum.iterations), reason)


def path(problem: FitProblem) -> list[tuple[float, float]]:
    """(processor seconds, lowest cost so far) after every linearisation of `core`, warm: the same fit, its solver reporting."""
    clock = Clock()
    with float64():
        structure, arrays, unknowns = built(problem)
        solver = BestDampingLevenbergMarquardt(report=lambda cost: clock.note(float(cost)))
        for _ in range(2):  # the first compiles
            clock.begin, clock.seen = time.process_time(), []
            minimise_compiled(structure, arrays, unknowns, max_steps=100, solver=solver)
    return clock.lowest()


def _public(problem: FitProblem, **options) -> Reached:
    start = dict(zip(FREE, problem.start, strict=True))
    fit = output_error(robot_of(problem), logs_of(problem), start=start, **options)
    theta = np.array([fit.parameters[name].value for name in FREE])
    states = [[log_states[name] for name in ("beta", "eta1", "eta2")] for log_states in fit.initial_states.values()]
    x = np.concatenate([theta / problem.scale, np.array(states).ravel() / STATE_SCALE])
    return Reached(x, fit.iterations, fit.reason)


def public_estimate(problem: FitProblem) -> Reached:
    """`jaxid.output_error(..., initial_states="estimate")`."""
    return _public(problem, initial_states="estimate")


def public_known(problem: FitProblem) -> Reached:
    """`jaxid.output_error(...)` with the runs taken to start at rest: another, smaller problem."""
    return _public(problem, initial_states="known")
