"""One robot driven twice by the same inputs, with an effect and without, and what the second lacks at every moment.

A free simulation adds up what it lacks. So the model without the effect is started anew at every few samples from where the
robot with it is, runs for one sample, and is compared: the difference of the speeds over the sampling interval is the
acceleration that it lacks there, which a mass or an inertia makes a force or a moment.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from jaxid import Integrator, Log, LogSet, Robot, simulate

Array = NDArray[np.float64]

INTERVAL = 0.02
"""Sampling interval [s]."""
_STEPS = Integrator(substeps=16)
_EVERY = 4
"""Samples from one moment that is looked at to the next."""


@dataclass(frozen=True)
class Run:
    """Both motions and what is missing.

    - `time` [T] s, `inputs` [T, nu], `real` and `model` [T, ny]: readings with the effect and without.
    - `moments` [n]: numbers of the samples at which something is missing, `acceleration` [n, ny].
    """

    robot: Robot
    time: Array
    inputs: Array
    real: Array
    model: Array
    moments: NDArray[np.int64]
    acceleration: Array

    def column(self, name: str) -> int:
        """The column of a channel."""
        return self.robot.channels.measured.index(name)

    def held(self, command: int = 0) -> tuple[Array, Array]:
        """At every moment: seconds since a command changed last, and by how much it did."""
        u, start, by = self.inputs[:, command], 0, 0.0
        since, change = np.zeros(len(u)), np.zeros(len(u))
        for k in range(len(u)):
            if k and u[k] != u[k - 1]:
                start, by = k, u[k] - u[k - 1]
            since[k], change[k] = self.time[k] - self.time[start], by
        return since[self.moments], change[self.moments]


def levels(robot: Robot, seconds: float, limit: float, hold: float, seed: int, together: bool = False) -> Array:
    """[T, nu] commands: random levels up to `limit`, each held for `hold` to twice as long, the same for all if `together`."""
    random, samples = np.random.default_rng(seed), round(seconds / INTERVAL)
    found = np.zeros((samples, len(robot.channels.inputs)))
    for column in range(found.shape[1]):
        k = round(0.2 / INTERVAL)
        while k < samples:
            found[k:, column] = random.uniform(-limit, limit)
            k += round(random.uniform(hold, 2 * hold) / INTERVAL)
    return np.repeat(found[:, :1], found.shape[1], axis=1) if together else found


def driven(without: Robot, having: Robot, inputs: Array) -> Run:
    """Both motions from rest under `inputs` [T, nu], and what the model without the effect lacks."""
    time, ny = INTERVAL * np.arange(len(inputs)), len(without.channels.measured)
    log = Log.from_arrays("run", time, inputs, np.zeros((len(inputs), ny)), without)
    rest = {name: np.zeros(1) for name in having.states}
    real = simulate(having, LogSet([log]), start=rest, integrator=_STEPS)[0]
    model = simulate(without, LogSet([log]), start={name: np.zeros(1) for name in without.states}, integrator=_STEPS)[0]
    moments = np.arange(0, len(inputs) - 1, _EVERY)
    pieces = [
        replace(log, name=str(k), time=time[:2], inputs=inputs[k : k + 2], outputs=real[k : k + 2]) for k in moments
    ]
    start = {name: real[moments, without.channels.measured.index(name)] for name in without.states}
    after = np.stack([piece[1] for piece in simulate(without, LogSet(pieces), start=start, integrator=_STEPS)])
    return Run(without, time, inputs, real, model, moments, (real[moments + 1] - after) / INTERVAL)
