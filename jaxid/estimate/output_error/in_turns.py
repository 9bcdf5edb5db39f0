"""jaxid's Levenberg-Marquardt with Python between its compiled parts.

Simulations and sensitivities are machine code (`direct`) or, where that takes XLA, two programs of a model; what is decided
between them knows nothing of the robot and is compiled once for all models with as many unknowns. As one program, the
decisions would be compiled anew for every model and every length of the logs, and take most of the time of that. Going
from part to part costs a tenth of a millisecond.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..._arrays import array
from ..._compile import compiled, forget_programs
from .bounds import Bounds
from .direct import costs_directly, direct, linearised_directly, runs_directly, side_by_side
from .lanes import ask_together, in_batch
from .levenberg_marquardt import CANDIDATES, UNDECIDED, BestDampingLevenbergMarquardt, Search, State, begin, tried
from .optimum import Optimum, Outcome
from .problem import Problem, Structure, Triangle, Unknowns, cost, linearise
from .together import costs_together, kind_of, linearised_together

Task = tuple[Structure, Problem, Unknowns]
Look = Callable[[Unknowns], Triangle]
Costs = Callable[[Unknowns], Any]
_MOST_MODELS = 32
"""Then all are forgotten, the traces they were made from too."""
_MULTIPLE = 8
"""Decisions are compiled for multiples of so many unknowns; those in excess move nothing."""
_FEWEST = 8
"""And for powers of two of logs with unknowns of their own, from so many on."""


class _Model(NamedTuple):
    """Compiled `(problem, unknowns) -> Triangle`, and `(problem, candidates) -> costs`."""

    look: Any
    costs: Any


_look = compiled(linearise, static_argnames=("structure",))


@partial(compiled, static_argnames=("structure",))
def _costs(structure: Structure, problem: Problem, candidates: Unknowns) -> Float[Array, " c"]:
    return jax.vmap(lambda there: cost(structure, problem, there))(candidates)


@partial(compiled, static_argnames=("solver",))
def _decided(
    solver: BestDampingLevenbergMarquardt,
    bounds: Bounds,
    free: Bool[Array, " n"],
    state: State,
    triangle: Triangle,
    max_steps: Int[Array, ""],
) -> Search:
    return solver.decided(bounds, free, state, triangle, max_steps)


_tried = compiled(tried)
_models: dict[Any, _Model] = {}


def _key(structure: Structure, problem: Problem, start: Unknowns) -> Any:
    leaves, tree = jax.tree.flatten((problem, start))
    return structure, tree, tuple((leaf.shape, str(leaf.dtype)) for leaf in leaves)


def _many(leaf: Any) -> jax.ShapeDtypeStruct:
    return jax.ShapeDtypeStruct((CANDIDATES, *leaf.shape), leaf.dtype)


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


def _simulations(structure: Structure, problem: Problem, start: Unknowns) -> tuple[Look, Costs]:
    """Linearisation at given unknowns, and the costs at candidates, of a problem; of many fits in a batch together."""
    d = direct(structure, problem)
    if d is not None:
        kind = kind_of(d) if in_batch() else None
        if kind is not None:
            return (
                lambda there: ask_together(linearised_together, kind, (d, there)),
                lambda candidates: ask_together(costs_together, kind, (d, candidates)),
            )
        many = side_by_side(d, CANDIDATES)
        return partial(linearised_directly, d), partial(costs_directly, d, many)
    compile_ahead([(structure, problem, start)])
    model = _models[_key(structure, problem, start)]
    return partial(model.look, problem), partial(model.costs, problem)


def minimise_in_turns(
    solver: BestDampingLevenbergMarquardt,
    structure: Structure,
    problem: Problem,
    start: Unknowns,
    max_steps: int,
    until: float = 0.0,
) -> Optimum:
    """`solver.minimise`, part by part; it ends as soon as a linearisation promises no drop of the cost above `until`."""
    look, costs = _simulations(structure, problem, start)
    limit = np.asarray(max_steps)
    seen: list[Triangle] = []
    n, states = len(structure.names), np.asarray(start.states)
    E, s = states.shape

    def whole(there: Unknowns) -> Unknowns:
        """Without what was filled up, for one or several candidates."""
        own = np.asarray(there.states)[..., :E, :] if s else np.zeros((*np.shape(there.z)[:-1], E, 0))
        return there._replace(z=np.asarray(there.z)[..., :n], states=own)

    def looked(there: Unknowns) -> Triangle:
        seen.append(look(whole(there)))
        return _outline(seen[-1], len(seen) - 1)

    given = problem.bounds
    found = _minimised(
        solver,
        eqx.tree_at(
            lambda bounds: (bounds.lower, bounds.upper, bounds.scale),
            given,
            (_filled(given.lower, -np.inf), _filled(given.upper, np.inf), _filled(given.scale, 1.0)),
        ),
        _filled(problem.free, False),
        start._replace(z=_filled(start.z, 0.0), states=np.pad(states[: E * bool(s)], ((0, _more_logs(E, s)), (0, 0)))),
        looked,
        lambda candidates: costs(whole(candidates)),
        limit,
        until,
    )
    number = float(found.triangle.squares[0, 0])
    last = seen[int(number) if np.isfinite(number) else -1]
    return found._replace(triangle=last, unknowns=whole(found.unknowns))


def _minimised(
    solver: BestDampingLevenbergMarquardt,
    bounds: Bounds,
    free: Any,
    start: Unknowns,
    look: Look,
    costs: Costs,
    limit: Any,
    until: float,
) -> Optimum:
    triangle = look(start)
    state = begin(start, triangle)
    while True:
        search = _decided(solver, bounds, free, state, triangle, limit)
        if until and np.isfinite(triangle.squares).all() and search.state.promise <= until:
            return search.state.optimum._replace(outcome=array(Outcome.OPTIMUM))
        while search.going:
            search = _tried(search, costs(search.candidates))
        state = search.state
        if state.outcome != UNDECIDED:
            return state.optimum
        triangle = look(state.there)


def _filled(values: Any, with_: Any) -> Any:
    """[n] filled up to the next multiple."""
    values = np.asarray(values)
    return np.concatenate([values, np.full(-len(values) % _MULTIPLE, with_, values.dtype)])


def _more_logs(E: int, s: int) -> int:
    """How many logs without any information fill up E logs with s unknowns of their own: to a power of two, or, where they
    have none, to a single one in the place of all."""
    return max(_FEWEST, 1 << (E - 1).bit_length()) - E if s else 1


def _outline(triangle: Triangle, number: int) -> Triangle:
    """What is decided on: of the same shapes for every few unknowns and for about as many logs, so that it is compiled once
    for all. In place of the squares stands the linearisation's `number`, infinite if they are not finite."""
    own, local = np.asarray(triangle.shared), np.asarray(triangle.local)
    n, (E, s) = own.shape[-1], local.shape[:2]
    more, logs = n + -n % _MULTIPLE, E * bool(s) + _more_logs(E, s)
    crossed, residual = np.asarray(triangle.crossed), np.asarray(triangle.residual_local)
    if not s:
        crossed, local, residual = np.zeros((0, 0, n)), local[:0], np.zeros((0, 0))
    sound = bool(np.isfinite(triangle.squares).all())
    return triangle._replace(
        shared=_within((more, more), own),
        residual_shared=_within((more,), np.asarray(triangle.residual_shared)),
        crossed=_within((logs, s, more), crossed),
        local=_within((logs, s, s), local),
        residual_local=_within((logs, s), residual),
        squares=np.array([[float(number) if sound else np.inf]]),
    )


def _within(shape: tuple[int, ...], values: Any) -> Any:
    """`values` in the first places of zeros."""
    whole = np.zeros(shape)
    whole[tuple(map(slice, values.shape))] = values
    return whole
