"""An axis in closed form for tests of an explanation's parts: 1 kg with 2 N s/m behind some law of its input."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from jaxid import AXIS, Log, LogSet

NOISE = 0.003  # m/s


def driven(
    law: Callable[[NDArray[np.float64]], NDArray[np.float64]], seed: int, count: int = 3
) -> tuple[LogSet, LogSet]:
    """Logs to fit and one held-out log of speeds, exact but for white noise, under held inputs without dry friction."""
    logs = []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        u = np.repeat(rng.uniform(-4, 4, 40), 10)
        decay, v, found = np.exp(-0.04), 0.0, []
        for force in law(u):
            found.append(v)
            v = 0.5 * force + (v - 0.5 * force) * decay
        outputs = {"v": np.array(found) + NOISE * rng.normal(size=400)}
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(400), u[:, None], outputs, AXIS))
    return LogSet(logs[:-1]), LogSet(logs[-1:])
