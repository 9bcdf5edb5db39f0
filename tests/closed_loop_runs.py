"""Logs of an axis under a controller that sees its sensor's coloured noise: dry friction that sticks, by implicit steps."""

import numpy as np

from jaxid import AXIS, Log, LogSet

DT, FINE = 0.02, 20
MASS, VISCOUS, DRY = 1.3, 2.1, 0.8


def driven(seed, logs=4, samples=600, size=0.08, memory=0.6, sees_noise=True, drag=0.0):
    """Logs under a PI controller of a speed that jumps. The noise, of standard deviation `size`, is an AR(1) of `memory`."""
    found = []
    for k in range(logs):
        rng = np.random.default_rng([seed, k])
        wanted = np.repeat(rng.uniform(-1.5, 1.5, samples // 50), 50)
        v, total, noise, h = 0.0, 0.0, size * rng.normal(), DT / FINE
        u, y = np.zeros(samples), np.zeros(samples)
        for i in range(samples):
            y[i] = v + noise
            error = wanted[i] - (y[i] if sees_noise else v)
            total += 60.0 * error * DT
            u[i] = 40.0 * error + total
            for _ in range(FINE):
                free = MASS * v + h * (u[i] - drag * v * abs(v))
                v = np.sign(free) * max(abs(free) - h * DRY, 0.0) / (MASS + h * VISCOUS)
            noise = memory * noise + size * np.sqrt(1.0 - memory**2) * rng.normal()
        found.append(Log.from_arrays(f"run {seed}.{k}", DT * np.arange(samples), u[:, None], {"v": y}, AXIS))
    return LogSet(found)
