"""Levenberg-Marquardt on the reduced output-error problem, by optimistix.

Coordinates are in units of the parameters' typical values and residuals in units of the noise, so that the damping
(identity, starting at one) is a weak pull towards the last iterate for directions that the data hardly determines and
nothing for those it does. The stopping rule asks that no coordinate moves by more than `tolerance` of its typical value
and no reduced residual by more than `tolerance` of the noise: a step below a thousandth of a standard error.
"""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import lineax as lx
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from .problem import Problem, Structure, Triangle, Unknowns, reduced_residual


class Optimum(NamedTuple):
    """Where an optimisation stopped. `triangle` is the linearisation at `unknowns`."""

    unknowns: Unknowns
    triangle: Triangle
    cost: Float[Array, ""]
    iterations: Int[Array, ""]
    converged: Bool[Array, ""]

    @property
    def diverged(self) -> Bool[Array, ""]:
        """Whether the simulation is not finite even at the best point (of every lane)."""
        return ~jnp.all(jnp.isfinite(self.triangle.squares), axis=(-2, -1))


def _materialise(jac: lx.AbstractLinearOperator, unknowns: Unknowns) -> tuple[Array, Array, Array]:
    """shared, crossed and local blocks of the triangle inside optimistix's linear operator."""
    E, s = unknowns.states.shape
    n = unknowns.z.shape[0]
    zero = Unknowns(jnp.zeros(n), jnp.zeros((E, s)))
    by_z = jax.vmap(lambda t: jac.mv(zero._replace(z=t)), out_axes=-1)(jnp.eye(n))
    by_state = jax.vmap(lambda t: jac.mv(zero._replace(states=jnp.broadcast_to(t, (E, s)))), out_axes=-1)(jnp.eye(s))
    return by_z[1], by_z[0], by_state[0]


def minimise(
    structure: Structure, problem: Problem, start: Unknowns, *, max_steps: int = 100, tolerance: float = 1e-3
) -> Optimum:
    """Minimise from `start`. Pure: works under `jax.jit` and `jax.vmap` (over starts, or over whole problems)."""
    residual = reduced_residual(structure)
    solver = optx.LevenbergMarquardt(rtol=1e-5, atol=tolerance, linear_solver=lx.QR())
    solution = optx.least_squares(
        residual, solver, start, args=problem, has_aux=True, max_steps=max_steps, throw=False, options={"jac": "fwd"}
    )
    info = solution.state.f_info
    local, shared, rest = info.residual
    R_shared, crossed, R_local = _materialise(info.jac, start)
    # `solution.aux` is one step behind; the state's belongs to the values returned.
    triangle = Triangle(R_shared, crossed, R_local, shared, local, rest, solution.state.aux)
    return Optimum(
        unknowns=solution.value,
        triangle=triangle,
        cost=triangle.cost,
        iterations=solution.stats["num_steps"],
        # A simulation that diverges at the start has no derivative, and the optimiser takes that for a minimum.
        converged=(solution.result == optx.RESULTS.successful) & jnp.all(jnp.isfinite(triangle.squares)),
    )


minimise_compiled = jax.jit(minimise, static_argnames=("structure", "max_steps", "tolerance"))


@partial(jax.jit, static_argnames=("structure", "max_steps", "tolerance"))
def minimise_lanes(
    structure: Structure, problem: Problem, starts: Unknowns, *, max_steps: int = 100, tolerance: float = 1e-3
) -> Optimum:
    """`minimise` from many starts (leading axis of `starts`) in one compiled batch."""
    return jax.vmap(lambda y: minimise(structure, problem, y, max_steps=max_steps, tolerance=tolerance))(starts)
