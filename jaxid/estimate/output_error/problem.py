"""The output-error problem and its structured linearisation.

Minimise over the shared parameters and each experiment's free initial states

    sum over experiments, samples, channels of ((simulated - measured) / sigma_channel)²  +  priors.

An experiment's residual depends on the shared parameters and on its own initial state only, so only those tangents
are pushed through its rollout (forward mode; experiments and tangents are lanes), and its block of the Jacobian is
reduced by QR to a triangle before it meets the others. What the optimiser sees is the triangular factor of the whole
Jacobian, of the size of the unknowns, with the same cost, gradient and Gauss-Newton matrix as the tall problem.
"""

from dataclasses import fields, replace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import jaxpr_as_fun
from jaxtyping import Bool, Float

from ..._arrays import AnyArray as Array
from ..._arrays import namespace
from ...kernel.dense import triangle_of
from ...robots.robot import Robot
from ...simulation.rollout import Integrator, begins_in_motion, rollout
from .bounds import Bounds, Plain, physical
from .over_experiments import over_experiments

DIVERGED = 1e30
"""Stands in for residuals that are not finite: larger than any sound one, so that the step is rejected."""


CLOCK_OFFSET = "clock_offset"
"""Estimated for every experiment like an initial state: how far the inputs' clock is ahead of the outputs' [s]."""


class Structure(NamedTuple):
    """What a compiled fit depends on besides array shapes: hashable and free of numbers."""

    robot: Robot
    names: tuple[str, ...]
    state_names: tuple[str, ...]
    integrator: Integrator


class Problem(eqx.Module):
    """The numbers of an output-error problem: E experiments, T samples, n parameters, s initial states each.

    Parameters that are not `free` are kept at `held` exactly. Which are free is data, not structure: freeing or holding
    one does not compile anything anew.
    """

    dt: Float[Array, "E T"]
    inputs: Float[Array, "E T nu"]
    outputs: Float[Array, "E T ny"]
    mask: Bool[Array, "E T ny"]
    sigma: Float[Array, " ny"]
    numbers: dict[str, Float[Array, ""]]
    bounds: Bounds
    free: Bool[Array, " n"]
    held: Float[Array, " n"]
    prior_mean: Float[Array, " n"]
    prior_precision: Float[Array, " n"]
    start: dict[str, Float[Array, " E"]]
    state_free: Bool[Array, "E s"]
    state_scale: Float[Array, " s"]
    state_precision: Float[Array, " s"]
    prescribed: dict[str, Float[Array, "E T"]] = eqx.field(default_factory=dict)
    """States that are set to these values at every sample instead of being simulated."""
    weight: Float[Array, "E T ny"] | None = None
    """Square roots of the weights that a robust loss gives to the samples; none for squares."""


def residual_weights(problem: Problem) -> Float[np.ndarray, "E T ny"]:
    """What residuals are multiplied by: one over the noise, times a robust loss's weight, zero where nothing was measured."""
    weights = np.where(np.asarray(problem.mask), 1.0 / np.asarray(problem.sigma), 0.0)
    return weights if problem.weight is None else weights * np.asarray(problem.weight)


def plain(problem: Problem) -> Plain:
    """The problem to be read alone."""

    def numbers(module: Any) -> Plain:
        own = {one.name: getattr(module, one.name) for one in fields(module)}
        return Plain(
            **{name: value if value is None else jax.tree.map(np.asarray, value) for name, value in own.items()}
        )

    found = numbers(problem)
    found.bounds = numbers(problem.bounds)
    return found


def holding(problem: Problem, k: int, value: float) -> Problem:
    """The problem with its k-th parameter held at a value."""
    free, held = np.array(problem.free), np.array(problem.held)
    free[k], held[k] = False, value
    return replace(problem, free=free, held=held)


class Unknowns(NamedTuple):
    """The optimiser's coordinates: `z` of the parameters, `states` in units of their scale, relative to `start`."""

    z: Float[Array, " n"]
    states: Float[Array, "E s"]


class Triangle(NamedTuple):
    """The reduced least-squares problem: arrow-shaped triangular factor of the Jacobian and the reduced residual."""

    shared: Float[Array, "n n"]
    crossed: Float[Array, "E s n"]
    local: Float[Array, "E s s"]
    residual_shared: Float[Array, " n"]
    residual_local: Float[Array, "E s"]
    rest: Float[Array, " 1"]
    squares: Float[Array, "E ny"]
    """Sum of squared weighted residuals by experiment and channel, priors apart."""

    @property
    def cost(self) -> Float[Array, ""]:
        """Half the sum of squares."""
        return 0.5 * sum((part**2).sum() for part in (self.residual_shared, self.residual_local, self.rest))


def shifted(y: Float[Array, "T ny"], dt: Float[Array, " T"], offset: Float[Array, ""]) -> Float[Array, "T ny"]:
    """Outputs `offset` seconds after the sample times, linear between samples, the ends held."""
    time = jnp.cumsum(dt) - dt
    return jax.vmap(lambda channel: jnp.interp(time + offset, time, channel), in_axes=1, out_axes=1)(y)


def _experiment(structure: Structure, problem: Problem, theta, own_states, e):
    """Simulated outputs [T, ny] of one experiment; `e` holds its arrays."""
    dt, inputs, start, prescribed = e
    p = {**problem.numbers, **dict(zip(structure.names, theta, strict=True))}
    moved = {name: start[name] + problem.state_scale[i] * own_states[i] for i, name in enumerate(structure.state_names)}
    moving = begins_in_motion(structure.robot, start)  # whatever the states are moved by
    y = rollout(structure.robot, p, {**start, **moved}, inputs, dt, structure.integrator, prescribed, moving=moving)
    return shifted(y, dt, moved[CLOCK_OFFSET]) if CLOCK_OFFSET in moved else y


def parameters_at(problem: Problem | Plain, z: Float[Array, "*lanes n"]) -> Any:
    """Physical parameters at the optimiser's coordinates, those not free at their held values. NumPy's arrays stay such."""
    theta = physical(problem.bounds, z)
    return namespace(theta).where(problem.free, theta, problem.held)


def simulate_all(structure: Structure, problem: Problem, unknowns: Unknowns) -> Float[Array, "E T ny"]:
    """Simulated outputs of all experiments."""
    theta = parameters_at(problem, unknowns.z)

    def one(own, e):
        return _experiment(structure, problem, theta, own, e)

    return over_experiments(one, unknowns.states, (problem.dt, problem.inputs, problem.start, problem.prescribed))


class Apart(NamedTuple):
    """A cost, half the sum of squares, in parts: by experiment, its own initial states' priors included, and the parameters'
    priors."""

    own: Float[Array, "*lanes E"]
    shared: Float[Array, "*lanes"]


def costs_apart(structure: Structure, problem: Problem, unknowns: Unknowns) -> Apart:
    """Half the sums of squares, priors included, from a simulation alone."""
    y = simulate_all(structure, problem, unknowns)
    residual = jnp.where(problem.mask, (y - problem.outputs) / problem.sigma, 0.0)
    residual = residual if problem.weight is None else residual * problem.weight
    theta = parameters_at(problem, unknowns.z)
    pull = jnp.where(problem.free, problem.prior_precision, 0.0) * (theta - problem.prior_mean) ** 2
    own = jnp.where(problem.state_free, problem.state_precision * problem.state_scale**2, 0.0) * unknowns.states**2
    return Apart(0.5 * (jnp.sum(residual**2, axis=(1, 2)) + jnp.sum(own, axis=1)), 0.5 * jnp.sum(pull))


def cost(structure: Structure, problem: Problem, unknowns: Unknowns) -> Float[Array, ""]:
    """Half the sum of squares, priors included, from a simulation alone."""
    own, shared = costs_apart(structure, problem, unknowns)
    return jnp.sum(own) + shared


def whitened(structure: Structure, problem: Problem, theta, columns, own, own_free, e, measured, mask, robust=None):
    """Weighted residual [T, ny] of one experiment and its sensitivity [T, ny, n + s]; zero where nothing was measured."""
    n, s = len(structure.names), len(structure.state_names)

    def outputs(x):
        return _experiment(structure, problem, x[:n], x[n:], e)

    # One program for primal and tangents: the primal is not repeated for every direction.
    x = jnp.concatenate([theta, own])
    y, tangents = jax.vmap(lambda t: jax.jvp(outputs, (x,), (t,)), out_axes=(None, -1))(jnp.eye(n + s))
    weight = jnp.where(mask, 1.0 / problem.sigma if robust is None else robust / problem.sigma, 0.0)
    residual = jnp.where(mask, (y - measured) * weight, 0.0)
    columns = jnp.concatenate([columns, jnp.where(own_free, 1.0, 0.0)])
    return residual, jnp.where(mask[..., None], tangents * weight[..., None] * columns, 0.0)


def experiments(problem: Problem, unknowns: Unknowns):
    """What `whitened` takes of every experiment."""
    e = (problem.dt, problem.inputs, problem.start, problem.prescribed)
    return unknowns.states, problem.state_free, e, problem.outputs, problem.mask, problem.weight


def sensitivities(structure: Structure, problem: Problem, unknowns: Unknowns):
    """Weighted residuals [E, T, ny] and their derivative [E, T, ny, n + s] by the physical parameters, each free or not,
    and by each experiment's own initial states, in units of their scale."""
    theta = parameters_at(problem, unknowns.z)
    ones = jnp.ones_like(theta)
    return jax.vmap(lambda *own: whitened(structure, problem, theta, ones, *own))(*experiments(problem, unknowns))


def linearise(structure: Structure, problem: Problem, unknowns: Unknowns) -> Triangle:
    """Residual and sensitivities at `unknowns`, reduced to the arrow-shaped triangle."""
    n, s = len(structure.names), len(structure.state_names)
    theta = parameters_at(problem, unknowns.z)
    slope = jnp.where(problem.free, problem.bounds.slope(unknowns.z), 0.0)

    def experiment(own, own_free, *rest):
        residual, jacobian = whitened(structure, problem, theta, slope, own, own_free, *rest)
        squares = jnp.sum(residual**2, axis=0)
        residual, jacobian = residual.reshape(-1), jacobian.reshape(-1, n + s)
        sound = jnp.all(jnp.isfinite(residual)) & jnp.all(jnp.isfinite(jacobian))
        residual = jnp.where(sound, residual, DIVERGED)
        jacobian = jnp.where(sound, jacobian, 0.0)
        block = jnp.concatenate([jacobian[:, n:], jacobian[:, :n], residual[:, None]], axis=1)
        state_prior = jnp.where(own_free, jnp.sqrt(problem.state_precision), 0.0) * problem.state_scale
        prior = jnp.concatenate([jnp.diag(state_prior), jnp.zeros((s, n)), (state_prior * own)[:, None]], axis=1)
        return triangle_of(jnp.concatenate([block, prior])), squares

    triangles, squares = over_experiments(experiment, *experiments(problem, unknowns))
    pull = jnp.sqrt(problem.prior_precision)
    prior = jnp.concatenate([jnp.diag(pull * slope), (pull * (theta - problem.prior_mean))[:, None]], axis=1)
    prior = jnp.where(problem.free[:, None], prior, 0.0)
    stacked = jnp.concatenate([triangles[:, s:, s:].reshape(-1, n + 1), prior])
    shared = triangle_of(stacked)
    return Triangle(
        shared=shared[:n, :n],
        crossed=triangles[:, :s, s : s + n],
        local=triangles[:, :s, :s],
        residual_shared=shared[:n, n],
        residual_local=triangles[:, :s, -1],
        rest=shared[n:, n],
        squares=squares,
    )


def traced_once(structure: Structure, problem: Problem, unknowns: Unknowns):
    """`linearise` as `(unknowns, problem) -> Triangle`, traced here and not at each of the optimiser's several looks, and
    the shapes of its result."""
    closed, shapes = jax.make_jaxpr(linearise, static_argnums=0, return_shape=True)(structure, problem, unknowns)
    run, tree = jax.jit(jaxpr_as_fun(closed)), jax.tree.structure(shapes)
    return lambda u, p: jax.tree.unflatten(tree, run(*jax.tree.leaves((p, u)))), shapes


def reduced_residual(structure: Structure, problem: Problem, unknowns: Unknowns):
    """`(unknowns, problem) -> (residuals, squares)` of the reduced problem, whose derivative comes with its value.

    The residuals (local [E, s], shared [n], rest [1]) have the same sum of squares as the full problem, and their
    derivative is the arrow-shaped triangle: so a generic least-squares solver sees as many rows as unknowns. `squares`
    [E, ny] is auxiliary. The arguments give the shapes for which it is traced.
    """
    look, _ = traced_once(structure, problem, unknowns)

    @jax.custom_jvp
    def residual(unknowns: Unknowns, problem: Problem):
        triangle = look(unknowns, problem)
        return (triangle.residual_local, triangle.residual_shared, triangle.rest), triangle.squares

    def rule(primals, tangents):
        unknowns, problem = primals
        step, _ = tangents
        triangle = look(unknowns, problem)
        local = jnp.einsum("eij,ej->ei", triangle.local, step.states)
        local = local + jnp.einsum("eij,j->ei", triangle.crossed, step.z)
        value = (triangle.residual_local, triangle.residual_shared, triangle.rest), triangle.squares
        return value, (
            (local, triangle.shared @ step.z, jnp.zeros_like(triangle.rest)),
            jnp.zeros_like(triangle.squares),
        )

    residual.defjvp(rule)
    return residual
