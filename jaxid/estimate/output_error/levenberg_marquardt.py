"""Levenberg-Marquardt on the reduced output-error problem: a trust region for the parameters, and in every step each
experiment's own share of its own way.

Units are those of `chart`, so that the damping is a weak pull towards the last iterate for directions that the data hardly
determines and nothing for those it does, whatever the parameters' units. A damping is chosen by the length of the step that
it allows (Moré, Lecture Notes in Mathematics 630, 1978), and that length by how well the last step kept what the linearisation
promised. Sticking friction puts small kinks into the cost, and the caster's flips large ones; most of them lie in an
experiment's initial state, so that one experiment would stop all: hence `steps`.

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
from . import polish
from .arrow import Eliminated, eliminate
from .chart import Chart, chart_at
from .optimum import Optimum, Outcome
from .problem import Apart, Problem, Structure, Triangle, Unknowns, costs_apart, traced_once
from .steps import Steps, best_of, no_steps, others, simulated, steps_of

_LEAST = 1e-3
"""Damping that even the longest step has: directions whose standard error is above thirty units are hardly moved."""
_RADIUS = 1.0
"""Length of the parameters' first step at most, in units of the chart."""
_SHORTER = 0.1
"""By what factor a step shrinks, from its own length, while none lowers the cost."""
_ROUNDS = 6
"""How often steps are asked for, the last time from the beginning: the usual shares, the other ones, and shorter steps."""
_GOOD, _POOR = 0.75, 0.25
"""Share of the promised drop above which the next step may be longer, and below which it must be shorter."""
_KEPT = 1e-3
"""Share of the promised drop that a step must bring."""
_RISEN = 0.05
"""Share of a step's drop by which the cost of an experiment may rise without a look at its other shares."""
_GROWS = 4.0
"""By what factor an experiment's usual share grows after it took the longest one."""
_BISECTIONS, _NEWTON = 40, 60
_SOLVED = 1e-12
"""Relative change of a damping that is none."""
_PROMISE = 1e-3
"""Promised drop of the cost, that of a twentieth of a standard error, below which undamped steps begin."""
_EXACT = 2e-13
"""Promised drop of the cost below which undamped steps end: six ten-millionths of a standard error."""
_POLISHED, _MISS = 8, 4
"""How many of them there are at most; one that leads to nothing better counts for four."""
_EQUAL = 1e-9
"""Difference of costs that rounding may make."""
_NOTICEABLE = 0.01
"""Drop of the cost (half chi-squared) that counts as progress."""
_STALLED_STEPS = 2
_LESS = 0.5
"""Share of a promise below which the next one is progress, too."""
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


def _promise(chart: Chart, system: Eliminated) -> Float[Array, ""]:
    """Drop of the cost (half chi-squared) that the longest step promises: -½ (Jᵀ r) · step, what the step itself may cost by
    its damping left out."""
    step = system.shared_step(_LEAST)
    by_z = namespace(step).where(chart.held, 0.0, chart.units.z * chart.slope.z)
    return -0.5 * ((by_z * step).sum() + (chart.units.states * chart.slope.states * system.own_step(step)).sum())


def promise_of(problem: Problem, unknowns: Unknowns, triangle: Triangle) -> Float[Array, ""]:
    """Drop of the cost (half chi-squared) that a linearisation promises, bounds respected."""
    chart = chart_at(problem.bounds, unknowns, triangle)
    return _promise(chart, eliminate(chart.scaled(triangle), _LEAST))


class State(NamedTuple):
    """Between two linearisations: `there` is looked at next, `reached`, its `triangle` and its `cost` are the best so far.

    `least`: the least promise since the cost last dropped noticeably. Around a kink the linearisations on its two sides
    promise different drops, and where one of them promises nothing there is none. `undamped`: the last steps without
    damping. `radius`: length of the parameters' step at most, in units of the chart; `shares`
    [E]: those of the experiments' own ways on which they went last.
    """

    there: Unknowns
    reached: Unknowns
    triangle: Triangle
    cost: Float[Array, ""]
    start_cost: Float[Array, ""]
    steps: Int[Array, ""]
    stalled: Int[Array, ""]
    promise: Float[Array, ""]
    least: Float[Array, ""]
    outcome: Int[Array, ""]
    polished: Int[Array, ""]
    undamped: polish.Steps
    radius: Float[Array, ""]
    shares: Float[Array, " E"]
    own: Float[Array, " E"]

    @property
    def optimum(self) -> Optimum:
        """The result, once the outcome is decided."""
        return Optimum(self.reached, self.triangle, self.cost, self.steps, self.outcome, self.start_cost, self.promise)


class Search(NamedTuple):
    """Steps from one linearisation, `scaled` to the units of the chart. While it is `going`, the costs of the `steps` asked
    for are worked out; `state` is what follows if it ends here. `radius`: that of this round."""

    state: State
    chart: Chart
    scaled: Triangle
    system: Eliminated
    now: Float[Array, ""]
    near: Bool[Array, ""]
    round: Int[Array, ""]
    flat: Bool[Array, ""]
    radius: Float[Array, ""]
    steps: Steps
    going: Bool[Array, ""]


def _steps(chart: Chart, system: Eliminated, radius: Float[Array, ""], shares: Float[Array, " E"], first: Any) -> Steps:
    xp = namespace(system.pull)
    (damping,) = _dampings(system, xp.reshape(radius, (1,)))
    return steps_of(chart, system, system.shared_step(damping), shares, first)


def begin(start: Unknowns, shapes: Triangle) -> State:
    """Before the first linearisation, whose result has the shapes of `shapes`."""
    empty = Triangle(*(np.full(leaf.shape, np.inf, leaf.dtype) for leaf in shapes))
    none, infinite = np.asarray(0), np.asarray(np.inf)
    return State(
        there=start,
        reached=start,
        triangle=empty,
        cost=infinite,
        start_cost=infinite,
        steps=none,
        stalled=none,
        promise=infinite,
        least=infinite,
        outcome=np.asarray(UNDECIDED),
        polished=none,
        undamped=polish.no_steps(start),
        radius=np.asarray(_RADIUS),
        shares=np.ones(start.states.shape[0]),
        own=np.full(start.states.shape[0], np.inf),
    )


def _following(search: Search, steps: Steps) -> tuple[Float[Array, ""], Steps]:
    """Radius and steps of the round after that of `steps`: the other shares, then shorter steps, in the end all from the
    beginning."""
    xp, state = namespace(search.now), search.state
    several = len(steps.shares) > 1
    if several and surely_not(search.round > 0):
        return search.radius, others(steps)
    shorter = xp.minimum(search.radius, steps.length) * _SHORTER
    last = search.round + 2 == _ROUNDS
    radius = xp.where(last, _RADIUS, shorter)
    new = _steps(search.chart, search.system, radius, xp.where(last, 1.0, state.shares), False)
    if not several:
        return radius, new
    same = search.round == 0
    return xp.where(same, search.radius, radius), chosen(same, others(steps), new)


def tried(search: Search, found: Apart) -> Search:
    """The search once the costs of the steps asked for are known: a lower one is there, or others are asked for, or it is
    over."""
    xp, now, state = namespace(search.now), search.now, search.state
    steps = simulated(search.steps, found)
    best = best_of(steps, search.scaled, search.system)
    drop = now - best.cost
    ratio = drop / best.promise
    kept = (drop > 0.0) & (drop > _KEPT * best.promise)
    # A poor step may owe that to a few experiments alone, and a good one be bad for some.
    several = len(steps.shares) > 1
    risen = (best.own > state.own + _RISEN * xp.maximum(drop, 0.0) + KINK).any()
    poor = (search.round == 0) & ((ratio < _POOR) | risen) & several
    totals = steps.known.own.sum(axis=1) + steps.known.shared
    same = (~xp.isfinite(totals) | (xp.abs(totals - now) <= _ROUNDING * now)).all()
    flat = xp.where(search.round == int(several), same & xp.isfinite(totals).any(), search.flat)
    lower = kept & ~poor & ~flat
    going = ~lower & (search.round + 1 < _ROUNDS)
    lost = xp.where(search.near, Outcome.OPTIMUM, xp.where(flat, Outcome.INSENSITIVE, Outcome.NO_PROGRESS))
    longer = xp.maximum(search.radius, 2.0 * steps.length)
    radius = xp.where(ratio > _GOOD, longer, xp.where(ratio < _POOR, 0.5 * steps.length, search.radius))
    shares = xp.minimum(xp.where(best.which == 0, _GROWS, 1.0) * best.shares, 1.0)
    following = (search.radius, steps) if surely_not(going) else _following(search, steps)
    return search._replace(
        state=state._replace(
            there=chosen(lower, best.there, state.there),
            radius=xp.where(lower, radius, state.radius),
            shares=xp.where(lower, shares, state.shares),
            own=xp.where(lower, best.own, state.own),
            outcome=xp.where(lower | going, UNDECIDED, lost),
        ),
        round=search.round + 1,
        flat=flat,
        radius=following[0],
        steps=following[1],
        going=going,
    )


class Rule(NamedTuple):
    """When a search ends, and what is told of it (`BestDampingLevenbergMarquardt`)."""

    promise: float
    noticeable: float
    report: Callable[[Any], None] | None


def decided(
    rule: Rule,
    bounds: Any,
    free: Bool[Array, " n"],
    state: State,
    triangle: Triangle,
    max_steps: Int[Array, ""] | int,
) -> Search:
    """What follows from the linearisation `triangle` at `state.there`: the end, an undamped step, or a search."""
    xp, here, now = namespace(triangle.shared), state.there, triangle.cost
    if rule.report is not None:
        rule.report(now) if xp is np else jax.debug.callback(rule.report, now)
    chart = chart_at(bounds, here, triangle)
    scaled = chart.scaled(triangle)
    system = eliminate(scaled, _LEAST)
    promise = _promise(chart, system)
    sound = xp.isfinite(triangle.squares).all() & (now < _UNSOUND)
    first = state.steps == 0
    drop = state.cost - now
    slow = ~first & (drop <= rule.noticeable) & (promise > _LESS * state.least)
    stalled = xp.where(slow, state.stalled + 1, 0)
    least = xp.where(slow, xp.minimum(promise, state.least), promise)
    ended = stalled >= _STALLED_STEPS
    small = xp.where(ended, least < KINK, promise < rule.promise)
    blind = (chart.norm.z == 0.0).all() & xp.any(free)
    # Within a standard error of a minimum the search ends and undamped steps begin; the best place counts.
    polishing = (state.polished > 0) | (small & sound & ~blind)
    equal = xp.abs(now - state.cost) <= _EQUAL
    better = sound & ((now < state.cost - _EQUAL) | (equal & (promise < state.promise)))
    worse = (state.polished > 0) & ~better
    spent = state.polished + xp.where(worse, _MISS, 1)
    smooth = (promise < KINK) & (~ended | (promise < rule.noticeable))
    polishes = polishing & sound & (promise > _EXACT) & smooth & (spent <= _POLISHED)
    outcome = xp.where(state.steps >= max_steps, Outcome.STEP_LIMIT, UNDECIDED)
    for holds, what in (
        (ended, Outcome.NO_PROGRESS),
        (blind, Outcome.INSENSITIVE),
        (~sound, Outcome.DIVERGED),
        (polishing, Outcome.OPTIMUM),
        (polishes, UNDECIDED),
    ):  # the last of them decides
        outcome = xp.where(holds, what, outcome)
    following, undamped = here, state.undamped
    if not surely_not(polishes):
        full = system.shared_step(_LEAST)
        straight = chart.straight(full, system.own_step(full))
        kept = undamped._replace(known=xp.where(worse, 0, undamped.known))
        ends = chart.within(polish.extrapolated(triangle, here, straight, kept))
        following, undamped = chosen(polishes, ends, here), polish.with_step(kept, here, straight)
    reached = chosen(worse, (state.reached, state.triangle, state.cost, state.promise), (here, triangle, now, promise))
    next_state = State(
        following,
        *reached[:3],
        start_cost=xp.where(first, now, state.start_cost),
        steps=state.steps + 1,
        stalled=stalled,
        promise=reached[3],
        least=least,
        outcome=outcome,
        polished=xp.where(polishes, spent, state.polished),
        undamped=undamped,
        radius=state.radius,
        shares=state.shares,
        own=state.own,
    )
    going = (outcome == UNDECIDED) & ~polishes
    return Search(
        state=next_state,
        chart=chart,
        scaled=scaled,
        system=system,
        now=now,
        near=xp.minimum(promise, least) < KINK,
        round=xp.array(0),
        flat=xp.array(False),
        radius=state.radius,
        steps=no_steps(here) if surely_not(going) else _steps(chart, system, state.radius, state.shares, True),
        going=going,
    )


class BestDampingLevenbergMarquardt(eqx.Module):
    """Levenberg-Marquardt with a trust region, in whose steps every experiment has its own share of its own way.

    All of it is jaxid's: the units, the step, the bounds, and the stop, which it makes where the linearisation promises no
    drop of the cost above `promise` (some undamped steps follow while each comes closer), or where two steps in a row neither
    lower it by `noticeable` (both in half chi-squared) nor halve what is promised. Any `optimistix` least-squares solver can
    take its place. `report` is called with the cost after every linearisation.

    What is decided between two simulations knows nothing of the robot (`decided`, `tried`): it runs as one program with the
    simulations (`minimise`), or by turns with them, in NumPy, where nothing is compiled for it (`in_turns`).
    """

    promise: float = _PROMISE
    noticeable: float = _NOTICEABLE
    report: Callable[[Float[Array, ""]], None] | None = None

    @property
    def rule(self) -> Rule:
        """What decisions depend on."""
        return Rule(self.promise, self.noticeable, self.report)

    def minimise(
        self, structure: Structure, problem: Problem, start: Unknowns, max_steps: Int[Array, ""] | int
    ) -> Optimum:
        """Minimise from `start`. Pure: runs under `jax.jit` and `jax.vmap`."""
        look, shapes = traced_once(structure, problem, start)

        def costs(search: Search) -> Search:
            return tried(
                search, jax.vmap(lambda there: costs_apart(structure, problem, there))(search.steps.candidates)
            )

        def step(state: State) -> State:
            search: Any = decided(self.rule, problem.bounds, problem.free, state, look(state.there, problem), max_steps)
            return jax.lax.while_loop(lambda search: search.going, costs, search).state

        end = jax.lax.while_loop(lambda state: state.outcome == UNDECIDED, step, begin(start, shapes))
        return end.optimum
