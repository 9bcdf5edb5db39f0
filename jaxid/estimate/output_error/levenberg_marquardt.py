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
from jaxtyping import Bool, Float, Int

from ..._arrays import AnyArray as Array
from ..._arrays import chosen, namespace, surely_not
from .arrow import Eliminated, eliminate, gradient, norms
from .bounds import Bounds
from .chart import Chart, chart_at
from .optimum import Optimum, Outcome
from .problem import Problem, Structure, Triangle, Unknowns, cost, traced_once

_LEAST = 1e-3
"""Damping that even the longest step has: directions whose standard error is above thirty units are hardly moved."""
_STRAIGHT = (np.inf, 1.0, 0.1)
_CURVED = (3.0, 1.0, 0.3, 0.03)
"""Lengths of the steps that are tried, in units of the chart. A simulation alone is cheap beside a linearisation, and the
steps run as its lanes."""
CANDIDATES = len(_STRAIGHT) + len(_CURVED)
_SHORTER, _LONGER = 0.01, 30.0
_ROUNDS = 4
"""How often all of them shrink, and by what factor, while none lowers the cost."""
_BISECTIONS, _NEWTON = 40, 60
_SOLVED = 1e-12
"""Relative change of a damping that is none."""
_PROMISE = 5e-5
"""Promised drop of the cost, that of a hundredth of a standard error, below which undamped steps begin."""
_EXACT = 1e-14
"""Promised drop of the cost below which undamped steps end: a ten-millionth of a standard error."""
_POLISHED, _MISS = 8, 4
"""How many of them there are at most; one that leads to nothing better counts for four."""
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


def _dampings(system: Eliminated, lengths: Float[Array, " c"]) -> Float[Array, " c"]:
    """The least dampings, from `_LEAST` on, with which the steps of the shared unknowns are no longer than `lengths`."""
    pull, values = system.pull, system.values**2
    if isinstance(pull, np.ndarray):
        return _newton(pull**2, values, np.asarray(lengths))
    highest = jnp.linalg.norm(pull) / lengths
    ends = jnp.full(lengths.shape, jnp.log(_LEAST)), jnp.log(jnp.maximum(highest, _LEAST))

    def halve(_, ends):
        low, high = ends
        middle = 0.5 * (low + high)
        long = jnp.linalg.norm(pull / (values + jnp.exp(middle)[:, None]), axis=1) > lengths
        return jnp.where(long, middle, low), jnp.where(long, high, middle)

    _, high = jax.lax.fori_loop(0, _BISECTIONS, halve, ends)
    return jnp.exp(high)


def _newton(squares: np.ndarray, values: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """The same numbers in fewer steps where it is known when to stop: Newton's method for one over the step's length, which
    comes from below and never overshoots (Reinsch, Numerische Mathematik 16, 1971)."""
    damping = np.full(lengths.shape, _LEAST)
    for _ in range(_NEWTON):
        stiff = 1.0 / (values + damping[:, None])
        square = (stiff * stiff) @ squares
        length = np.sqrt(square)
        more = np.where(length > lengths, (length / lengths - 1.0) * square / ((stiff * stiff * stiff) @ squares), 0.0)
        damping = damping + more
        if not (more > _SOLVED * damping).any():
            break
    return damping


def _promise(scaled: Triangle, system: Eliminated) -> Float[Array, ""]:
    """Drop of the cost (half chi-squared) that the longest step promises: -½ (Jᵀ r) · step, what the step itself may cost by
    its damping left out."""
    slope, step = gradient(scaled), system.shared_step(_LEAST)
    return -0.5 * ((slope.z * step).sum() + (slope.states * system.own_step(step)).sum())


def promise_of(problem: Problem, unknowns: Unknowns, triangle: Triangle) -> Float[Array, ""]:
    """Drop of the cost (half chi-squared) that a linearisation promises, bounds respected."""
    scaled = chart_at(problem.bounds, unknowns, triangle).scaled(triangle)
    return _promise(scaled, eliminate(scaled, _LEAST))


class State(NamedTuple):
    """Between two linearisations: `there` is looked at next, `reached`, its `triangle` and its `cost` are the best so far.
    `reach` is the length, in units of `_STRAIGHT` and `_CURVED`, about which the last step was found."""

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
    reach: Float[Array, ""]

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


def _candidates(chart: Chart, system: Eliminated, shrunk: Float[Array, ""] | float) -> Unknowns:
    """Where steps lead that are `shrunk` times the usual ones (leading axis: their lengths)."""
    xp, k = namespace(system.pull), len(_STRAIGHT)
    steps = system.shared_step(_dampings(system, shrunk * xp.array(_STRAIGHT + _CURVED)))
    own = system.own_step(steps, shrunk)
    straight, curved = chart.straight(steps[:k], own[:k]), chart.curved(steps[k:], own[k:])
    return Unknowns(*(xp.concatenate(both) for both in zip(straight, curved, strict=True)))


def begin(start: Unknowns, shapes: Triangle) -> State:
    """Before the first linearisation, whose result has the shapes of `shapes`."""
    empty = Triangle(*(np.full(leaf.shape, np.inf, leaf.dtype) for leaf in shapes))
    none, infinite = np.asarray(0), np.asarray(np.inf)
    return State(
        start, start, empty, infinite, infinite, none, none, infinite, np.asarray(UNDECIDED), none, np.asarray(1.0)
    )


def _shrunk(state: State, round: Int[Array, ""] | int) -> Float[Array, ""]:
    """By how much the usual steps are shrunk in a round: the last one asks those that were left out at first."""
    xp = namespace(state.reach)
    return xp.where((round == _ROUNDS - 1) & (state.reach < 1.0), 1.0, state.reach * _SHORTER**round)


def tried(search: Search, costs: Float[Array, " c"]) -> Search:
    """The search once the costs at its candidates are known: it has found a lower one, or all steps shrink, or it is over."""
    xp, now, state = namespace(search.now), search.now, search.state
    costs = xp.where(xp.isfinite(costs), costs, xp.inf)
    best = xp.argmin(costs)
    below = costs[best] < now
    # Where only short steps lead on, the next ones begin there, and may grow.
    longest = (best == 0) | (best == len(_STRAIGHT))
    reach = xp.minimum(_shrunk(state, search.round) * xp.where(longest, _LONGER, 1.0), 1.0)
    there = chosen(below, Unknowns(*(leaf[best] for leaf in search.candidates)), state.there)
    same = (~xp.isfinite(costs) | (xp.abs(costs - now) <= _ROUNDING * now)).all()
    flat = xp.where(search.round == 0, same & xp.isfinite(costs).any(), search.flat)
    lower = below & ~flat
    going = ~lower & (search.round + 1 < _ROUNDS)
    lost = xp.where(search.near, Outcome.OPTIMUM, xp.where(flat, Outcome.INSENSITIVE, Outcome.NO_PROGRESS))
    return search._replace(
        state=state._replace(
            there=there, reach=xp.where(lower, reach, state.reach), outcome=xp.where(lower | going, UNDECIDED, lost)
        ),
        round=search.round + 1,
        flat=flat,
        candidates=search.candidates
        if surely_not(going)
        else _candidates(search.chart, search.system, _shrunk(state, search.round + 1)),
        going=going,
    )


class BestDampingLevenbergMarquardt(eqx.Module):
    """Levenberg-Marquardt that tries several dampings at every step and takes the best.

    All of it is jaxid's: the units, the step, the bounds, and the stop, which it makes where the linearisation promises no
    drop of the cost above `promise` (some undamped steps follow while each comes closer), or where two steps in a row do
    not lower it by `noticeable` (both in half chi-squared). Any `optimistix` least-squares solver can take its place.
    `report` is called with the cost after every linearisation.

    What is decided between two simulations knows nothing of the robot (`decided`, `tried`): it runs as one program with the
    simulations (`minimise`), or by turns with them, in NumPy, where nothing is compiled for it (`in_turns`).
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
        xp, here, now = namespace(triangle.shared), state.there, triangle.cost
        if self.report is not None:
            self.report(now) if xp is np else jax.debug.callback(self.report, now)
        chart = chart_at(bounds, here, triangle)
        scaled = chart.scaled(triangle)
        system = eliminate(scaled, _LEAST)
        promise = _promise(scaled, system)
        sound = xp.isfinite(triangle.squares).all() & (now < _UNSOUND)
        first = state.steps == 0
        drop = state.cost - now
        stalled = xp.where(first | (drop > self.noticeable), 0, state.stalled + 1)
        small = promise < xp.where(stalled >= _STALLED_STEPS, KINK, self.promise)
        blind = (norms(triangle).z == 0.0).all() & xp.any(free)
        # Within a standard error of a minimum the search ends and undamped steps begin; the best place counts.
        polishing = (state.polished > 0) | (small & sound & ~blind)
        equal = xp.abs(now - state.cost) <= _EQUAL
        better = sound & ((now < state.cost - _EQUAL) | (equal & (promise < state.promise)))
        worse = (state.polished > 0) & ~better
        spent = state.polished + xp.where(worse, _MISS, 1)
        polish = polishing & sound & (promise > _EXACT) & (promise < KINK) & (spent <= _POLISHED)
        outcome = xp.select(
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
        full = system.shared_step(_LEAST)
        straight = chart.straight(full, system.own_step(full))
        reached = chosen(
            worse, (state.reached, state.triangle, state.cost, state.promise), (here, triangle, now, promise)
        )
        following = State(
            chosen(polish, straight, here),
            *reached[:3],
            start_cost=xp.where(first, now, state.start_cost),
            steps=state.steps + 1,
            stalled=stalled,
            promise=reached[3],
            outcome=outcome,
            polished=xp.where(polish, spent, state.polished),
            reach=state.reach,
        )
        going = (outcome == UNDECIDED) & ~polish
        unknown = Unknowns(here.z[None], here.states[None])
        return Search(
            state=following,
            chart=chart,
            system=system,
            now=now,
            near=promise < KINK,
            round=xp.array(0),
            flat=xp.array(False),
            candidates=unknown if surely_not(going) else _candidates(chart, system, state.reach),
            going=going,
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
