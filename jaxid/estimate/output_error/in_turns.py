"""jaxid's Levenberg-Marquardt with Python between its compiled parts.

Simulations and sensitivities are machine code (`direct`) or, where that takes XLA, two programs of a model; what is decided
between them is a matter of a few small matrices, in NumPy. As one program, the decisions would be compiled anew for every
model and every length of the logs, and take most of the time of that.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from typing import Any, NamedTuple

import jax
import numpy as np

from ..._compile import compiled, forget_programs
from .direct import linearised_directly
from .direct_costs import costs_directly, side_by_side
from .laid_out import direct, runs_directly
from .lanes import ask_together, in_batch
from .levenberg_marquardt import UNDECIDED, BestDampingLevenbergMarquardt, begin, decided, tried
from .optimum import Optimum, Outcome
from .problem import Apart, Problem, Structure, Triangle, Unknowns, costs_apart, linearise, plain
from .steps import Steps
from .together import costs_together, kind_of, linearised_together, member_of
from .what_counts import of_what_counts

Task = tuple[Structure, Problem, Unknowns]
Look = Callable[[Unknowns], Triangle]
Costs = Callable[[Unknowns], Apart]
Until = float | Callable[[float, float], bool]
_MOST_MODELS = 32
"""Then all are forgotten, the traces they were made from too."""


class _Model(NamedTuple):
    """Compiled `(problem, unknowns) -> Triangle`, and `(problem, candidates) -> costs`."""

    look: Any
    costs: Any


_look = compiled(linearise, static_argnames=("structure",))


_TOGETHER = 4
"""Candidates that a compiled program simulates at a time."""


@partial(compiled, static_argnames=("structure",))
def _costs(structure: Structure, problem: Problem, candidates: Unknowns) -> Apart:
    return jax.vmap(lambda there: costs_apart(structure, problem, there))(candidates)


_QUIETLY = partial(np.errstate, all="ignore")
"""A simulation that is not finite decides by what it is not."""
_models: dict[Any, _Model] = {}


def _key(structure: Structure, problem: Problem, start: Unknowns) -> Any:
    leaves, tree = jax.tree.flatten((problem, start))
    return structure, tree, tuple((leaf.shape, str(leaf.dtype)) for leaf in leaves)


def _many(leaf: Any) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct((_TOGETHER, *leaf.shape), leaf.dtype)


def compile_ahead(tasks: Sequence[Task]) -> None:
    """Compile the models of several problems at once, for `minimise_in_turns` to find.

    Only compilation runs in threads of its own.
    """
    missing = {key: task for task in tasks if (key := _key(*task)) not in _models and not runs_directly(*task[:2])}
    lowered = [
        program
        for structure, problem, start in missing.values()
        for program in (
            _look.lower(structure, problem, start),
            _costs.lower(structure, problem, jax.tree.map(_many, start)),
        )
    ]
    if not lowered:
        return
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        programs = list(pool.map(lambda program: program.compile(), lowered))
    if len(_models) + len(missing) > _MOST_MODELS:
        _models.clear()
        forget_programs()
    _models.update(zip(missing, map(_Model, programs[::2], programs[1::2]), strict=True))


def simulations(structure: Structure, problem: Problem, start: Unknowns) -> tuple[Look, Costs]:
    """Linearisation at given unknowns, and the costs at candidates, of a problem; of many fits in a batch together."""
    d = direct(structure, problem)
    if d is not None:
        channels = d.model.system.outputs
        d, counted = of_what_counts(d)

        def of_all(triangle: Triangle) -> Triangle:
            squares = np.zeros((len(triangle.squares), channels))
            squares[:, counted] = triangle.squares
            return triangle._replace(squares=squares)

        kind = kind_of(d) if in_batch() else None
        if kind is not None:
            own = member_of(d)
            return (
                lambda there: of_all(ask_together(linearised_together, kind, (own, there))),
                lambda candidates: ask_together(costs_together, kind, (own, candidates)),
            )
        many = cache(partial(side_by_side, d))
        return (
            lambda there: of_all(linearised_directly(d, there)),
            lambda candidates: costs_directly(d, many(len(candidates.z)), candidates),
        )
    compile_ahead([(structure, problem, start)])
    model = _models[_key(structure, problem, start)]
    return (
        lambda there: jax.tree.map(np.asarray, model.look(problem, there)),
        partial(_in_parts, partial(model.costs, problem)),
    )


def _in_parts(costs: Costs, candidates: Unknowns) -> Apart:
    """Costs at any number of candidates, by a program for `_TOGETHER`."""
    c = len(candidates.z)
    found = []
    for first in range(0, c, _TOGETHER):
        some = np.minimum(np.arange(first, first + _TOGETHER), c - 1)
        found.append(jax.tree.map(np.asarray, costs(jax.tree.map(lambda leaf, some=some: leaf[some], candidates))))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves)[:c], *found)


def _answered(steps: Steps, costs: Costs) -> Apart:
    """Costs of the steps asked for; the others' are infinite."""
    own, shared = (np.full(leaf.shape, np.inf) for leaf in steps.known)
    own[steps.asked], shared[steps.asked] = costs(Unknowns(*(leaf[steps.asked] for leaf in steps.candidates)))
    return Apart(own, shared)


def minimise_in_turns(
    solver: BestDampingLevenbergMarquardt,
    structure: Structure,
    problem: Problem,
    start: Unknowns,
    max_steps: int,
    until: Until = 0.0,
) -> Optimum:
    """`solver.minimise`, part by part; it ends as soon as a linearisation promises no drop of the cost above `until`, or
    `until(cost, promised drop)` is true of the best one."""
    enough = until if callable(until) else lambda _, promise: promise <= until
    look, costs = simulations(structure, problem, start)
    numbers, there = plain(problem), jax.tree.map(np.asarray, start)
    bounds, free, rule = numbers.bounds, numbers.free, solver.rule
    triangle = look(there)
    state = begin(there, triangle)
    while True:
        with _QUIETLY():
            search = decided(rule, bounds, free, state, triangle, max_steps)
        if until and np.isfinite(triangle.squares).all() and enough(search.state.cost, search.state.promise):
            return search.state.optimum._replace(outcome=np.asarray(Outcome.OPTIMUM))
        while search.going:
            found = _answered(search.steps, costs)
            with _QUIETLY():
                search = tried(search, found)
        state = search.state
        if state.outcome != UNDECIDED:
            return state.optimum
        triangle = look(state.there)
