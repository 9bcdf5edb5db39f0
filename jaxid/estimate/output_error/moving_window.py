r"""Output error on-line: fitted again and again to the last seconds, each time from where the last fit ended.

A window has initial states of its own, and its parameters start at the last estimate, so that a linearisation or two,
machine code on a few hundred samples, are all that a fit takes. What the samples before the window said of the parameters
may stand beside it, forgotten exponentially: then what a window does not excite stays where it was seen last, and does not
wander. `change` asks whether the window contradicts it.
"""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations
from math import comb

import numpy as np
import scipy
from jax.typing import ArrayLike
from numpy.typing import NDArray

from ..._float64 import in_float64
from ...logs import Log, LogSet
from ...parameters import ParameterError
from ...robots.given import check_free
from ...robots.robot import Robot
from .change import Change, Knowledge, change, square_root
from .direct import states_after
from .laid_out import Direct, direct
from .past_window import Past, agrees, last_before
from .problem import Problem, Structure
from .setup import build
from .window_colour import Neighbours, residual_at
from .window_minimum import SEEN, Minimum, minimum

Array = NDArray[np.float64]
_BETTER = 0.5
"""Share of what a window leaves below which another beginning has led to another minimum."""
_APART = 9.0
"""Chi-squared by which one set of changed parameters must be likelier than another: three standard deviations."""
_SPARSE = 0.1
"""Share of a window's time that has passed, at least, between two whole windows that are kept."""
_MOST_TRIED = 100
"""Sets of parameters of one number that are refitted to tell which have changed."""
_INFORMED = 0.3
"""Of what is forgotten of a parameter in the time of a window, the share that the window must bring back to inform of it."""


@dataclass(frozen=True)
class WindowFit:
    """What the window that ends at `time` [s] says.

    - `values`, `std_errors`: of the free parameters by symbol, for noise of the levels given, as related from sample to sample
      as the residuals so far; NaN errors for what neither the window nor the memory determines.
    - `informed`: parameters that the window itself tells; the others stand where they were seen last.
    - `normalised_rms`: of the residual, in units of the noise: 1 where the model fits. Where it is more, the errors are as much
      larger.
    - `sound`: whether the fit stood still and leaves no more than noise, and no sample of the window is from before an alarm.
      A window across a change is not sound, however little of the change it shows, and nothing is remembered of it.
    - `p_value`: how often the window would differ so much from what was known before, by chance; NaN while nothing was.
    - `alarm`: whether that is rarer than the window's `alarm`. The estimates are then of the window alone.
    - `changed`: the parameters that have changed, once a sound window shows the new ones: as few as explain the difference,
      the best one first; all of those that explain it alike.
    """

    time: float
    values: dict[str, float]
    std_errors: dict[str, float]
    informed: tuple[str, ...]
    normalised_rms: float
    sound: bool
    p_value: float
    alarm: bool
    changed: tuple[str, ...]


class MovingWindow:
    """Estimates of `robot`'s free parameters from the last `seconds`, by output error.

    **Arguments:**

    - `robot`: with the values to begin with, such as `Fit.robot`.
    - `seconds`: length of the window.
    - `noise`: standard deviation of every measured channel, such as `Fit.noise`.
    - `memory`: time constant [s] with which what was seen before the window is forgotten; None takes the window alone.
    - `alarm`: how often, of windows in which nothing changes, a change may be told.

    Raises `ParameterError` if no parameter is free, `ValueError` for a window, a memory, noise or a false-alarm rate that is
    none, and for a robot without machine code.
    """

    def __init__(
        self,
        robot: Robot,
        seconds: float,
        *,
        noise: Mapping[str, float],
        memory: float | None = None,
        alarm: float = 0.001,
    ):
        check_free(robot)
        known = {name for name, level in noise.items() if level > 0.0}
        missing = [n for n in robot.channels.outputs if n not in known and not robot.channels.stood_in(n, known)]
        if missing:
            raise ValueError(f"no noise is given for {', '.join(missing)}; give each channel's standard deviation, > 0")
        for what, value in (("window", seconds), ("memory", np.inf if memory is None else memory)):
            if not value > 0:
                raise ValueError(f"a {what} of {value} s is none; give a positive time")
        if not 0 < alarm < 1:
            raise ValueError(f"a false-alarm rate of {alarm} is not between 0 and 1")
        self.robot, self.seconds, self.noise, self.memory, self.alarm = robot, seconds, dict(noise), memory, alarm
        self.names = robot.parameters.free_names
        self._theta = np.array([robot.parameters[name].value for name in self.names])
        self._first = self._trusted = self._theta
        channels = robot.channels
        self._rows = np.zeros((0, 1 + len(channels.inputs) + len(channels.measured)))
        self._past: list[Knowledge] = []
        self._windows: list[Past] = []
        self._since = -np.inf
        self._quiet = -np.inf
        self._posed: tuple[Structure, Problem] | None = None
        self._last: tuple[Direct, Array, Array, float] | None = None
        self._neighbours = Neighbours.none(len(channels.measured))
        self._new = 0

    def add(self, time: ArrayLike, inputs: ArrayLike, outputs: ArrayLike) -> None:
        """One sample, `time` [s], `inputs` [nu] and `outputs` [ny], or m of them, [m], [m, nu] and [m, ny]; NaN where nothing
        was measured. Optional channels may be left out. Raises `ValueError` for shapes that do not fit and for times that do
        not rise."""
        t, u, y = np.atleast_1d(np.asarray(time, float)), np.asarray(inputs, float), np.asarray(outputs, float)
        channels = self.robot.channels
        u, y = u.reshape(len(t), -1), y.reshape(len(t), -1)
        most = len(channels.measured)
        if u.shape[1] != len(channels.inputs) or not len(channels.outputs) <= y.shape[1] <= most:
            raise ValueError(
                f"{u.shape[1]} inputs and {y.shape[1]} outputs a sample do not fit {self.robot.name!r}, which has "
                f"{', '.join(channels.inputs)} and {', '.join(channels.measured)}"
            )
        y = np.concatenate([y, np.full((len(t), most - y.shape[1]), np.nan)], axis=1)
        rows = np.concatenate([self._rows, np.concatenate([t[:, None], u, y], axis=1)])
        self._new += len(t)
        if not (np.diff(rows[len(self._rows) - 1 if len(self._rows) else 0 :, 0]) > 0).all():
            raise ValueError("times must rise from sample to sample")
        # The sample with which a window begins is in it.
        self._rows = rows[np.searchsorted(rows[:, 0], rows[-1, 0] - self.seconds * (1.0 + 1e-9)) :]

    @property
    def full(self) -> bool:
        """Whether a whole window of samples has come."""
        return bool(
            len(self._rows) > 1 and self._rows[-1, 0] - self._rows[0, 0] > self.seconds * (1.0 - 1e-6) - self._step
        )

    @property
    def _step(self) -> float:
        return float(np.median(np.diff(self._rows[:, 0])))

    @in_float64
    def refit(self) -> WindowFit:
        """The fit to the window as it is. Raises `ValueError` while it is not full."""
        if not self.full:
            raise ValueError(f"the window of {self.seconds} s is not full yet; add more samples")
        known, past = (last_before(own, float(self._rows[0, 0])) for own in (self._past, self._windows))
        d, states = self._problem()
        found = self._first_minimum(d, states, known)
        if self._last is None and self._noticed(d, found):
            d, states = self._problem()
            found = minimum(d, found.theta, states, *self._prior(known))
        contrast = self._contrast(known, found)
        if (
            contrast.p_value < self.alarm
            and past is not None
            and (p := agrees(past, self._seen(found), self._decay)) >= self.alarm
        ):
            # What was known was not what its linearisation says, which is of no use.
            known, contrast = None, Change(p, ())
            found = minimum(d, found.theta, found.states, *self._prior(None))
        alarm = bool(contrast.p_value < self.alarm)
        beside = None if alarm else known
        if alarm:
            # What was seen before holds no longer: the window alone.
            found = minimum(d, found.theta, found.states, *self._prior(None))
            contrast = self._contrast(known, found)
        d, found = self._from_elsewhere(d, found, beside)
        # What has changed did so after the last window without an alarm, or before what that showed.
        self._quiet = self._quiet if alarm else float(self._rows[-1, 0])
        self._last = (d, found.theta, found.states, float(self._rows[0, 0]))
        samples, squares = self._left(d, found)
        sound = self._fits(d, found) and not (alarm and self._rows[0, 0] < self._quiet)
        if found.converged:
            self._theta = found.theta
        if sound and self._rows[0, 0] >= self._since and not alarm:
            seen = self._seen(found)
            whole = seen if known is None else seen.with_(known, self._decay)
            self._past.append(whole)
            # Whole windows take up room; of what is known at every sample a few are enough.
            if not self._windows or whole.time - self._windows[-1].time > _SPARSE * self.seconds:
                self._windows.append(Past(whole.time, d, found, known))
        root, _ = self._prior(beside)
        own = _information(found.triangle, len(self.names))
        errors, before = _errors(own + root.T @ root, found.theta), _errors(root.T @ root, found.theta)
        told = np.flatnonzero(self._told(found.theta, errors, before))
        left = float(np.sqrt(squares.sum() / max(int(samples.sum()), 1)))
        self._trusted = found.theta if sound else self._trusted
        if found.converged and not alarm:
            self._noticed(d, found)
        return WindowFit(
            time=float(self._rows[-1, 0]),
            values=dict(zip(self.names, found.theta.tolist(), strict=True)),
            std_errors=dict(zip(self.names, (errors * max(left, 1.0)).tolist(), strict=True)),
            informed=tuple(self.names[i] for i in told),
            normalised_rms=left,
            sound=sound,
            p_value=contrast.p_value,
            alarm=alarm,
            changed=self._changed(d, known, found, contrast) if alarm and sound and known is not None else (),
        )

    def _left(self, d: Direct, found: Minimum) -> tuple[NDArray[np.int64], Array]:
        """How many samples every channel has, and the sum of squares that is left of it, in units of the noise itself, of which
        what it does in the long run was the weight."""
        return np.count_nonzero(d.logs.weight[0, :, :, 0], axis=0), found.by_channel * self._neighbours.long_run

    def _fits(self, d: Direct, found: Minimum) -> bool:
        """Whether the fit stood still and leaves no more than noise."""
        return bool(found.converged and self._no_more_than_noise(*self._left(d, found)))

    def _first_minimum(self, d: Direct, states: Array, known: Knowledge | None) -> Minimum:
        """The minimum near the last values or, where a simulation from there diverges, near the last sound ones or the first
        ones."""
        for begun in (self._theta, self._trusted):
            with suppress(ParameterError):
                return minimum(d, begun, states, *self._prior(known))
        return minimum(d, self._first, states, *self._prior(known))

    def _from_elsewhere(self, d: Direct, found: Minimum, beside: Knowledge | None) -> tuple[Direct, Minimum]:
        """The window and what was `found` of it, or what the last sound values, or the first, lead to where that leaves far
        less: a sensor that failed for a while leads the values to where no step goes back from."""
        if self._fits(d, found):
            return d, found
        last, self._last = self._last, None
        fresh, states = self._problem()
        self._last = last
        for begun in (self._trusted, self._first):
            with suppress(ParameterError):  # it diverges from there
                other = minimum(fresh, begun, states, *self._prior(beside))
                if other.converged and other.squares < _BETTER * found.squares:
                    d, found = fresh, other
        return d, found

    def _noticed(self, d: Direct, found: Minimum) -> bool:
        """Take what is left of the samples that came since the last time for noise; whether it is related from one to the
        next."""
        there = np.asarray(d.logs.weight[0, :, :, 0]) > 0
        self._neighbours = self._neighbours.with_(residual_at(d, found.theta, found.states), there, self._new)
        self._new = 0
        return bool(np.any(self._neighbours.correlation))

    def _changed(self, d: Direct, known: Knowledge, found: Minimum, contrast: Change) -> tuple[str, ...]:
        """The fewest parameters with which, were they others and the rest what it was `known` to be, the window leaves no
        more than it does alone, refitted: a difference of estimates tells it only where the window is linear in all. Where
        several do alike, all of them. Where there are too many to try, as the difference tells it (`contrast`)."""
        n = len(self.names)
        for count in range(1, n):
            if comb(n, count) > _MOST_TRIED:
                return tuple(self.names[i] for i in contrast.changed)
            costs = {places: self._held(d, known, found, places) for places in combinations(range(n), count)}
            left = [places for places, more in costs.items() if scipy.special.chdtrc(n - count, more) > self.alarm]
            if left:
                least = min(costs[places] for places in left)
                near = sorted((p for p in left if costs[p] < least + _APART), key=lambda p: costs[p])
                return tuple(dict.fromkeys(self.names[i] for places in near for i in places))
        return self.names

    def _held(self, d: Direct, known: Knowledge, found: Minimum, places: tuple[int, ...]) -> float:
        """What the window leaves more, beside what was `known` of all but the parameters at `places`, than it does alone."""
        gone, mean = np.isin(np.arange(len(self.names)), places), known.mean
        root, least = square_root(known.without(gone).information), np.inf
        for begun in (np.where(gone, found.theta, mean), mean, found.theta):
            with suppress(ParameterError):  # it diverges from there
                end = minimum(d, begun, found.states, root, mean)
                least = min(least, end.squares + float(np.sum((root @ (end.theta - mean)) ** 2)))
        return max(least - found.squares, 0.0)

    def _no_more_than_noise(self, samples: NDArray[np.int64], squares: Array) -> bool:
        """Whether all channels together and each by itself leave no more than their noise: what one of them lacks, such as a
        sensor that reads the same all the time, would make up for what another has too much."""
        there = samples > 0
        if not there.any():
            return True
        # As many independent ones have sums of squares that scatter as much.
        fewer = 1.0 / self._neighbours.of_squares
        each = scipy.special.chdtrc((samples * fewer)[there], (squares * fewer)[there])
        count = samples.sum() ** 2 / np.sum(samples / fewer)
        whole = scipy.special.chdtrc(count, squares.sum() * count / samples.sum())
        return bool(whole > self.alarm and np.all(each > self.alarm / there.sum()))

    def _seen(self, found: Minimum) -> Knowledge:
        """What the window alone says."""
        n = len(self.names)
        own = _information(found.triangle, n)
        pull = own @ found.theta - found.triangle[:, :n].T @ found.triangle[:, -1]
        return Knowledge(float(self._rows[-1, 0]), found.theta, own, pull, own)

    def _contrast(self, known: Knowledge | None, found: Minimum) -> Change:
        size = np.abs(found.theta) + (found.theta == 0)
        return change(known if found.converged else None, self._seen(found), size, self.alarm)

    def forget(self, names: Iterable[str] | None = None) -> None:
        """Forget what was seen of the parameters `names`, or of all, before now: after a change their old values are no news,
        and the alarm ends. Windows that began before are not remembered. Raises `ValueError` for names that are none."""
        wanted = set(self.names if names is None else names)
        if wanted - set(self.names):
            raise ValueError(f"{', '.join(sorted(wanted - set(self.names)))}: not among {', '.join(self.names)}")
        known = last_before(self._past, float(self._rows[0, 0])) if len(self._rows) else None
        gone = np.array([name in wanted for name in self.names])
        self._past = [] if known is None or gone.all() else [known.without(gone)]
        self._windows = []
        self._since = float(self._rows[-1, 0]) if len(self._rows) else -np.inf

    def _prior(self, known: Knowledge | None) -> tuple[Array, Array]:
        """Root [m, n] of the information that stands beside the window, and its mean [n]."""
        n = len(self.names)
        if known is None or self.memory is None:
            return np.zeros((0, n)), self._theta
        return np.sqrt(self._decay) * square_root(known.information), known.mean

    @property
    def _decay(self) -> float:
        """What is left after a window of information from before it."""
        return 1.0 if self.memory is None else float(np.exp(-self.seconds / self.memory))

    def _told(self, values: Array, errors: Array, before: Array) -> NDArray[np.bool_]:
        """Which parameters the window informs of [n], `errors` being those with it and `before` without."""
        alone = np.isnan(before)
        with np.errstate(divide="ignore"):
            gained = errors**-2 - np.where(alone, 0.0, before**-2)
            lost = np.where(alone, values**-2.0, before**-2 * (1.0 / self._decay - 1.0))
        return np.isfinite(errors) & (gained > _INFORMED * lost)

    def _problem(self) -> tuple[Direct, Array]:
        """The window in lanes, and initial states near those that it had in the last one."""
        channels, rows = self.robot.channels, self._rows
        nu = len(channels.inputs)
        time, u, y = rows[:, 0] - rows[0, 0], rows[:, 1 : 1 + nu], rows[:, 1 + nu :]
        if self._posed is None:
            log = Log.from_arrays("window", time, u, y, channels)
            start = dict(zip(self.names, self._theta.tolist(), strict=True))
            structure, problem, _ = build(self.robot, LogSet([log]), start=start, initial="estimate")
            levels = np.array(
                [self.noise.get(c, s) for c, s in zip(channels.measured, np.asarray(problem.sigma), strict=True)]
            )
            self._posed = structure, replace(problem, sigma=levels)
        structure, problem = self._posed
        there = np.isfinite(y) & np.asarray(problem.mask)[0].any(axis=0)
        start = {name: np.asarray(value) for name, value in problem.start.items()}
        begun = {c: y[0, i] for i, c in enumerate(channels.measured) if c in start and there[0, i]}
        if self._last is not None:
            last, theta, states, began = self._last
            after = states_after(last, theta, states, int(round((rows[0, 0] - began) / self._step)))
            begun = {**dict(zip(self.robot.states, after, strict=True)), **begun}
        start |= {name: np.array([value]) for name, value in begun.items() if np.isfinite(value)}
        problem = replace(
            problem,
            sigma=np.asarray(problem.sigma) * np.sqrt(self._neighbours.long_run),
            dt=np.append(np.diff(time), self._step)[None],
            inputs=u[None],
            outputs=np.where(there, y, 0.0)[None],
            mask=there[None],
            start=start,
        )
        d = direct(structure, problem)
        if d is None:
            raise ValueError(f"{self.robot.name!r} has no machine code; fit its windows one by one with output_error")
        return d, np.zeros((1, len(structure.state_names)))


def _information(triangle: Array, n: int) -> Array:
    return triangle[:, :n].T @ triangle[:, :n]


def _errors(information: Array, values: Array) -> Array:
    """Standard errors [n]; NaN for parameters with a part in directions that nothing shows."""
    size = np.sqrt(np.diag(information))
    known = size > 0
    errors = np.full(len(values), np.nan)
    if known.any():
        unit = information[np.ix_(known, known)] / np.outer(size[known], size[known])
        eigen, vectors = np.linalg.eigh(unit)
        kept = eigen > SEEN**2 * eigen.max()
        blind = np.any(np.abs(vectors[:, ~kept]) > 1e-3, axis=1)
        spread = np.sqrt(np.sum(vectors[:, kept] ** 2 / eigen[kept], axis=1)) / size[known]
        errors[known] = np.where(blind, np.nan, spread)
    return errors
