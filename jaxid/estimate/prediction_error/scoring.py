"""Fisher scoring: damped Newton steps with the expected second derivative of -log L.

Every linearisation is followed by several damped steps at once, tried as lanes by the filter alone. Damping is in units of
the information's own diagonal (Marquardt, J. SIAM 11, 1963), so that no unit of any unknown matters.
"""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..._arrays import AnyArray, array
from ..._compile import compiled
from ...kernel.dense import orthogonal_columns
from .filter import Model
from .likelihood import Look, Problem, cost, look, reduced, samples

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


class _State(NamedTuple):
    """Between two linearisations: where to look next, whether it is over, and how the search goes."""

    x: Float[Array, " p"]
    done: Bool[Array, ""]
    stalled: Int[Array, ""]
    steps: Int[Array, ""]
    stronger: Float[Array, ""]


def _begin(start: Float[Array, " p"]) -> _State:
    return _State(start, array(False), array(0), array(0), array(1.0))


def _planned(problem: Problem, state: _State, here: Look, max_steps) -> tuple[Bool[Array, ""], Float[Array, "d p"]]:
    """Whether the search is over at `state.x`, where `here` was seen, and where its damped steps lead."""
    scaled = _scaled(problem, state.x, here)
    settled = (scaled.promise <= _PROMISE) | (state.stalled >= _STALLED_STEPS) | (state.stronger >= _STRONGER**3)
    there = jax.vmap(lambda d: _moved(problem, state.x, scaled, d * state.stronger))(jnp.array(_DAMPINGS))
    return settled | (state.steps >= max_steps), there


def _taken(state: _State, here: Look, done: Bool[Array, ""], there: Float[Array, "d p"], costs: Float[Array, " d"]):
    """The state after the best of the steps, whose costs are known."""
    best = jnp.argmin(costs)
    drop = here.cost - costs[best]
    better = ~done & (drop > 0)
    noticed = better & (drop > _NOTICEABLE)
    return _State(
        x=jnp.where(better, there[best], state.x),
        done=done,
        stalled=jnp.where(noticed | done, 0, state.stalled + 1),
        steps=jnp.where(done, state.steps, state.steps + 1),
        stronger=jnp.where(better | done, 1.0, state.stronger * _STRONGER),
    )


def _optimum(state: _State, here: Look, max_steps) -> Optimum:
    return Optimum(state.x, here, state.steps, jnp.any(here.information != 0) & (state.steps < max_steps))


def minimise(
    names: tuple[str, ...], model: Model, problem: Problem, start: Float[Array, " p"], *, max_steps
) -> Optimum:
    """Minimise -log L from `start`; without any steps, the look there. Runs under `jit` and `vmap`."""

    def improve(carry):
        # Looks first, so that the whole program holds one linearisation; the last round only looks.
        state, _ = carry
        here = look(names, model, problem, state.x)
        done, there = _planned(problem, state, here, max_steps)
        costs = jax.vmap(lambda y: cost(names, model, problem, y))(there)
        return _taken(state, here, done, there, costs), here

    p = start.shape[0]
    nothing = Look(jnp.zeros(()), jnp.zeros(p), jnp.zeros((p, p)))
    state, here = jax.lax.while_loop(lambda carry: ~carry[0].done, improve, (_begin(start), nothing))
    return _optimum(state, here, max_steps)


seen_at = compiled(samples, static_argnames=("names", "model"))
"""`likelihood.samples`, compiled: one program of a model for optimiser, intervals and residuals."""
_reduced = compiled(reduced)
_planned_compiled = compiled(_planned)
_taken_compiled = compiled(_taken)


@partial(compiled, static_argnames=("names", "model"))
def _costs(names, model, problem, xs: Float[Array, "d p"]) -> Float[Array, " d"]:
    return jax.vmap(lambda x: cost(names, model, problem, x))(xs)


def look_at(names: tuple[str, ...], model: Model, problem: Problem, x: Float[AnyArray, " p"]) -> Look:
    """`likelihood.look` by the compiled parts."""
    return _reduced(problem, x, seen_at(names, model, problem, x))


def minimise_in_turns(
    names: tuple[str, ...], model: Model, problem: Problem, start: Float[AnyArray, " p"], *, max_steps: int = 100
) -> Optimum:
    """`minimise`, with Python between its compiled parts: of a model its filter and its sensitivities alone are compiled,
    once for all that is asked of them."""
    state = _begin(array(start))
    while True:
        here = look_at(names, model, problem, state.x)
        done, there = _planned_compiled(problem, state, here, max_steps)
        if bool(done):
            return _optimum(state, here, max_steps)
        state = _taken_compiled(state, here, done, there, _costs(names, model, problem, there))


def costs_at(
    names: tuple[str, ...], model: Model, problem: Problem, xs: Float[np.ndarray, "L p"]
) -> Float[np.ndarray, " L"]:
    """-log L at many points, by the program that the optimiser runs."""
    together = len(_DAMPINGS)
    filled = np.concatenate([xs, np.repeat(xs[-1:], -len(xs) % together, axis=0)])
    parts = [_costs(names, model, problem, part) for part in filled.reshape(-1, together, xs.shape[1])]
    return np.concatenate([np.asarray(part) for part in parts])[: len(xs)]


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
