"""Linear equations for the free parameters from stretches of logs, each with an unknown initial speed (eqs. 30 and 31)."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._float64 import in_float64
from ...logs import Log
from ...robots.robot import Robot
from .integrals import Form
from .log_rows import Rows, gather, measured_speeds
from .memory import memory
from .regressors import Array, axes_that_matter, evaluate, still_at, walks_of
from .walks import Walk


@dataclass(frozen=True)
class WindowEquations:
    """Linear equations `regressors @ theta = targets` of all logs, K rows.

    `equation` [K] says which speed's balance a row is (index into `speeds`), `stretch` [K] which stretch of a log it
    belongs to, `sample` [K] its place among the samples of all logs one after the other (neighbouring stretches share
    one), `log` [K] and `time` [K] where it was measured. `logs` [N] is the log of each of those samples, `window` the
    samples of a stretch and `memory` those after which the motion has half forgotten.
    `dropped` is the share of intervals left out because something stood still or was not measured.
    """

    regressors: Array
    targets: Array
    equation: NDArray[np.int64]
    stretch: NDArray[np.int64]
    sample: NDArray[np.int64]
    log: NDArray[np.int64]
    time: Array
    logs: NDArray[np.int64]
    names: tuple[str, ...]
    speeds: tuple[str, ...]
    form: Form
    window: int
    memory: int
    dropped: float

    def __len__(self) -> int:
        return len(self.targets)

    def as_they_came(self) -> tuple[Array, Array]:
        """Regressors [m, n] and targets [m] of equations with independent noise of one size, log by log and by time, as
        `recursive_least_squares` takes them.

        Of a stretch of K rows, whose unknown speed has been taken off, there are K - 1: every row less the mean of those before
        it (Helmert's contrasts). Every speed's equations are in units of what least squares leaves of them.
        """
        F, y = self._contrasts(np.column_stack([self.regressors, self.targets]))
        later = np.flatnonzero(np.append(False, self.stretch[1:] == self.stretch[:-1]))
        equation, size = self.equation[later], np.ones(len(self.speeds))
        for _ in range(2):  # by what is left, and by what is left when weighed by that
            weight = 1.0 / size[equation]
            theta = np.linalg.lstsq(F * weight[:, None], y * weight, rcond=None)[0]
            squares = np.bincount(equation, weights=(y - F @ theta) ** 2, minlength=len(size))
            left = np.sqrt(squares / np.maximum(np.bincount(equation, minlength=len(size)), 1))
            size = np.where(left > 0.0, left, size)
        order = np.lexsort((equation, self.time[later], self.log[later]))
        return (F / size[equation][:, None])[order], (y / size[equation])[order]

    def _contrasts(self, rows: Array) -> tuple[Array, Array]:
        """Every row [K, n + 1] of a stretch less the mean of those before it, scaled to the noise of one row."""
        first = np.append(True, self.stretch[1:] != self.stretch[:-1])
        begins = np.flatnonzero(first)[np.cumsum(first) - 1] if len(first) else np.zeros(0, np.int64)
        place = np.arange(len(rows)) - begins
        sums = np.cumsum(rows, axis=0)
        before = sums - rows - (sums - rows)[begins]
        later = place > 0
        mean = before[later] / place[later][:, None]
        scaled = np.sqrt(place[later] / (place[later] + 1.0))[:, None] * (rows[later] - mean)
        return scaled[:, :-1], scaled[:, -1]


def _stretches(
    whole: NDArray[np.bool_], log: NDArray[np.int64], window: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of sample numbers and of their stretches' numbers.

    Usable intervals that follow one another are cut into stretches of `window` samples; where one ends the next begins,
    at the same sample, so that every usable interval is in one of them.
    """
    N = len(whole)
    usable = np.append(whole[:-1] & (log[1:] == log[:-1]), False) if N else np.zeros(0, bool)
    interval = np.flatnonzero(usable)
    begins = np.flatnonzero(usable & ~np.append(False, usable[:-1]))
    chain = np.cumsum(np.isin(interval, begins)) - 1
    first = (interval - begins[chain]) % (window - 1) == 0 if len(interval) else np.zeros(0, bool)
    stretch = np.cumsum(first) - 1
    sample = np.concatenate([interval, interval[np.append(first[1:], True)] + 1]) if len(interval) else interval
    number = np.concatenate([stretch, np.arange(stretch[-1] + 1)]) if len(interval) else stretch
    order = np.lexsort((sample, number))
    return sample[order], number[order]


@in_float64
def window_equations(
    robot: Robot, logs: Iterable[Log], form: Form = "momentum", window: int | None = None
) -> WindowEquations:
    """The equations that `logs` give for the free parameters of `robot`.

    Logs are cut into stretches of `window` samples (by default of `memory`), each of which begins where the last one
    ended. Within one, `P(t_k) = P_0 + integral of Q` holds at every sample with one unknown P_0, which is eliminated by
    taking the stretch's mean off. That is generalised least squares on the differences of eq. 30, whose noise in neighbouring
    intervals has correlation -1/2; two samples a stretch are eq. 31, all consecutive intervals.

    Left out are intervals in which a rubbing axis that matters to the equation stands still or turns round (friction
    is below its Coulomb level then), those in which any axis turns round without resting, speeds that stay below three
    times their noise throughout a log (taken as zero), and gaps of more than five samples; shorter gaps are bridged by
    interpolation.

    The equations are exact where they are linear in the parameters and else linearised about the robot's numbers.
    Raises `LogError` for logs without the robot's speeds.
    """
    (found,) = equations_of_each(robot, [logs], form, window)
    return found


def equations_of_each(
    robot: Robot, several: Iterable[Iterable[Log]], form: Form = "momentum", window: int | None = None
) -> Iterator[WindowEquations]:
    """`window_equations` of several sets of logs, whose walks from sample to sample are done side by side. Call under
    float64."""
    if window is not None and window < 2:
        raise ValueError(f"A window of {window} sample(s) has no interval; use two or more.")
    names = measured_speeds(robot)
    each = [gather(robot, logs, names) for logs in several]
    theta = np.array([robot.parameters[name].value for name in robot.parameters.free_names], dtype=float)
    found = [*walks_of(robot, each, names, form, theta)]
    while each:
        yield _equations(robot, each.pop(0), found.pop(0), theta, names, form, window)


def _equations(
    robot: Robot,
    rows: Rows,
    walk: Walk | None,
    theta: Array,
    names: tuple[str, ...],
    form: Form,
    window: int | None,
) -> WindowEquations:
    """The equations of these rows about the free parameters' values `theta`."""
    remembered = memory(rows)
    window = remembered if window is None else window
    P, dP, impulse, dimpulse, rubbing, shares = evaluate(robot, rows, names, form, theta, walk=walk)

    # What acted since the log's first sample; in place, for these are the largest arrays of a fit.
    for state, change in ((P, impulse), (dP, dimpulse)):
        state[1:] -= np.cumsum(change, axis=0, out=change)[:-1]
    still, matters = still_at(rubbing, rows.log), axes_that_matter(shares)
    del impulse, dimpulse, shares
    complete = np.asarray(np.all(rows.seen, axis=1))
    crossing = np.append(rubbing[:-1] * rubbing[1:] < 0, np.zeros((1, rubbing.shape[1]), bool), axis=0)
    # A speed bends sharply where its own friction turns, which no interpolation between samples follows; it enters the
    # other speeds' equations, too.
    resting = still | np.append(still[1:], still[-1:], axis=0)
    turning = np.any((crossing & ~resting)[:, matters.any(axis=0)], axis=1)

    parts, count, dropped = [], 0, []
    for i in range(len(names)):
        stuck = np.any(still[:, matters[i]], axis=1)
        # Between two samples of opposite sign the axis may have stood still for a while, too.
        stuck = stuck | np.append(stuck[1:], False) | np.any(crossing[:, matters[i]], axis=1) | turning
        whole = rows.whole & ~stuck
        dropped.append(1.0 - whole.sum() / max(np.sum(rows.dt > 0), 1))
        sample, stretch = _stretches(whole, rows.log, window)
        sizes = np.bincount(stretch, weights=complete[sample])
        used = complete[sample] & rows.moved[sample, i] & (sizes[stretch] >= 2)
        sample, stretch = sample[used], np.unique(stretch[used], return_inverse=True)[1]
        sizes = np.maximum(np.bincount(stretch), 1)
        both = np.empty((len(sample), len(theta) + 1))
        both[:, :-1], both[:, -1] = dP[sample, i], P[sample, i]
        for column in both.T:
            column -= (np.bincount(stretch, weights=column) / sizes)[stretch]
        own = np.full(len(stretch), i)
        parts.append((both[:, :-1], both[:, :-1] @ theta - both[:, -1], own, stretch + count, sample))
        count += len(sizes)
    del P, dP
    F, y, equation, stretch, sample = (np.concatenate(column) for column in zip(*parts, strict=True))
    return WindowEquations(
        regressors=F,
        targets=y,
        equation=equation,
        stretch=stretch,
        sample=sample,
        log=rows.log[sample],
        time=rows.time[sample],
        logs=rows.log,
        names=robot.parameters.free_names,
        speeds=names,
        form=form,
        window=window,
        memory=remembered,
        dropped=float(np.mean(dropped)),
    )
