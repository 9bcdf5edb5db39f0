"""The filter of missing forces (`force_filter`) in NumPy, the robot's own step as machine code: nothing is compiled for it.

All logs and all cubature points of a sample go through one call of the step, so that going through the samples in Python
takes no longer than a compiled loop over them.
"""

from collections.abc import Mapping
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernel.call import System
from ...kernel.dense import solved
from ...kernel.direct import outputs, tangents
from ...kernel.groups import grouped, ungrouped
from ...kernel.machine import lanes
from ...kernel.traced import shown_states
from ...robots.effect import Scalars
from ...simulation.direct import machine_model
from ...simulation.records import commanded, in_motion
from .force_filter import LEAST, PREFIX, Setting

Array = NDArray[np.float64]
_QUIETLY = partial(np.errstate, all="ignore")
"""Logs on which the filter is not finite say so by their numbers."""


@lru_cache(256)
def _showing_states(system: System, states: int) -> System:
    """The same with its states as outputs, before those that it has."""

    def shown(p: Scalars, x: Scalars, u: Scalars):
        return (*x, *system.output(p, x, u))

    return system.showing(shown, states + system.outputs, "states and outputs")


class _Steps(NamedTuple):
    """A robot's step over E logs, a multiple of the lanes: its `system` with n states shown; the outputs are the states
    `shown`, or other functions of them (None).

    Laid out in lanes: `shares` of an interval [m, L], parameters `p` [G, P, L], inputs `u` [G, T, R, U, L], intervals `dt`
    [G, T, L].
    """

    system: System
    shown: list[int] | None
    shares: Array
    p: Array
    u: Array
    dt: Array

    def _run(self, x: Array, k: int, times: int, samples: int):
        """What machine code reads of the states [times E, n] at the k-th sample, `times` of each log."""

        def again(a: Array) -> Array:
            return np.concatenate([a] * times) if times > 1 else np.ascontiguousarray(a)

        at = slice(k, k + 1)
        u, dt = (again(np.repeat(a[:, at], samples, axis=1)) for a in (self.u, self.dt))
        return self.shares, again(self.p), grouped(x), u, dt, np.zeros((len(dt), samples, 0, lanes()))

    def onward(self, cloud: Array, k: int) -> Array:
        """States [E, m, n] of every log at the k-th sample, an interval later."""
        E, m, n = cloud.shape
        flat = np.swapaxes(cloud, 0, 1).reshape(m * E, n)
        after = ungrouped(outputs(self.system, self._run(flat, k, m, 2)), m * E)[:, 1, :n]
        return np.swapaxes(after.reshape(m, E, n), 0, 1)

    def seen(self, x: Array, k: int) -> tuple[Array, Array]:
        """Outputs [E, ny] in the states [E, n] and their slopes [E, ny, n]."""
        E, n = x.shape
        if self.shown is not None:
            return x[:, self.shown], np.broadcast_to(np.eye(n)[self.shown], (E, len(self.shown), n))
        run, turned = self._run(x, k, 1, 1), np.broadcast_to(np.eye(n)[:, :, None], (E // lanes(), n, n, lanes()))
        dy = tangents(self.system, (), run, np.zeros((E // lanes(), n, 0, lanes())), turned)
        return ungrouped(outputs(self.system, run), E)[:, 0, n:], ungrouped(dy, E)[:, 0, n:]


def _root(covariance: Array, floor: Array) -> Array:
    """`cubature.root` of many covariances [E, n, n]."""
    L = np.zeros_like(covariance)
    for j in range(covariance.shape[-1]):
        row = L[:, j, :j]
        pivot = np.sqrt(np.maximum(covariance[:, j, j] - (row * row).sum(axis=1), floor[:, j]))
        crossed = (L[:, j + 1 :, :j] @ row[:, :, None])[..., 0]
        L[:, j, j] = pivot
        L[:, j + 1 :, j] = (covariance[:, j + 1 :, j] - crossed) / pivot[:, None]
    return L


def _corrected(mean: Array, P: Array, expected: Array, slope: Array, y: Array, there: Array, noise: Array):
    """`cubature.measured` of many moments: mean [E, n] and covariance [E, n, n] after the outputs `y` [E, ny]."""
    first = mean
    for i in range(y.shape[1]):
        c = slope[:, i]
        surprise = y[:, i] - expected[:, i] - (c * (mean - first)).sum(axis=1)
        along = (P @ c[:, :, None])[..., 0]
        variance = (c * along).sum(axis=1) + noise[:, i] ** 2
        gain = np.where(there[:, i, None], along / variance[:, None], 0.0)
        mean = mean + gain * surprise[:, None]
        kept = P - gain[:, :, None] * along[:, None, :]
        kept = kept - (kept @ c[:, :, None]) * gain[:, None, :]
        P = kept + gain[:, :, None] * gain[:, None, :] * noise[:, i, None, None] ** 2
    return mean, P


def filtered_directly(
    setting: Setting, numbers: Mapping[str, Any], logs: Mapping[str, Any], intensity: Any
) -> tuple[Array, ...] | None:
    """`force_filter.filtered`, or None where the robot's step takes XLA or the number of logs is no multiple of the lanes. Call
    under float64."""
    robot, integrator, names = setting.robot, setting.integrator, tuple(sorted(numbers))
    model = machine_model(robot, names, integrator.friction)
    if model is None or len(logs["dt"]) % lanes():
        return None
    n, values = len(robot.states), np.array([float(numbers[name]) for name in names])
    shares = np.full((integrator.substeps, lanes()), 1.0 / integrator.substeps)
    own = {name: np.asarray(x) for name, x in logs.items()}
    dt, y, there, noise, jitter = (own[name] for name in ("dt", "outputs", "there", "noise", "jitter"))
    (E, T), ny = dt.shape, y.shape[2]
    u = commanded(model.records, values, own["inputs"], dt, integrator.substeps, in_motion(robot, own["start"]))
    p = np.broadcast_to(values[list(model.places)], (E, len(model.places)))
    system = model.system
    shown = shown_states(system.step, system.output, system.sizes, system.fixed, system.identity)
    steps = _Steps(_showing_states(system, n), shown, shares, *map(grouped, (p, u, dt)))
    walks, intensity = [robot.states.index(PREFIX + name) for name in setting.velocities], np.asarray(intensity)
    diagonal, spread = np.arange(n), np.array(own["spread"])
    spread[:, walks] = own["begun"][:, None] * intensity
    mean, P = np.array(own["start"]), spread[:, :, None] ** 2 * np.eye(n)
    shapes = (n,), (n, n), (n,), (n, n), (n, n), (ny,), (ny, n), (n,)
    found = tuple(np.empty((E, T, *shape)) for shape in shapes)
    with _QUIETLY():
        for k in range(T):
            before = mean
            expected, slope = (x[:, :ny] for x in steps.seen(mean, k))
            after, after_P = _corrected(mean, P, expected, slope, y[:, k], there[:, k], noise)
            wider = after_P.copy()
            wider[:, diagonal, diagonal] += jitter
            off = np.sqrt(n) * np.swapaxes(_root(wider, LEAST * jitter), 1, 2)
            off = np.concatenate([off, -off], axis=1)
            cloud = steps.onward(after[:, None] + off, k)
            mean = cloud.mean(axis=1)
            away = cloud - mean[:, None]
            P, cross = np.swapaxes(away, 1, 2) @ away / (2 * n), np.swapaxes(off, 1, 2) @ away / (2 * n)
            added = jitter.copy()
            added[:, walks] = intensity**2 * dt[:, k, None]
            P[:, diagonal, diagonal] += added
            for place, value in zip(found, (after, after_P, mean, P, cross, expected, slope, before), strict=True):
                place[:, k] = value
    return found


def smoothed(kept: tuple[Any, ...]) -> tuple[Array, Array]:
    """Smoothed mean and standard deviation [E, T, n states] from a filter's moments."""
    mean, covariance, ahead, ahead_covariance, cross = (np.asarray(x) for x in kept[:5])
    with _QUIETLY():
        gain = np.swapaxes(solved(ahead_covariance, np.swapaxes(cross, -1, -2)), -1, -2)
        means, errors = np.empty_like(mean), np.empty_like(mean)
        # The last sample has no later one: start from its own prediction, which says nothing new.
        later, later_P = ahead[:, -1], ahead_covariance[:, -1]
        for k in reversed(range(mean.shape[1])):
            G = gain[:, k]
            later = mean[:, k] + (G @ (later - ahead[:, k])[:, :, None])[..., 0]
            later_P = covariance[:, k] + G @ (later_P - ahead_covariance[:, k]) @ np.swapaxes(G, 1, 2)
            later_P = 0.5 * (later_P + np.swapaxes(later_P, 1, 2))
            means[:, k], errors[:, k] = (
                later,
                np.sqrt(np.maximum(later_P[:, range(mean.shape[2]), range(mean.shape[2])], 0.0)),
            )
    return means, errors
