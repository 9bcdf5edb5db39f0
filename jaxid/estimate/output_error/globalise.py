"""A start in the right basin, for initial states that make several.

On a reversal near beta = 0 a tiny yaw rate decides to which side the Pioneer's caster flips, so that the cost as a
function of an unknown beta(0) has many minima. Given the parameters, though, each log's beta(0) is a search over one
number, which a grid of rollouts settles without derivatives. So: short horizon first, where nothing has flipped yet,
then longer ones; on each, search beta(0) of every log over the grid, then improve everything by Levenberg-Marquardt;
repeat on the full horizon until the cost stops falling.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from ..._compile import compiled
from .in_turns import simulations
from .laid_out import runs_directly
from .lanes import Operation, ask
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns, simulate_all
from .solvers import minimise_compiled

_VALUES = np.linspace(-1.2, 1.2, 49)
"""Values of an ambiguous initial state that are tried, in units of its prior's standard deviation."""
_NUDGES = np.array([0.0, 0.02, -0.02, 0.1, -0.1, 0.3, -0.3])
_LONGER = 2.5
"""Ratio of a horizon to the one before."""
_LEAST_SAMPLES, _MOST_HORIZONS = 40, 4
"""Samples of the shortest horizon, and how many there are at most before the whole record."""
_STEPS = 15
"""Levenberg-Marquardt steps between two searches."""


def ambiguous_index(structure: Structure) -> int | None:
    """Position of the ambiguous state among the estimated ones, if there is one."""
    for index, name in enumerate(structure.state_names):
        if name in structure.robot.ambiguous:
            return index
    return None


@partial(compiled, static_argnames=("structure", "index"))
def search_state(structure: Structure, problem: Problem, unknowns: Unknowns, candidates, index: int):
    """The best of `candidates` [C, E] (in units of the state's scale) for every log, and the cost of each log there."""

    def cost(own):
        trial = Unknowns(unknowns.z, unknowns.states.at[:, index].set(own))
        outputs = simulate_all(structure, problem, trial)
        residual = jnp.where(problem.mask, (outputs - problem.outputs) / problem.sigma, 0.0)
        prior = problem.state_precision[index] * (own * problem.state_scale[index]) ** 2
        total = 0.5 * jnp.sum(residual**2, axis=(1, 2)) + 0.5 * prior
        return jnp.where(jnp.isfinite(total), total, jnp.inf)

    costs = jax.lax.map(cost, candidates, batch_size=32)
    best = jnp.argmin(costs, axis=0)
    chosen = jnp.take_along_axis(candidates, best[None], axis=0)[0]
    chosen = jnp.where(problem.state_free[:, index], chosen, unknowns.states[:, index])
    return Unknowns(unknowns.z, unknowns.states.at[:, index].set(chosen)), jnp.min(costs, axis=0)


@partial(compiled, static_argnums=(0, 1))
def _search_many(structure: Structure, index: int, problems: Problem, unknowns: Unknowns, candidates):
    # One lane after another: the candidates are lanes already.
    def one(row):
        return search_state(structure, row[0], row[1], row[2], index)

    return jax.lax.map(one, (problems, unknowns, candidates))


def _cut(found, logs: int, samples: int):
    unknowns, costs = found
    return unknowns._replace(states=unknowns.states[:logs]), costs[:logs]


_SEARCH = Operation("search", _search_many, _cut)


def _searched_directly(structure: Structure, problem: Problem, unknowns: Unknowns, candidates, index: int) -> Unknowns:
    """The same in machine code."""
    _, costs = simulations(structure, problem, unknowns)
    z, states = (np.asarray(leaf) for leaf in unknowns)
    candidates, (E, _) = np.asarray(candidates), states.shape
    there = np.repeat(states[None], len(candidates), axis=0)
    there[:, :, index] = candidates
    own = costs(Unknowns(np.repeat(z[None], len(candidates), axis=0), there)).own
    best = np.argmin(np.where(np.isfinite(own), own, np.inf), axis=0)
    states = states.copy()
    states[:, index] = np.where(problem.state_free[:, index], candidates[best, np.arange(E)], states[:, index])
    return unknowns._replace(states=states)


def searched(structure: Structure, problem: Problem, unknowns: Unknowns, candidates, index: int) -> Unknowns:
    """`search_state`'s choice; of a fleet's members together."""
    if runs_directly(structure, problem):
        return _searched_directly(structure, problem, unknowns, candidates, index)
    together = ask(_SEARCH, structure, index, problem, unknowns, candidates)
    return (search_state(structure, problem, unknowns, candidates, index) if together is None else together)[0]


def shortened(problem: Problem, seconds: float) -> Problem:
    """The problem with only the first `seconds` of every log counting."""
    dt = np.asarray(problem.dt)
    time = np.cumsum(dt, axis=1) - dt
    return replace(problem, mask=problem.mask & (time < seconds)[..., None])


def horizons_of(problem: Problem) -> list[float]:
    """Shares of the longest log [s] that count one after another, before the whole: each 2.5 times as long as the last."""
    there = np.any(np.asarray(problem.mask), axis=-1)
    time = np.cumsum(np.asarray(problem.dt), axis=1) - np.asarray(problem.dt)
    longest, samples = float(np.max(np.where(there, time, 0.0))), int(np.max(np.sum(there, axis=1)))
    count = int(np.clip(np.log(samples / _LEAST_SAMPLES) / np.log(_LONGER), 0, _MOST_HORIZONS))
    return [longest * _LONGER**-k for k in range(count, 0, -1)]


def globalise(
    structure: Structure,
    problem: Problem,
    starts: Sequence[Unknowns],
    index: int,
    *,
    rounds: int = 8,
    report: Callable[[str], None] = lambda message: None,
) -> Optimum:
    """Minimise over parameters and initial states, the ambiguous state number `index` globally.

    Every start goes through the short horizons; the best of them goes on.
    """
    scale = float(problem.state_scale[index])
    spread = structure.robot.prior_spreads.get(structure.state_names[index], 1.0)
    grid = spread * _VALUES / scale
    E = starts[0].states.shape[0]

    def search(current: Problem, at: Unknowns) -> Unknowns:
        everywhere = np.broadcast_to(grid[:, None], (grid.shape[0], E))
        nearby = np.asarray(at.states)[:, index] + _NUDGES[:, None] / scale
        return searched(structure, current, at, np.concatenate([everywhere, nearby]), index)

    horizons = horizons_of(problem)
    warmed: list[tuple[float, Unknowns]] = []
    for number, unknowns in enumerate(starts):
        cost = 0.0
        for seconds in horizons:
            current = shortened(problem, seconds)
            optimum = minimise_compiled(structure, current, search(current, unknowns), max_steps=_STEPS)
            unknowns, cost = optimum.unknowns, float(optimum.cost)
        warmed.append((cost, unknowns))
        report(f"start {number + 1} of {len(starts)} on short horizons: cost {cost:.1f}")
    unknowns = min(warmed, key=lambda pair: pair[0])[1]
    best: Optimum | None = None
    for round_number in range(rounds):
        optimum = minimise_compiled(structure, problem, search(problem, unknowns), max_steps=_STEPS)
        report(f"full horizon, round {round_number + 1}: cost {float(optimum.cost):.1f}")
        if best is not None and optimum.cost > best.cost - 0.1:
            return best if best.cost <= optimum.cost else optimum
        best, unknowns = optimum, optimum.unknowns
    assert best is not None
    return best
