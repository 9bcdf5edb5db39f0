"""optimistix `LevenbergMarquardt` as it comes, on the plain residual of all experiments.

`plain` simulates by XLA's scan, as a user's own JAX code does, `on_machine_code` by jaxid's rollout, which is machine code of
jaxid's making. Both are jitted, the unknowns one vector: what one writes without knowing the structure. It
pushes all 31 tangents through every experiment and factors a dense 16,008 x 31 Jacobian. Tolerances as SciPy's, 1e-8.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from jaxid import Integrator, Pioneer, float64
from jaxid.simulation.rollout import rollout, rollout_in_xla

from .pioneer_problem import BETA_SPREAD, FREE, SAMPLING, SIGMA, STATE_SCALE, STATES, SUBSTEPS, FitProblem
from .reached import Clock, Reached

_clock = Clock()


def residual(x, data, simulate=rollout):
    """Weighted residuals and priors at the common units' x, [2 E T + E]."""
    inputs, outputs, numbers, scale = data
    p = {**numbers, **dict(zip(FREE, x[:7] * scale, strict=True))}
    starts = STATE_SCALE * x[7:].reshape(-1, 3)
    dt = jnp.full(inputs.shape[1], SAMPLING)

    def one(start, u):
        begin = dict(zip(STATES, start, strict=True))
        return simulate(Pioneer().structure, p, begin, u, dt, Integrator(SUBSTEPS))

    errors = (jax.vmap(one)(starts, inputs) - outputs) / jnp.asarray(SIGMA)
    return jnp.concatenate([errors.ravel(), starts[:, 0] / BETA_SPREAD])


def data_of(problem: FitProblem):
    """The problem's arrays for `residual`."""
    defaults = {name: parameter.value for name, parameter in Pioneer().parameters.items()}
    numbers = {name: jnp.asarray(value) for name, value in {**defaults, **problem.numbers}.items()}
    return jnp.asarray(problem.inputs), jnp.asarray(problem.outputs), numbers, jnp.asarray(problem.scale)


def _note(**report) -> None:
    """optimistix's own report of a step: the cost there and the time it came."""
    jax.debug.callback(lambda cost: _clock.note(float(cost)), report["loss_this_step"][1])


@partial(jax.jit, static_argnames=("max_steps", "simulate"))
def _solve(start, data, max_steps, simulate):
    solver = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8, verbose=_note)
    solution = optx.least_squares(
        partial(residual, simulate=simulate), solver, start, args=data, max_steps=max_steps, throw=False
    )
    return solution.value, solution.stats["num_steps"], solution.result == optx.RESULTS.successful


def _fit(problem: FitProblem, simulate, max_linearisations: int = 40) -> Reached:
    with float64():
        _clock.__init__()
        found = _solve(jnp.asarray(problem.start_point), data_of(problem), max_linearisations, simulate)
        value, steps, converged = jax.block_until_ready(found)
        reason = "converged" if bool(converged) else f"not converged in {max_linearisations} steps"
        jax.effects_barrier()
        return Reached(np.asarray(value), int(steps), reason, _clock.lowest())


def plain(problem: FitProblem) -> Reached:
    """`optimistix.least_squares` on XLA's scan, at most 40 steps."""
    return _fit(problem, rollout_in_xla)


def on_machine_code(problem: FitProblem) -> Reached:
    """The same on jaxid's rollout."""
    return _fit(problem, rollout)
