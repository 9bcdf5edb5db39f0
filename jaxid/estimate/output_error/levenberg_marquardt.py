"""Levenberg-Marquardt with the best of several damped steps, on the reduced output-error problem.

Units are those of `chart`, so that the damping is a weak pull towards the last iterate for directions that the data hardly
determines and nothing for those it does, whatever the parameters' units. Sticking friction puts small kinks into the
cost, and the caster's flips large ones, on which the usual schedule of one damping after another takes many
linearisations; so every step tries several dampings at once, by simulation, and linearises at the best. A damping is
chosen by the length of the step that it allows (Moré, Lecture Notes in Mathematics 630, 1978).

Parameters on a bound that the cost pushes them against are held there (projection: Bertsekas, SIAM Journal on Control and
Optimization 20, 1982).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from .arrow import Eliminated, eliminate, gradient, norms
from .chart import Chart, chart_at
from .optimum import Optimum, Outcome
from .problem import Problem, Structure, Triangle, Unknowns, cost, traced_once

_LEAST = 1e-3
"""Damping that even the longest step has: directions whose standard error is above thirty units are hardly moved."""
_STRAIGHT = (jnp.inf, 1.0, 0.1)
_CURVED = (3.0, 1.0, 0.3, 0.03)
"""Lengths of the steps that are tried, in units of the chart. A simulation alone is cheap beside a linearisation, and the
steps run as its lanes."""
_SHORTER = 0.01
_ROUNDS = 4
"""How often all of them shrink, and by what factor, while none lowers the cost."""
_BISECTIONS = 40
_PROMISE = 5e-7
"""Promised drop of the cost below which the optimum is reached: a thousandth of a standard error."""
_EXACT = 1e-14
"""Promised drop of the cost below which undamped steps end: a ten-millionth of a standard error."""
_POLISHED, _MISS = 8, 3
"""How many of them there are at most; one that leads to nothing better counts for three."""
_EQUAL = 1e-9
"""Difference of costs that rounding may make."""
_NOTICEABLE = 0.01
"""Drop of the cost (half chi-squared) that counts as progress."""
_STALLED_STEPS = 2
KINK = 0.5
"""Promised drop of the cost, that of one standard error, up to which a point that no step improves is a minimum: kinks such
as sticking makes promise a little for ever."""
_ROUNDING = 1e-10
"""Relative change of the cost that is none: the simulation does not feel the parameters."""
_UNDECIDED = -1
_UNSOUND = 1e50
"""Cost that only a simulation or a sensitivity has that is not finite."""


def _step_of(system: Eliminated, length: Float[Array, ""]) -> Float[Array, " n"]:
    """The damped step of the shared unknowns that is no longer than `length`."""
    pull = jnp.linalg.norm(system.pull)
    ends = jnp.log(_LEAST), jnp.log(jnp.maximum(pull / length, _LEAST))

    def halve(_, ends):
        low, high = ends
        middle = 0.5 * (low + high)
        long = jnp.linalg.norm(system.pull / (system.values**2 + jnp.exp(middle))) > length
        return jnp.where(long, middle, low), jnp.where(long, high, middle)

    _, high = jax.lax.fori_loop(0, _BISECTIONS, halve, ends)
    return system.shared_step(jnp.exp(high))


def _promise(scaled: Triangle, system: Eliminated) -> Float[Array, ""]:
    """Drop of the cost (half chi-squared) that the longest step promises: -½ (Jᵀ r) · step, what the step itself may cost by
    its damping left out."""
    slope, step = gradient(scaled), system.shared_step(jnp.array(_LEAST))
    return -0.5 * (jnp.sum(slope.z * step) + jnp.sum(slope.states * system.own_step(step)))


def promise_of(problem: Problem, unknowns: Unknowns, triangle: Triangle) -> Float[Array, ""]:
    """Drop of the cost (half chi-squared) that a linearisation promises, bounds respected."""
    scaled = chart_at(problem, unknowns, triangle).scaled(triangle)
    return _promise(scaled, eliminate(scaled, _LEAST))


class _Search(NamedTuple):
    round: Int[Array, ""]
    lowest: Float[Array, ""]
    there: Unknowns
    lower: Bool[Array, ""]
    flat: Bool[Array, ""]


class _State(NamedTuple):
    there: Unknowns
    reached: Unknowns
    triangle: Triangle
    start_cost: Float[Array, ""]
    steps: Int[Array, ""]
    stalled: Int[Array, ""]
    promise: Float[Array, ""]
    outcome: Int[Array, ""]
    polished: Int[Array, ""]


class BestDampingLevenbergMarquardt(eqx.Module):
    """Levenberg-Marquardt that tries several dampings at every step and takes the best.

    All of it is jaxid's: the units, the step, the bounds, and the stop, which it makes where the linearisation promises no
    drop of the cost above `promise` (some undamped steps follow while each comes closer), or where two steps in a row do
    not lower it by `noticeable` (both in half chi-squared). Any `optimistix` least-squares solver can take its place.
    `report` is called with the cost after every linearisation.
    """

    promise: float = _PROMISE
    noticeable: float = _NOTICEABLE
    report: Callable[[Float[Array, ""]], None] | None = None

    def minimise(
        self, structure: Structure, problem: Problem, start: Unknowns, max_steps: Int[Array, ""] | int
    ) -> Optimum:
        """Minimise from `start`. Pure: runs under `jax.jit` and `jax.vmap`."""
        look, shapes = traced_once(structure, problem, start)
        empty = jax.tree.map(lambda leaf: jnp.full(leaf.shape, jnp.inf, leaf.dtype), shapes)
        linear, bent = jnp.array(_STRAIGHT), jnp.array(_CURVED)

        def search(chart: Chart, system: Eliminated, now: Float[Array, ""]) -> _Search:
            def again(state: _Search):
                return ~state.lower & (state.round < _ROUNDS)

            def round(state: _Search) -> _Search:
                shrunk = _SHORTER**state.round

                def both(length):
                    step = _step_of(system, shrunk * length)
                    return step, system.own_step(step, shrunk)

                first, second = jax.vmap(both)(linear), jax.vmap(both)(bent)
                candidates = jax.tree.map(
                    lambda a, b: jnp.concatenate([a, b]),
                    jax.vmap(chart.straight)(*first),
                    jax.vmap(chart.curved)(*second),
                )
                costs = jax.vmap(lambda there: cost(structure, problem, there))(candidates)
                costs = jnp.where(jnp.isfinite(costs), costs, jnp.inf)
                best = jnp.argmin(costs)
                lower = costs[best] < now
                there = jax.tree.map(lambda new, old: jnp.where(lower, new[best], old), candidates, state.there)
                same = jnp.all(~jnp.isfinite(costs) | (jnp.abs(costs - now) <= _ROUNDING * now))
                flat = jnp.where(state.round == 0, same & jnp.any(jnp.isfinite(costs)), state.flat)
                return _Search(state.round + 1, jnp.where(lower, costs[best], now), there, lower & ~flat, flat)

            nothing = _Search(jnp.array(0), now, chart.here, jnp.array(False), jnp.array(False))
            return jax.lax.while_loop(again, round, nothing)

        def step(state: _State) -> _State:
            here = state.there
            triangle = look(here, problem)
            now = triangle.cost
            if self.report is not None:
                jax.debug.callback(self.report, now)
            chart = chart_at(problem, here, triangle)
            scaled = chart.scaled(triangle)
            system = eliminate(scaled, _LEAST)
            promise = _promise(scaled, system)
            sound = jnp.all(jnp.isfinite(triangle.squares)) & (now < _UNSOUND)
            first = state.steps == 0
            drop = state.triangle.cost - now
            stalled = jnp.where(first | (drop > self.noticeable), 0, state.stalled + 1)
            small = promise < jnp.where(stalled >= _STALLED_STEPS, KINK, self.promise)
            blind = jnp.all(norms(triangle).z == 0.0) & jnp.any(problem.free)
            # Within a standard error of a minimum the search ends and undamped steps begin; the best place counts.
            polishing = (state.polished > 0) | (small & sound & ~blind)
            equal = jnp.abs(now - state.triangle.cost) <= _EQUAL
            better = sound & ((now < state.triangle.cost - _EQUAL) | (equal & (promise < state.promise)))
            worse = (state.polished > 0) & ~better
            spent = state.polished + jnp.where(worse, _MISS, 1)
            polish = polishing & sound & (promise > _EXACT) & (promise < KINK) & (spent <= _POLISHED)
            outcome = jnp.select(
                [polish, polishing, ~sound, blind, stalled >= _STALLED_STEPS, state.steps >= max_steps],
                [
                    _UNDECIDED,
                    Outcome.OPTIMUM,
                    Outcome.DIVERGED,
                    Outcome.INSENSITIVE,
                    Outcome.NO_PROGRESS,
                    Outcome.STEP_LIMIT,
                ],
                _UNDECIDED,
            )
            full = system.shared_step(jnp.array(_LEAST))
            polished = jax.tree.map(
                lambda new, old: jnp.where(polish, new, old), chart.straight(full, system.own_step(full)), here
            )
            found = jax.lax.cond(
                (outcome == _UNDECIDED) & ~polish,
                lambda: search(chart, system, now),
                lambda: _Search(jnp.array(0), now, polished, jnp.array(True), jnp.array(False)),
            )
            lost = jnp.where(found.flat, Outcome.INSENSITIVE, Outcome.NO_PROGRESS)
            lost = jnp.where(promise < KINK, Outcome.OPTIMUM, lost)

            def kept(new, old):
                return jax.tree.map(lambda a, b: jnp.where(worse, b, a), new, old)

            return _State(
                there=found.there,
                reached=kept(here, state.reached),
                triangle=kept(triangle, state.triangle),
                start_cost=jnp.where(first, now, state.start_cost),
                steps=state.steps + 1,
                stalled=stalled,
                promise=kept(promise, state.promise),
                outcome=jnp.where(found.lower, outcome, lost),
                polished=jnp.where(polish, spent, state.polished),
            )

        infinite = jnp.array(jnp.inf)
        begin: Any = _State(
            start, start, empty, infinite, jnp.array(0), jnp.array(0), infinite, jnp.array(_UNDECIDED), jnp.array(0)
        )  # fmt: skip
        end = jax.lax.while_loop(lambda state: state.outcome == _UNDECIDED, step, begin)
        return Optimum(
            unknowns=end.reached,
            triangle=end.triangle,
            cost=end.triangle.cost,
            iterations=end.steps,
            outcome=end.outcome,
            start_cost=end.start_cost,
            promise=end.promise,
        )
