"""diffrax + optimistix on the Pioneer, as their documentation shows it: a vector field, `diffeqsolve`, `least_squares`.

A vector field cannot stick: dry friction is `tanh(speed / width)` here, of the width named below, integrated by Tsit5 with the
steps that the others take, so that the cost it ends at is that of a model a little different. Forward-mode derivatives
(`ForwardMode`), all 31 unknowns one vector, optimistix's Levenberg-Marquardt with SciPy's tolerances.
"""

from functools import partial

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

from jaxid import Pioneer, float64
from jaxid.simulation.friction import Smooth

from .optimistix_fit import data_of
from .pioneer_problem import BETA_SPREAD, FREE, SAMPLING, SIGMA, STATE_SCALE, STATES, SUBSTEPS, FitProblem
from .reached import Reached

WIDTH = 0.2
"""Rubbing speed [rad/s] within which friction is smoothed: 0.02 m/s at the wheels' rim."""


def _field(t, state, args):
    p, inputs, friction = args
    u = inputs[jnp.minimum((t / SAMPLING + 1e-6).astype(int), len(inputs) - 1)]
    robot, here = Pioneer().structure, dict(zip(STATES, state, strict=True))
    rates = robot.rates(here, tuple(u), friction.present(robot, here, (), p), p)
    return jnp.stack([jnp.asarray(rates[name]) for name in STATES])


def residual(x, data):
    """Weighted residuals and priors at the common units' x, [2 E T + E]."""
    inputs, outputs, numbers, scale = data
    p = {**numbers, **dict(zip(FREE, x[:7] * scale, strict=True))}
    starts = STATE_SCALE * x[7:].reshape(-1, 3)
    times = SAMPLING * jnp.arange(inputs.shape[1])

    def one(start, u):
        solution = dfx.diffeqsolve(
            dfx.ODETerm(_field),
            dfx.Tsit5(),
            t0=0.0,
            t1=times[-1],
            dt0=SAMPLING / SUBSTEPS,
            y0=start,
            args=(p, u, Smooth(WIDTH)),
            saveat=dfx.SaveAt(ts=times),
            adjoint=dfx.ForwardMode(),
            max_steps=SUBSTEPS * inputs.shape[1] + 10,
        )
        assert solution.ys is not None
        return solution.ys[:, 1:]

    errors = (jax.vmap(one)(starts, inputs) - outputs) / jnp.asarray(SIGMA)
    return jnp.concatenate([errors.ravel(), starts[:, 0] / BETA_SPREAD])


@partial(jax.jit, static_argnames="max_steps")
def _solve(start, data, max_steps):
    solver = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)
    options = {"jac": "fwd"}
    solution = optx.least_squares(residual, solver, start, data, options, max_steps=max_steps, throw=False)
    return solution.value, solution.stats["num_steps"], solution.result == optx.RESULTS.successful


def documented(problem: FitProblem, max_linearisations: int = 10) -> Reached:
    """`optimistix.least_squares` on the diffrax simulation, at most `max_linearisations` steps."""
    with float64():
        found = _solve(jnp.asarray(problem.start_point), data_of(problem), max_linearisations)
        value, steps, converged = jax.block_until_ready(found)
    reason = "converged" if bool(converged) else f"not converged in {max_linearisations} steps"
    return Reached(np.asarray(value), int(steps), reason)
