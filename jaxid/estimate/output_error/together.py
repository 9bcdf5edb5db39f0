"""Linearisations and costs of many problems at once: the logs of all of them lie side by side in the machine code's lanes.

A fit of two logs alone leaves most lanes empty; the members of a fleet, or the starts of one fit, fill them. What is decided
from the results, every problem decides for itself (`in_turns`).
"""

from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any

import numpy as np

from ...kernel.groups import grouped, ungrouped
from .direct import Direct, Logs, log_triangles, reduced, slopes_at
from .direct_costs import costs_of, log_squares, side_by_side
from .problem import Apart, Triangle, Unknowns, parameters_at

Array = Any
"""NumPy's, or what can be read as such."""
Asked = tuple[Direct, Unknowns]
_AT_A_TIME = 2_000_000
"""Numbers of sensitivities, or of simulations, up to which problems are taken together."""
_AS_LONG = 2.0
"""Logs that differ in length by more than about this factor are not padded to one length."""


def kind_of(d: Direct) -> Hashable:
    """What problems must have in common to be simulated side by side; None of one that has to be by itself, since effects on
    whole records act with the same parameters on all logs."""
    (system, places, records), (n, _) = d.model, d.shares.shape
    if records.commands is not None or records.measures is not None:
        return None
    E, T = d.problem.dt.shape
    length = int(np.log(max(T, 1)) / np.log(_AS_LONG))
    return system, places, d.moving, d.starts, n, len(d.numbers), length


def _longer(x: Array, T: int, how: Any) -> Array:
    """[E, T', ...] as [E, T, ...]."""
    return np.pad(x, [(0, 0), (0, T - x.shape[1]), *[(0, 0)] * (x.ndim - 2)], mode=how)


def merged(ds: Sequence[Direct]) -> Direct:
    """All logs of all problems as those of one, each with its own constants; what was added to the shorter has no weight."""
    if len(ds) == 1:
        return ds[0]
    T = max(d.problem.dt.shape[1] for d in ds)

    def logs(name: str, how: str) -> Array:
        each = (ungrouped(getattr(d.logs, name), len(d.begin)) for d in ds)
        return grouped(np.concatenate([_longer(x, T, how) for x in each]))

    def each(name: str) -> Array:
        return np.concatenate([getattr(d, name) for d in ds])

    return ds[0]._replace(
        numbers=np.concatenate([np.broadcast_to(d.numbers, (len(d.begin), len(d.numbers))) for d in ds]),
        begin=each("begin"),
        state_scale=each("state_scale"),
        state_slope=each("state_slope"),
        state_stiffness=each("state_stiffness"),
        logs=Logs(
            u=logs("u", "constant"),
            dt=logs("dt", "edge"),
            fixed=logs("fixed", "edge"),
            measured=logs("measured", "constant"),
            weight=logs("weight", "constant"),
        ),
    )


def _parts(asked: Sequence[Asked], size: Callable[[Asked], int]) -> Iterator[Sequence[Asked]]:
    begin, total = 0, 0
    for k, one in enumerate(asked):
        own = size(one)
        if k > begin and total + own > _AT_A_TIME:
            yield asked[begin:k]
            begin, total = k, 0
        total += own
    yield asked[begin:]


def _divided(x: Array, ds: Sequence[Direct], axis: int = 0) -> list[Array]:
    """By problem what has an axis of the logs of all."""
    return np.split(x, np.cumsum([len(d.begin) for d in ds])[:-1], axis=axis)


def linearised_together(asked: Sequence[Asked]) -> list[Triangle]:
    """`linearised_directly` of every problem at its unknowns; all of one kind."""
    found: list[Triangle] = []
    for part in _parts(asked, lambda one: one[0].logs.measured.size * (one[1].z.size + len(one[0].starts) + 1)):
        ds = [d for d, _ in part]
        z = [np.asarray(there.z) for _, there in part]
        theta = [parameters_at(d.problem, own) for d, own in zip(ds, z, strict=True)]
        slope = [slopes_at(d.problem, own) for d, own in zip(ds, z, strict=True)]
        E = [len(d.begin) for d in ds]
        states = np.concatenate([np.asarray(there.states) for _, there in part])
        triangles, squares = log_triangles(merged(ds), np.repeat(theta, E, axis=0), np.repeat(slope, E, axis=0), states)
        each = zip(_divided(triangles, ds), _divided(squares, ds), strict=True)
        found += [reduced(d.problem, theta[k], slope[k], *own) for k, (d, own) in enumerate(zip(ds, each, strict=True))]
    return found


def costs_together(asked: Sequence[Asked]) -> list[Apart]:
    """`costs_directly` of every problem at its candidates, however many; all of one kind."""
    found: list[Apart] = []
    for part in _parts(asked, lambda one: one[0].logs.measured.size * len(one[1].z)):
        # Every candidate is a set of logs of its own.
        each = [
            (d, Unknowns(z, states)) for d, there in part for z, states in zip(*map(np.asarray, there), strict=True)
        ]
        theta = [parameters_at(d.problem, np.asarray(there.z)) for d, there in part]
        ds = [d for d, _ in each]
        all_of_them = merged(ds)
        with np.errstate(over="ignore", invalid="ignore"):
            squares = log_squares(
                all_of_them,
                side_by_side(all_of_them, 1),
                np.repeat(np.concatenate(theta), [len(d.begin) for d in ds], axis=0)[None],
                np.concatenate([there.states for _, there in each])[None],
            )[0]
            own = iter(_divided(squares, ds))
            for (d, there), at in zip(part, theta, strict=True):
                found.append(costs_of(d.problem, at, np.asarray(there.states), np.stack([next(own) for _ in at])))
    return found
