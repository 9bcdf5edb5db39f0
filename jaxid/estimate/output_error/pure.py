"""Output error as a pure function: arrays in, arrays out, under `jax.jit`, `jax.vmap` and inside other programs.

    with jaxid.float64():
        problem, start = jaxid.output_error_problem(robot, logs)
        fits = jax.jit(jax.vmap(lambda y: jaxid.minimise(problem.with_outputs(y), start)))(noisy)   # [N, E, T, ny]

What `output_error` does beyond this (other starts after a poor minimum, parameters put on bounds, judgement of the residual)
takes decisions in Python; where none of it is needed, both give the same numbers.
"""

from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh, NamedSharding, PartitionSpec, use_abstract_mesh
from jaxtyping import Array, Float, Int

from ..._arrays import array
from ..._float64 import in_float64
from ...kernel.dense import orthogonal_columns
from ...logs import LogSet
from ...robots.given import check_choice, given_logs
from ...robots.robot import Robot
from ...simulation.rollout import Integrator
from ..result import Fit
from .from_optimum import channel_noise
from .lanes import BY_LOG, padded
from .over_experiments import AXIS
from .problem import Problem, Structure, Unknowns, parameters_at, simulate_all
from .setup import InitialStates, build, start_values
from .solvers import DEFAULT, Solver
from .solvers import minimise as minimise_weighted

WEIGHT_ROUNDS = 6
"""Most times that the channels' noise is estimated anew."""
WEIGHT_SETTLED = 0.01
"""Relative change of the noise below which it stands."""
WEIGHT_FLOOR = 1e-3
"""Noise of a channel, in units of what its data shows, below which no residual takes it."""
_RANK = 1e-9


class OutputErrorProblem(eqx.Module):
    """An output-error problem of E experiments, T samples, ny measured channels and n free parameters (`names`).

    `arrays` are its numbers; all may be changed, or be a lane's own. `mesh`: the devices that share the experiments
    (`shared_out`), None for one.
    """

    structure: Structure = eqx.field(static=True)
    arrays: Problem
    mesh: Mesh | None = eqx.field(static=True, default=None)

    @property
    def names(self) -> tuple[str, ...]:
        """Symbols of the free parameters, in the order of all vectors of n."""
        return self.structure.names

    def with_outputs(self, outputs: Float[Array, "E T ny"]) -> "OutputErrorProblem":
        """The same problem with other measurements."""
        return OutputErrorProblem(self.structure, replace(self.arrays, outputs=outputs), self.mesh)

    def shared_out(self, start: Unknowns, mesh: Mesh) -> "tuple[OutputErrorProblem, Unknowns]":
        """The same problem and `start` on the devices of `mesh`, whose axis "experiments" the experiments lie along.

        Every device simulates, differentiates and reduces its own experiments; what goes between devices is of the size of
        the unknowns. Experiments that do not count fill up the last device's. In a program of several processes
        (`jax.distributed`) each makes the whole problem and keeps its devices' part. Call under `jaxid.float64()`. Raises
        `ValueError` for a mesh without that axis.
        """
        if AXIS not in mesh.axis_names:
            raise ValueError(f"the mesh has the axes {mesh.axis_names}; name one of them {AXIS!r}.")
        E, T = self.arrays.dt.shape
        arrays, unknowns = padded(self.arrays, start, -(-E // mesh.shape[AXIS]) * mesh.shape[AXIS], T)

        def placed(leaf: Any, along: bool) -> Array:
            value = np.asarray(leaf)
            sharding = NamedSharding(mesh, PartitionSpec(AXIS) if along else PartitionSpec())
            return jax.make_array_from_callback(value.shape, sharding, lambda part: value[part])

        arrays = jax.tree.map_with_path(lambda path, leaf: placed(leaf, path[0].name in BY_LOG), arrays)
        unknowns = Unknowns(placed(unknowns.z, False), placed(unknowns.states, True))
        return OutputErrorProblem(self.structure, arrays, mesh), unknowns

    def at(self, parameters: Float[Array, " n"], start: Unknowns) -> Unknowns:
        """`start` with other parameters [SI or the logs' units]."""
        return start._replace(z=self.arrays.bounds.coordinates(parameters))

    def simulate(self, unknowns: Unknowns) -> Float[Array, "E T ny"]:
        """Simulated outputs; differentiable in forward mode."""
        with _on(self.mesh):
            return simulate_all(self.structure, self.arrays, unknowns)


class Minimum(NamedTuple):
    """Where a fit ended.

    - `parameters` [n] and their `covariance` [n, n] for white residuals; `noise` [ny]: standard deviation of each channel's
      residual.
    - `cost`: half the sum of squared residuals in units of that noise; `start_cost`: where the last minimisation began.
    - `outcome`: an `Outcome` as an integer, 0 for a minimum; `unknowns`: parameters' coordinates and initial states.
    """

    parameters: Float[Array, " n"]
    covariance: Float[Array, "n n"]
    noise: Float[Array, " ny"]
    cost: Float[Array, ""]
    start_cost: Float[Array, ""]
    outcome: Int[Array, ""]
    unknowns: Unknowns


@in_float64
def output_error_problem(
    robot: Robot,
    logs: LogSet,
    *,
    start: Fit | Mapping[str, float] | None = None,
    initial_states: InitialStates = "auto",
    integrator: Integrator | None = None,
) -> tuple[OutputErrorProblem, Unknowns]:
    """The problem that `output_error` solves, and where it starts. Arguments and errors are those of `output_error`."""
    logs = given_logs(robot, logs)
    check_choice("initial_states", initial_states, InitialStates)
    structure, problem, unknowns = build(
        robot, logs, start=start_values(robot, start), initial=initial_states, integrator=integrator
    )
    problem, unknowns = jax.tree.map(array, (problem, unknowns))  # whatever precision they are used in
    return OutputErrorProblem(structure, problem), unknowns


def _covariance(problem: Problem, shared: Float[Array, "n n"]) -> Float[Array, "n n"]:
    """(JᵀJ)⁻¹ of the physical parameters; nothing for directions that the data leaves open."""
    norms = jnp.linalg.norm(shared, axis=0)
    used = jnp.where(norms > 0, norms, 1.0)
    columns, right = orthogonal_columns(shared / used)
    values = jnp.linalg.norm(columns, axis=1)
    sound = values > _RANK * jnp.max(values, initial=0.0)
    shares = jnp.where(sound, 1.0 / jnp.where(sound, values, 1.0), 0.0)[:, None] * right
    scale = problem.bounds.scale / used
    return shares.T @ shares * jnp.outer(scale, scale)


def minimise(
    problem: OutputErrorProblem, start: Unknowns, *, max_steps: Int[Array, ""] | int = 100, solver: Solver = DEFAULT
) -> Minimum:
    """Minimise from `start`, every channel's noise being estimated along the way. Call under `jaxid.float64()`."""
    with _on(problem.mesh):
        found = _minimise(problem.structure, problem.arrays, start, max_steps, solver)
        if problem.mesh is None:
            return found
        shares: Any = jax.tree.map(lambda _: PartitionSpec(), found)
        shares = shares._replace(unknowns=shares.unknowns._replace(states=PartitionSpec(AXIS)))
        return jax.lax.with_sharding_constraint(found, shares)


def _on(mesh: Mesh | None) -> Any:
    """The devices that simulations inside are shared out to."""
    return nullcontext() if mesh is None else use_abstract_mesh(mesh.abstract_mesh)


def _minimise(
    structure: Structure, arrays: Problem, start: Unknowns, max_steps: Int[Array, ""] | int, solver: Solver
) -> Minimum:

    def unsettled(carry: Any):
        _, _, _, rounds, change, _ = carry
        return (rounds == 0) | ((change >= WEIGHT_SETTLED) & (rounds <= WEIGHT_ROUNDS))

    def again(carry: Any):
        unknowns, _, sigma, rounds, _, _ = carry
        weighted = replace(arrays, sigma=sigma)
        optimum = minimise_weighted(structure, weighted, unknowns, max_steps=max_steps, solver=solver)
        noise = channel_noise(weighted, optimum.triangle.squares)
        following = jnp.where(jnp.isfinite(noise), jnp.maximum(noise, arrays.sigma * WEIGHT_FLOOR), sigma)
        change = jnp.max(jnp.abs(following / sigma - 1.0))
        return optimum.unknowns, sigma, following, rounds + 1, change, (optimum, noise)

    zero = jax.tree.map(
        lambda leaf: jnp.zeros(leaf.shape, leaf.dtype),
        jax.eval_shape(lambda: again((start, arrays.sigma, arrays.sigma, jnp.array(0), jnp.array(0.0), None))[-1]),
    )
    begin = (start, arrays.sigma, arrays.sigma, jnp.array(0), jnp.array(jnp.inf), zero)
    unknowns, *_, (optimum, noise) = jax.lax.while_loop(unsettled, again, begin)
    return Minimum(
        parameters=parameters_at(arrays, unknowns.z),
        covariance=_covariance(arrays, optimum.triangle.shared),
        noise=noise,
        cost=optimum.cost,
        start_cost=optimum.start_cost,
        outcome=optimum.outcome,
        unknowns=unknowns,
    )
