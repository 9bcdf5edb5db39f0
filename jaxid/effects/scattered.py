"""Delays that scatter: what chance makes once of a signal of which a law is the mean over all delays.

Draws are NumPy, since nothing is fitted to one. All take the edges of the steps or the stamps in seconds, and delays even
`between` the shortest and the longest.
"""

from collections.abc import Mapping, Sequence

import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from ..parameters import Parameter
from ..robots.effect import Effect, Numbers
from ..robots.probe import Probe, Seen
from ..robots.robot import Robot
from .effect_parameters import positive

Array = NDArray[np.float64]
Between = tuple[float, float]


def within(delay, scatter):
    """The shortest and the longest delay of those within the `scatter` of one; nothing is early."""
    most = jnp.minimum(scatter, delay)
    return delay - most, delay + most


class WithinScatter(Effect):
    """What laws of delays within the `scatter` of a mean `delay` share, whatever is late; put before the law of that."""

    def parameters(self, robot: Robot) -> dict[str, Parameter]:
        typical = 0.1 * robot.scales.time
        return positive(self, "delay", "s", typical) | positive(self, "scatter", "s", typical)

    def probes(self, robot: Robot, seen: Seen) -> tuple[Probe, ...]:
        """Delays to try, each with half as much scatter."""
        delay, scatter = self.key("delay"), self.key("scatter")
        return tuple(Probe({delay: time, scatter: 0.5 * time}) for time in robot.scales.times_to_try)

    def delays(self, p: Numbers):
        """The shortest delay and the longest one."""
        return within(p[self.key("delay")], p[self.key("scatter")])

    def told_by_size(self, p: Numbers, robot: Robot) -> Mapping[str, Sequence[float]]:
        """From a little to all of the delay."""
        return {self.key("scatter"): tuple(np.linspace(0.1, 1.0, 7) * float(p[self.key("delay")]))}


def _means(values: Array, begins: Array, edges: Array) -> Array:
    """Means over the steps between `edges` [T + 1] of a signal that is `values` [n, m] from `begins` [n], increasing, on."""
    ends = np.append(begins[1:], max(edges[-1], begins[-1]) + 1.0)
    whole = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values * (ends - begins)[:, None], axis=0)])
    at = np.append(begins, ends[-1])
    integrals = np.stack([np.interp(edges, at, column) for column in whole.T], axis=1)
    return np.diff(integrals, axis=0) / np.diff(edges)[:, None]


def changes_late(inputs: Array, edges: Array, between: Between, random: np.random.Generator) -> Array:
    """Held `inputs` [T, m] of which every change comes late by a time of its own, none before the one before it."""
    first = np.flatnonzero(np.any(np.diff(inputs, axis=0) != 0, axis=1)) + 1
    come = np.maximum.accumulate(edges[first] + random.uniform(*between, len(first)))
    rows = np.append(0, first)
    return _means(inputs[rows], np.append(edges[0], come), edges)


def rows_late(inputs: Array, edges: Array, between: Between, random: np.random.Generator) -> Array:
    """Held `inputs` [T, m], every row of which shows them as they were a time of its own ago."""
    delays = random.uniform(*between, len(inputs))
    steps = np.diff(edges)
    # Before the start there is what was commanded first.
    whole = np.concatenate(
        [-inputs[:1] * between[1], np.zeros_like(inputs[:1]), np.cumsum(inputs * steps[:, None], axis=0)]
    )
    at = np.append(edges[0] - max(between[1], np.finfo(float).tiny), edges)
    then = [np.interp(edges[1:] - delays, at, c) - np.interp(edges[:-1] - delays, at, c) for c in whole.T]
    return np.stack(then, axis=1) / steps[:, None]


def samples_late(outputs: Array, time: Array, between: Between, random: np.random.Generator) -> Array:
    """`outputs` [T, m] at stamps from which each was measured a time of its own earlier."""
    then = time - random.uniform(*between, len(time))
    return np.stack([np.interp(then, time, column) for column in outputs.T], axis=1)
