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
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..._arrays import array
from .arrow import Eliminated, eliminate, gradient, norms
from .bounds import Bounds
from .chart import Chart, chart_at
from .optimum import Optimum, Outcome
from .problem import Problem, Structure, Triangle, Unknowns, cost, traced_once

_LEAST = 1e-3
"""Damping that even the longest step has: directions whose standard error is above thirty units are hardly moved."""
_STRAIGHT = (jnp.inf, 1.0, 0.1)
_CURVED = (3.0, 1.0, 0.3, 0.03)
"""Lengths of the steps that are tried, in units of the chart. A simulation alone is cheap beside a linearisation, and the
steps run as its lanes."""
CANDIDATES = len(_STRAIGHT) + len(_CURVED)
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
UNDECIDED = -1
"""In place of an outcome: the search goes on."""
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
    scaled = chart_at(problem.bounds, unknowns, triangle).scaled(triangle)
    return _promise(scaled, eliminate(scaled, _LEAST))


class State(NamedTuple):
    """Between two linearisations: `there` is looked at next, `reached`, its `triangle` and its `cost` are the best so far."""

    there: Unknowns
    reached: Unknowns
    triangle: Triangle
    cost: Float[Array, ""]
    start_cost: Float[Array, ""]
    steps: Int[Array, ""]
    stalled: Int[Array, ""]
    promise: Float[Array, ""]
    outcome: Int[Array, ""]
    polished: Int[Array, ""]

    @property
    def optimum(self) -> Optimum:
        """The result, once the outcome is decided."""
        return Optimum(self.reached, self.triangle, self.cost, self.steps, self.outcome, self.start_cost, self.promise)


class Search(NamedTuple):
    """Steps from one linearisation. While it is `going`, the costs at its `candidates` are asked for; `state` is what
    follows if it ends here."""

    state: State
    chart: Chart
    system: Eliminated
    now: Float[Array, ""]
    near: Bool[Array, ""]
    round: Int[Array, ""]
    flat: Bool[Array, ""]
    candidates: Unknowns
    going: Bool[Array, ""]


def _candidates(chart: Chart, system: Eliminated, round: Int[Array, ""]) -> Unknowns:
    """Where the steps of one round lead (leading axis: their lengths)."""
    shrunk = _SHORTER**round

    def both(length):
        step = _step_of(system, shrunk * length)
        return step, system.own_step(step, shrunk)

    first, second = jax.vmap(both)(jnp.array(_STRAIGHT)), jax.vmap(both)(jnp.array(_CURVED))
    straight, curved = jax.vmap(chart.straight)(*first), jax.vmap(chart.curved)(*second)
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b]), straight, curved)


def begin(start: Unknowns, shapes: Triangle) -> State:
    """Before the first linearisation, whose result has the shapes of `shapes`."""
    empty = jax.tree.map(lambda leaf: np.full(leaf.shape, np.inf, leaf.dtype), shapes)
    none, infinite = array(0), array(np.inf)
    return State(start, start, empty, infinite, infinite, none, none, infinite, array(UNDECIDED), none)


def tried(search: Search, costs: Float[Array, " c"]) -> Search:
    """The search once the costs at its candidates are known: it has found a lower one, or all steps shrink, or it is over."""
    now, state = search.now, search.state
    costs = jnp.where(jnp.isfinite(costs), costs, jnp.inf)
    best = jnp.argmin(costs)
    below = costs[best] < now
    there = jax.tree.map(lambda new, old: jnp.where(below, new[best], old), search.candidates, state.there)
    same = jnp.all(~jnp.isfinite(costs) | (jnp.abs(costs - now) <= _ROUNDING * now))
    flat = jnp.where(search.round == 0, same & jnp.any(jnp.isfinite(costs)), search.flat)
    lower = below & ~flat
    going = ~lower & (search.round + 1 < _ROUNDS)
    lost = jnp.where(search.near, Outcome.OPTIMUM, jnp.where(flat, Outcome.INSENSITIVE, Outcome.NO_PROGRESS))
    return search._replace(
        state=state._replace(there=there, outcome=jnp.where(lower | going, UNDECIDED, lost)),
        round=search.round + 1,
        flat=flat,
        candidates=_candidates(search.chart, search.system, search.round + 1),
        going=going,
    )


class BestDampingLevenbergMarquardt(eqx.Module):
    """Levenberg-Marquardt that tries several dampings at every step and takes the best.

    All of it is jaxid's: the units, the step, the bounds, and the stop, which it makes where the linearisation promises no
    drop of the cost above `promise` (some undamped steps follow while each comes closer), or where two steps in a row do
    not lower it by `noticeable` (both in half chi-squared). Any `optimistix` least-squares solver can take its place.
    `report` is called with the cost after every linearisation.

    What is decided between two simulations knows nothing of the robot (`decided`, `tried`), so that it is compiled once
    for all models with as many unknowns, and runs as one program with the simulations (`minimise`) or by turns with them
    (`in_turns`).
    """

    promise: float = _PROMISE
    noticeable: float = _NOTICEABLE
    report: Callable[[Float[Array, ""]], None] | None = None

    def decided(
        self,
        bounds: Bounds,
        free: Bool[Array, " n"],
        state: State,
        triangle: Triangle,
        max_steps: Int[Array, ""] | int,
    ) -> Search:
        """What follows from the linearisation `triangle` at `state.there`: the end, an undamped step, or a search."""
        here, now = state.there, triangle.cost
        if self.report is not None:
            jax.debug.callback(self.report, now)
        chart = chart_at(bounds, here, triangle)
        scaled = chart.scaled(triangle)
        system = eliminate(scaled, _LEAST)
        promise = _promise(scaled, system)
        sound = jnp.all(jnp.isfinite(triangle.squares)) & (now < _UNSOUND)
        first = state.steps == 0
        drop = state.cost - now
        stalled = jnp.where(first | (drop > self.noticeable), 0, state.stalled + 1)
        small = promise < jnp.where(stalled >= _STALLED_STEPS, KINK, self.promise)
        blind = jnp.all(norms(triangle).z == 0.0) & jnp.any(free)
        # Within a standard error of a minimum the search ends and undamped steps begin; the best place counts.
        polishing = (state.polished > 0) | (small & sound & ~blind)
        equal = jnp.abs(now - state.cost) <= _EQUAL
        better = sound & ((now < state.cost - _EQUAL) | (equal & (promise < state.promise)))
        worse = (state.polished > 0) & ~better
        spent = state.polished + jnp.where(worse, _MISS, 1)
        polish = polishing & sound & (promise > _EXACT) & (promise < KINK) & (spent <= _POLISHED)
        outcome = jnp.select(
            [polish, polishing, ~sound, blind, stalled >= _STALLED_STEPS, state.steps >= max_steps],
            [
                UNDECIDED,
                Outcome.OPTIMUM,
                Outcome.DIVERGED,
                Outcome.INSENSITIVE,
                Outcome.NO_PROGRESS,
                Outcome.STEP_LIMIT,
            ],
            UNDECIDED,
        )
        full = system.shared_step(jnp.array(_LEAST))
        straight = chart.straight(full, system.own_step(full))

        def kept(new, old):
            return jax.tree.map(lambda a, b: jnp.where(worse, b, a), new, old)

        following = State(
            there=jax.tree.map(lambda new, old: jnp.where(polish, new, old), straight, here),
            reached=kept(here, state.reached),
            triangle=kept(triangle, state.triangle),
            cost=kept(now, state.cost),
            start_cost=jnp.where(first, now, state.start_cost),
            steps=state.steps + 1,
            stalled=stalled,
            promise=kept(promise, state.promise),
            outcome=outcome,
            polished=jnp.where(polish, spent, state.polished),
        )
        return Search(
            state=following,
            chart=chart,
            system=system,
            now=now,
            near=promise < KINK,
            round=jnp.array(0),
            flat=jnp.array(False),
            candidates=_candidates(chart, system, jnp.array(0)),
            going=(outcome == UNDECIDED) & ~polish,
        )

    def minimise(
        self, structure: Structure, problem: Problem, start: Unknowns, max_steps: Int[Array, ""] | int
    ) -> Optimum:
        """Minimise from `start`. Pure: runs under `jax.jit` and `jax.vmap`."""
        look, shapes = traced_once(structure, problem, start)

        def costs(search: Search) -> Search:
            return tried(search, jax.vmap(lambda there: cost(structure, problem, there))(search.candidates))

        def step(state: State) -> State:
            search: Any = self.decided(problem.bounds, problem.free, state, look(state.there, problem), max_steps)
            return jax.lax.while_loop(lambda search: search.going, costs, search).state

        end = jax.lax.while_loop(lambda state: state.outcome == UNDECIDED, step, begin(start, shapes))
        return end.optimum
