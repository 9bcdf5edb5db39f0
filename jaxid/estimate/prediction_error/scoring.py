"""Fisher scoring: damped Newton steps with the expected second derivative of -log L.

Every linearisation is followed by several damped steps at once, tried as lanes by the filter alone. Damping is in units of
the information's own diagonal (Marquardt, J. SIAM 11, 1963), so that no unit of any unknown matters.
"""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ..._compile import compiled
from ...kernel.dense import orthogonal_columns
from .filter import Model
from .likelihood import Look, Problem, cost, look

_DAMPINGS = (1e-4, 0.03, 0.3, 3.0, 30.0)
"""Tried at every step, in units of the information's diagonal."""
_STRONGER = 1e4
"""Factor by which all of them grow when none lowers the cost."""
_PROMISE = 5e-7
"""Promised drop of -log L below which the optimum is reached: a thousandth of a standard error."""
_NOTICEABLE = 1e-3
_STALLED_STEPS = 2
_LONGEST = 2.0
"""Largest change of a noise's logarithm in a step."""
QUIETEST, _LOUDEST = -12.0, 12.0
"""Logarithms of a noise, relative to its reference, beyond which it is not followed."""


class Optimum(NamedTuple):
    """Where scoring stopped: coordinates [p], the look there, iterations, and whether it converged."""

    x: Float[Array, " p"]
    look: Look
    iterations: Int[Array, ""]
    converged: Bool[Array, ""]


def _limits(problem: Problem):
    """Least and largest coordinates [p]."""
    noises = problem.process_reference.shape[0] + problem.sensor_reference.shape[0]
    quiet, loud = jnp.full(noises, QUIETEST), jnp.full(noises, _LOUDEST)
    return jnp.concatenate([problem.lower / problem.scale, quiet]), jnp.concatenate(
        [problem.upper / problem.scale, loud]
    )


class _Scaled(NamedTuple):
    """Gradient and information in units of the information's diagonal; zero for directions that stay where they are: those
    without information, and those in which a parameter on its bound is pushed outwards."""

    unit: Float[Array, " p"]
    gradient: Float[Array, " p"]
    information: Float[Array, "p p"]

    def step(self, damping) -> Float[Array, " p"]:
        """The damped scoring step in these units."""
        columns, right = orthogonal_columns(self.information + damping * jnp.eye(self.unit.size))
        return -(columns @ self.gradient / jnp.sum(columns**2, axis=1)) @ right

    @property
    def promise(self) -> Float[Array, ""]:
        """Drop of the cost that the least damped step promises."""
        return -0.5 * self.gradient @ self.step(_DAMPINGS[0])


def _scaled(problem: Problem, x: Float[Array, " p"], here: Look) -> _Scaled:
    low, high = _limits(problem)
    outwards = ((x <= low) & (here.gradient > 0)) | ((x >= high) & (here.gradient < 0))
    diagonal = jnp.where(outwards, 0.0, jnp.diagonal(here.information))
    unit = jnp.where(diagonal > 0, 1.0 / jnp.sqrt(jnp.where(diagonal > 0, diagonal, 1.0)), 0.0)
    return _Scaled(unit, unit * here.gradient, here.information * unit[:, None] * unit[None, :])


def _moved(problem: Problem, x: Float[Array, " p"], scaled: _Scaled, damping) -> Float[Array, " p"]:
    """Where a damped step leads, kept within the bounds."""
    step = scaled.unit * scaled.step(damping)
    longest = jnp.max(jnp.abs(step[problem.held.shape[0] :]))
    return jnp.clip(x + step * jnp.minimum(1.0, _LONGEST / jnp.maximum(longest, 1e-300)), *_limits(problem))


def minimise(
    names: tuple[str, ...], model: Model, problem: Problem, start: Float[Array, " p"], *, max_steps
) -> Optimum:
    """Minimise -log L from `start`; without any steps, the look there. Runs under `jit` and `vmap`."""

    def unfinished(state):
        return ~state[2]

    def improve(state):
        # Looks first, so that the whole program holds one linearisation; the last round only looks.
        x, _, _, stalled, steps, stronger = state
        here = look(names, model, problem, x)
        scaled = _scaled(problem, x, here)
        settled = (scaled.promise <= _PROMISE) | (stalled >= _STALLED_STEPS) | (stronger >= _STRONGER**3)
        done = settled | (steps >= max_steps)
        there = jax.vmap(lambda d: _moved(problem, x, scaled, d * stronger))(jnp.array(_DAMPINGS))
        costs = jax.vmap(lambda y: cost(names, model, problem, y))(there)
        best = jnp.argmin(costs)
        drop = here.cost - costs[best]
        better = ~done & (drop > 0)
        noticed = better & (drop > _NOTICEABLE)
        return (
            jnp.where(better, there[best], x),
            here,
            done,
            jnp.where(noticed | done, 0, stalled + 1),
            jnp.where(done, steps, steps + 1),
            jnp.where(better | done, 1.0, stronger * _STRONGER),
        )

    zero, p = jnp.zeros((), dtype=int), start.shape[0]
    nothing = Look(jnp.zeros(()), jnp.zeros(p), jnp.zeros((p, p)))
    x, here, _, _, steps, _ = jax.lax.while_loop(
        unfinished, improve, (start, nothing, jnp.array(False), zero, zero, jnp.ones(()))
    )
    return Optimum(x, here, steps, jnp.any(here.information != 0) & (steps < max_steps))


@partial(compiled, static_argnames=("names", "model"))
def minimise_compiled(names, model, problem, start, *, max_steps=100) -> Optimum:
    """`minimise`, compiled."""
    return minimise(names, model, problem, start, max_steps=max_steps)


@partial(compiled, static_argnames=("names", "model"))
def costs_at(names, model, problem, xs: Float[Array, "L p"]) -> Float[Array, " L"]:
    """-log L at many points, as lanes."""
    return jax.vmap(lambda x: cost(names, model, problem, x))(xs)


@partial(compiled, static_argnames=("names", "model", "lanes"))
def minimise_lanes(names, model, problem, own, starts: Float[Array, "N p"], *, lanes=32, max_steps=60) -> Optimum:
    """N problems that differ from `problem` in the fields `own` of their records (leading axis N), `lanes` at a time."""
    N = starts.shape[0]
    chunks = -(-N // lanes)
    numbers = jnp.arange(chunks * lanes).reshape(chunks, lanes) % N

    def one(number):
        fields = {name: leaf[number] for name, leaf in own.items()}
        mine = replace(problem, records=problem.records._replace(**fields))
        return minimise(names, model, mine, starts[number], max_steps=max_steps)

    found = jax.lax.map(jax.vmap(one), numbers)
    return jax.tree.map(lambda leaf: leaf.reshape(chunks * lanes, *leaf.shape[2:])[:N], found)
