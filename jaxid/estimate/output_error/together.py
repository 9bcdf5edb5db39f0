"""Linearisations and costs of many problems at once: the logs of all of them lie side by side in the machine code's lanes.

A fit of two logs alone leaves most lanes empty; the members of a fleet, or the starts of one fit, fill them. What is decided
from the results, every problem decides for itself (`in_turns`).
"""

from collections.abc import Callable, Hashable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...kernel.direct import triangles
from ...kernel.groups import grouped, ungrouped
from .direct import log_triangles
from .direct_costs import costs_of, log_squares, side_by_side
from .laid_out import Direct, Logs
from .problem import Apart, Triangle, Unknowns, parameters_at

Array = Any
"""NumPy's, or what can be read as such."""
_AT_A_TIME = 2_000_000
"""Numbers of sensitivities, or of simulations, up to which problems are taken together."""
_AS_LONG = 2.0
"""Logs that differ in length by more than about this factor are not padded to one length."""


class Member(NamedTuple):
    """A problem as one of many: its logs [E, T, ...] one after another, and all that its logs do not share with those of
    others."""

    d: Direct
    logs: Logs
    numbers: Array
    slope: Array


Asked = tuple[Member, Unknowns]


def member_of(d: Direct) -> Member:
    """What is worked out once for all that a problem asks."""
    E, n = len(d.begin), len(d.moving)
    logs = Logs(*(np.ascontiguousarray(ungrouped(x, E)) for x in d.logs))
    numbers = np.broadcast_to(d.numbers, (E, d.numbers.shape[-1]))
    slope = np.where(d.problem.free, np.broadcast_to(d.problem.bounds.scale, (n,)), 0.0)
    return Member(d, logs, numbers, slope)


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
    return x if x.shape[1] == T else np.pad(x, [(0, 0), (0, T - x.shape[1]), *[(0, 0)] * (x.ndim - 2)], mode=how)


_FILLED = Logs(u="constant", dt="edge", fixed="edge", measured="constant", weight="constant")
"""How the shorter logs are filled up."""


def merged(members: Sequence[Member]) -> Direct:
    """All logs of all problems as those of one, each with its own constants; what was added to the shorter has no weight."""
    if len(members) == 1:
        return members[0].d
    T = max(m.logs.dt.shape[1] for m in members)

    def each(name: str) -> Array:
        return np.concatenate([getattr(m.d, name) for m in members])

    logs = (
        grouped(np.concatenate([_longer(x, T, how) for x in own]))
        for own, how in zip(zip(*(m.logs for m in members), strict=True), _FILLED, strict=True)
    )
    return members[0].d._replace(
        numbers=np.concatenate([m.numbers for m in members]),
        begin=each("begin"),
        state_scale=each("state_scale"),
        state_slope=each("state_slope"),
        state_stiffness=each("state_stiffness"),
        logs=Logs(*logs),
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


def _divided(x: Array, members: Sequence[Member], axis: int = 0) -> list[Array]:
    """By problem what has an axis of the logs of all."""
    return np.split(x, np.cumsum([len(m.d.begin) for m in members])[:-1], axis=axis)


def linearised_together(asked: Sequence[Asked]) -> list[Triangle]:
    """`linearised_directly` of every problem at its unknowns; all of one kind."""
    found: list[Triangle] = []
    for part in _parts(asked, lambda one: one[0].d.logs.measured.size * (one[1].z.size + len(one[0].d.starts) + 1)):
        members = [m for m, _ in part]
        theta = np.stack([parameters_at(m.d.problem, np.asarray(there.z)) for m, there in part])
        slope = np.stack([m.slope for m in members])
        E = [len(m.d.begin) for m in members]
        states = np.concatenate([np.asarray(there.states) for _, there in part])
        every, squares = log_triangles(
            merged(members), np.repeat(theta, E, axis=0), np.repeat(slope, E, axis=0), states
        )
        found += _reduced_together(members, theta, slope, every, squares)
    return found


def _reduced_together(
    members: Sequence[Member], theta: Array, slope: Array, every: Array, squares: Array
) -> list[Triangle]:
    """`direct.reduced` of every problem from the triangles of all logs; problems with fewer logs have rows of zeros."""
    (count, n), E = theta.shape, [len(m.d.begin) for m in members]
    s, most = every.shape[-1] - n - 1, max(E)
    rows = np.zeros((count, most * (n + 1) + n, n + 1))
    own = rows[:, : most * (n + 1)].reshape(count, most, n + 1, n + 1)
    where = np.repeat(np.arange(count), E), np.concatenate([np.arange(e) for e in E])
    own[where] = every[:, s:, s:]
    precision, mean, free = (
        np.stack([getattr(m.d.problem, name) for m in members]) for name in ("prior_precision", "prior_mean", "free")
    )
    pull = np.where(free, np.sqrt(precision), 0.0)
    diagonal = np.arange(n)
    rows[:, -n + diagonal, diagonal], rows[:, most * (n + 1) :, -1] = pull * slope, pull * (theta - mean)
    shared = triangles(rows)
    parts = zip(shared, _divided(every, members), _divided(squares, members), strict=True)
    return [
        Triangle(
            shared=R[:n, :n],
            crossed=own[:, :s, s : s + n],
            local=own[:, :s, :s],
            residual_shared=R[:n, n],
            residual_local=own[:, :s, -1],
            rest=R[n:, n],
            squares=sums,
        )
        for R, own, sums in parts
    ]


def costs_together(asked: Sequence[Asked]) -> list[Apart]:
    """`costs_directly` of every problem at its candidates, however many; all of one kind."""
    found: list[Apart] = []
    for part in _parts(asked, lambda one: one[0].d.logs.measured.size * len(one[1].z)):
        # Every candidate is a set of logs of its own.
        each = [m for m, there in part for _ in there.z]
        theta = [parameters_at(m.d.problem, np.asarray(there.z)) for m, there in part]
        states = [np.asarray(there.states) for _, there in part]
        E = [len(m.d.begin) for m in each]
        all_of_them = merged(each)
        with np.errstate(over="ignore", invalid="ignore"):
            squares = log_squares(
                all_of_them,
                side_by_side(all_of_them, 1),
                np.repeat(np.concatenate(theta), E, axis=0)[None],
                np.concatenate([own.reshape(own.shape[0] * own.shape[1], -1) for own in states])[None],
            )[0]
            own = np.split(squares, np.cumsum([x.shape[0] * x.shape[1] for x in states])[:-1])
            for (m, _), at, x, sums in zip(part, theta, states, own, strict=True):
                found.append(costs_of(m.d.problem, at, x, sums.reshape(x.shape[:2])))
    return found
