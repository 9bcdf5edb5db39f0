"""Inputs of rows that are missing, estimated from what the robot did afterwards.

A simulation holds every input until the next row. Where rows are missing and an input is another one after them, it changed at
one of them, or at the row that follows: one number per place says when. These are estimated together, to first order beside the
parameters, from the outputs after each place; the rows are put back with the inputs that come of it and with nothing measured.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..._float64 import in_float64
from ...logs import Log, LogSet
from ...robots.robot import Robot
from ...simulation.simulate import integrator_for, simulate, simulate_models
from ..confidence.agreement import errors_of
from ..result import Estimate, Fit
from .estimated_start import estimated_start
from .lost_rows import unknown_changes

Array = NDArray[np.float64]

_LONGEST = 10
"""Missing rows in one place up to which an input is taken to have changed once."""
_STEPS = 4
_NOTICEABLE = 1e-3
"""Share of the cost by which another step must lower it."""
_PRECISION = 12.0
"""Of a share that may be anything from nothing to one: the inverse of a uniform distribution's variance."""
_SECANT = 0.25
_STEP_OF_PARAMETERS = 1e-3
"""Steps of secants: of the share of the missing rows that had the new input, and of a parameter in units of its size."""
_LOOKED_AT = 25
"""Rows after a place that say at which of the missing ones an input changed."""
_AT_ONCE = 2_000_000
"""Samples that are simulated at once."""


class _Places:
    """A log's `after`, the samples after which rows are missing that are to be put back, and `rows`, how many are."""

    def __init__(self, log: Log, after: NDArray[np.int64]) -> None:
        rows = np.round(np.diff(log.time)[after] / log.sampling_interval).astype(int) - 1
        near = (rows >= 1) & (rows <= _LONGEST)
        self.after, self.rows = after[near], rows[near]

    def __len__(self) -> int:
        return len(self.after)

    def times(self, log: Log, place: int) -> tuple[float, float, float]:
        """When the last row before a place, and the first after it, were read, and until when to look at what it did."""
        before, first = self.after[place], self.after[place] + 1
        following = self.after[place + 1] if place + 1 < len(self) else len(log) - 1
        last = min(following, first + _LOOKED_AT)
        return float(log.time[before]), float(log.time[first]), float(log.time[last])

    def filled(self, log: Log, shares: Array) -> Log:
        """`log` with the rows put back, of which the last `shares` [places] have the input of the row after them."""
        at = np.repeat(self.after, self.rows)
        number = np.concatenate([np.arange(1, n + 1) for n in self.rows]) if len(self.rows) else np.zeros(0, int)
        of = np.repeat(self.rows, self.rows)
        time = log.time[at] + (log.time[at + 1] - log.time[at]) * number / (of + 1)
        new = np.clip(np.repeat(shares, self.rows) * of - (of - number), 0.0, 1.0)[:, None]
        inputs = log.inputs[at] + new * (log.inputs[at + 1] - log.inputs[at])
        order = np.argsort(np.concatenate([log.time, time]), kind="stable")
        outputs = np.concatenate([log.outputs, np.full((len(at), log.outputs.shape[1]), np.nan)])
        extra = log.extra
        if len(extra.columns):
            empty = pd.DataFrame(np.nan, index=range(len(at)), columns=extra.columns)
            extra = pd.concat([extra, empty], ignore_index=True).iloc[order]
        return replace(
            log,
            time=np.concatenate([log.time, time])[order],
            inputs=np.concatenate([log.inputs, inputs])[order],
            outputs=outputs[order],
            extra=extra,
        )


def _moved_after(log: Log, outputs: Array, noise: Mapping[str, float], times: tuple[float, float, float]) -> float:
    """Mean square, in units of the noise, of what the errors after a place changed by since the last one before it."""
    before, first, last = times
    errors, total = errors_of(log, np.nan_to_num(outputs, nan=np.inf)), 0.0
    for channel, error in errors.items():
        earlier = error[(log.time <= before) & np.isfinite(error)][-3:]
        later = error[(log.time >= first) & (log.time <= last)]
        later = later[np.isfinite(later)]
        if noise.get(channel, 0.0) > 0.0 and len(earlier) and len(later):
            total += float(np.mean(((later - np.median(earlier)) / noise[channel]) ** 2))
    return total


def _wider(known: Array, estimated: Array) -> list[float]:
    """Times what the standard errors of parameters are by one normal matrix [n, n] rather than by another, at least 1."""
    size = np.sqrt(np.maximum(np.diag(known), np.finfo(float).tiny))
    variances = [np.diag(np.linalg.pinv(each / np.outer(size, size), rcond=1e-10)) for each in (known, estimated)]
    return [float(x) for x in np.sqrt(np.maximum(variances[1] / np.maximum(variances[0], np.finfo(float).tiny), 1.0))]


def _step(
    own: Sequence[Array], common: Sequence[Array], residuals: Sequence[Array], shares: Sequence[Array]
) -> tuple[list[Array], Array, list[float]]:
    """The Gauss-Newton steps of every log's shares, whose changes of its residual [N] are `own` [N, places], and of the
    parameters, whose are `common` [N, n], with what `_wider` says of these.

    Each log's shares are eliminated for what all logs have in common.
    """
    triangles = [np.linalg.cholesky(c.T @ c + _PRECISION * np.eye(c.shape[1])) for c in own]
    pulls = [c.T @ r + _PRECISION * (s - 0.5) for c, r, s in zip(own, residuals, shares, strict=True)]
    mixed = [np.linalg.solve(t, c.T @ p) for t, c, p in zip(triangles, own, common, strict=True)]
    halves = [np.linalg.solve(t, g) for t, g in zip(triangles, pulls, strict=True)]
    known = np.sum([p.T @ p for p in common], axis=0)
    normal = known - np.sum([m.T @ m for m in mixed], axis=0)
    pull = np.sum([p.T @ r - m.T @ h for p, r, m, h in zip(common, residuals, mixed, halves, strict=True)], axis=0)
    moved = -np.asarray(np.linalg.lstsq(normal, pull, rcond=1e-10)[0], dtype=float)
    steps = [
        -np.asarray(np.linalg.solve(t.T, h + m @ moved), dtype=float)
        for t, h, m in zip(triangles, halves, mixed, strict=True)
    ]
    return steps, moved, _wider(known, normal)


@dataclass(frozen=True)
class LostInputs:
    """`logs` with rows put back in so many `places`; `wider`, by parameter, times what its standard error is if the moments
    that were estimated for it were known. `price` is what the estimated moments must lower chi-squared by to be worth it: the
    evidence (Laplace's approximation) pays for those alone of which the outputs say something."""

    logs: LogSet
    places: int
    wider: Mapping[str, float]
    price: float = 0.0

    def widened(self, fit: Fit) -> Fit:
        """A fit to these logs with the errors that estimated moments make of its own."""
        factors = np.array([self.wider.get(name, 1.0) for name in fit.free_names])
        parameters = dict(fit.parameters)
        for name, factor in zip(fit.free_names, factors, strict=True):
            e = parameters[name]
            parameters[name] = Estimate.of(e.value, e.std_error * factor, e.unit, e.status)
        return replace(fit, parameters=parameters, covariance=np.asarray(fit.covariance) * np.outer(factors, factors))


def with_inputs_between(logs: LogSet) -> LogSet:
    """`logs` with the rows in which an input changed put back, the input there halfway to what it was afterwards, as a command
    is that changes all the time. Places of more than 10 missing rows stay as they are."""
    places = [_Places(log, after) for log, after in zip(logs, unknown_changes(logs), strict=True)]
    return LogSet([own.filled(log, np.full(len(own), 0.5)) for log, own in zip(logs, places, strict=True)])


@in_float64
def with_lost_inputs(robot: Robot, logs: LogSet, noise: Mapping[str, float]) -> LostInputs:
    """`logs` with the rows in which an input changed put back, as `robot` tells when it did.

    The moments are estimated together with the free parameters, from those of `robot` on. `noise`: each channel's
    standard deviation. Places of more than 10 missing rows stay as they are.
    """
    places = [_Places(log, after) for log, after in zip(logs, unknown_changes(logs), strict=True)]
    count = sum(map(len, places))
    if not count:
        return LostInputs(logs, 0, {})

    def filled(shares: Sequence[Array]) -> LogSet:
        return LogSet([own.filled(log, s) for log, own, s in zip(logs, places, shares, strict=True)])

    shares: list[Array] = [np.full(len(own), 0.5) for own in places]
    now = filled(shares)
    start, steps = estimated_start(robot, now, noise), integrator_for(robot, now)

    def scaled(log: Log, outputs: Array) -> Array:
        found = errors_of(log, np.nan_to_num(outputs, nan=np.inf))
        parts = [np.nan_to_num(found[c] / noise[c], posinf=0.0, neginf=0.0) for c in found if noise.get(c, 0.0) > 0.0]
        return np.concatenate(parts)

    def residuals(model: Robot, of: LogSet) -> list[Array]:
        return [scaled(log, y) for log, y in zip(of, simulate(model, of, start=start, integrator=steps), strict=True)]

    def cost(of: Sequence[Array], shares: Sequence[Array]) -> float:
        return float(sum(r @ r for r in of) + sum(_PRECISION * ((s - 0.5) ** 2).sum() for s in shares))

    def varied(model: Robot, moves: Sequence[tuple[int, Array]]) -> Iterator[tuple[Log, Array]]:
        """Logs [of so many places] filled with other shares, and what the model does on them."""
        chunk = max(_AT_ONCE // max(map(len, now)), 1)
        for first in range(0, len(moves), chunk):
            some = moves[first : first + chunk]
            many = LogSet(
                [replace(places[e].filled(logs[e], s), name=f"{logs[e].name} {k}") for k, (e, s) in enumerate(some)]
            )
            begin = {name: np.array([values[e] for e, _ in some]) for name, values in start.items()}
            yield from zip(many, simulate(model, many, start=begin, integrator=steps), strict=True)

    def columns(model: Robot, shares: Sequence[Array], here: Sequence[Array]) -> list[Array]:
        """What every log's residual changes by with each of its own shares, [N, places]."""
        moves, by = [], []
        for e, s in enumerate(shares):
            for k in range(len(s)):
                other = s.copy()
                other[k] += _SECANT if s[k] <= 0.5 else -_SECANT
                moves.append((e, other))
                by.append(other[k] - s[k])
        found: list[list[Array]] = [[] for _ in places]
        for (e, _), step, (log, y) in zip(moves, by, varied(model, moves), strict=True):
            found[e].append((scaled(log, y) - here[e]) / step)
        return [np.stack(own, axis=1) if own else np.zeros((len(r), 0)) for own, r in zip(found, here, strict=True)]

    def at_rows(shares: Sequence[Array]) -> list[Array]:
        """The shares with which each input changes at one of the missing rows or at the one after them, whichever leaves
        the errors after the place nearest to those before it: far from it, a search ends at shares that are best near by."""
        moves = [
            (e, np.where(np.arange(len(s)) == k, number / own.rows[k], s))
            for e, (own, s) in enumerate(zip(places, shares, strict=True))
            for k in range(len(s))
            for number in range(own.rows[k] + 1)
        ]
        of = [(e, k, n) for e, own in enumerate(places) for k in range(len(own)) for n in range(own.rows[k] + 1)]
        found, least = [s.copy() for s in shares], {}
        for (e, k, number), (log, y) in zip(of, varied(robot, moves), strict=True):
            moved = _moved_after(log, y, noise, places[e].times(logs[e], k))
            if moved < least.get((e, k), np.inf):
                least[e, k], found[e][k] = moved, number / places[e].rows[k]
        return found

    def of_parameters(model: Robot, of: LogSet, here: Sequence[Array]) -> list[Array]:
        table = model.parameters
        sizes = [_STEP_OF_PARAMETERS * max(abs(table[n].value), table[n].typical or 0.0) or 1e-6 for n in names]
        others = [model.with_values(**{n: table[n].value + h}) for n, h in zip(names, sizes, strict=True)]
        if not others:
            return [np.zeros((len(r), 0)) for r in here]
        every = simulate_models(others, of, start=start, integrator=steps)
        return [
            np.stack([(scaled(log, y) - r) / h for y, h in zip(ys, sizes, strict=True)], axis=1)
            for log, ys, r in zip(of, every, here, strict=True)
        ]

    def moved_by(model: Robot, step: Array) -> Robot:
        table = model.parameters
        values = {n: table[n].value + float(h) for n, h in zip(names, step, strict=True)}
        return model.with_values(**{n: table[n].inside(v) for n, v in values.items()})

    names, wider, price = robot.parameters.free_names, {}, 0.0
    here = residuals(robot, now)
    best = cost(here, shares)
    begun, first = at_rows(shares), start
    start = estimated_start(robot, filled(begun), noise)
    then = residuals(robot, filled(begun))
    if cost(then, begun) < best:
        shares, now, here, best = begun, filled(begun), then, cost(then, begun)
    else:
        start = first
    for _ in range(_STEPS):
        own, common = columns(robot, shares, here), of_parameters(robot, now, here)
        wanted, step, errors = _step(own, common, here, shares)
        wider = dict(zip(names, errors, strict=True))
        price = sum(float(np.linalg.slogdet(np.eye(c.shape[1]) + c.T @ c / _PRECISION)[1]) for c in own)
        before = best
        for share in (1.0, 0.3):
            there: list[Array] = [np.clip(s + share * w, 0.0, 1.0) for s, w in zip(shares, wanted, strict=True)]
            model, of = moved_by(robot, share * step), filled(there)
            then = residuals(model, of)
            if cost(then, there) < best:
                robot, now, shares = model, of, there
                start = estimated_start(robot, now, noise)  # which had made up for moments that were off
                here = residuals(robot, now)
                best = cost(here, shares)
                break
        if not best < (1.0 - _NOTICEABLE) * before:
            break
    price += sum(_PRECISION * float(((s - 0.5) ** 2).sum()) for s in shares)
    return LostInputs(now, count, wider, price)
