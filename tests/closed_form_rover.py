"""A rover in closed form: a mass driven forwards and an inertia turned, each against viscous friction, with two sensors."""

import numpy as np

from jaxid import Channels, Custom, Log, LogSet, Parameter

TRUE = {"m": 2.0, "d": 3.0, "J": 0.5, "c": 0.4}
NOISE = 0.01
CHANNELS = Channels(("F", "T"), ("V", "W"), units={"F": "N", "T": "N m", "V": "m/s", "W": "rad/s"})


def rover():
    """The model: `m dV/dt = F - d V`, `J dW/dt = T - c W`."""

    def dynamics(state, u, p):
        return {"V": (u["F"] - p["d"] * state["V"]) / p["m"], "W": (u["T"] - p["c"] * state["W"]) / p["J"]}

    table = {
        name: Parameter(1.0, unit, free=True, lower=0.0)
        for name, unit in zip(TRUE, ("kg", "N s/m", "kg m^2", "N m s"), strict=True)
    }
    return Custom(
        dynamics=dynamics, state_names=("V", "W"), own_channels=CHANNELS, table=table, turning="W", title="rover"
    )


def driven(seed, count=4, change=lambda number, y: y):
    """Logs to fit and two held-out ones under held inputs, exact but for white noise, `change(number, outputs [T, 2])` of each
    of them."""
    logs, dt = [], 0.02
    for k in range(count + 2):
        rng = np.random.default_rng([seed, k])
        u = np.repeat(rng.uniform(-4.0, 4.0, (30, 2)), 10, axis=0) * (1.0, 0.3)
        y = np.zeros((300, 2))
        for i, (inertia, friction) in enumerate(((TRUE["m"], TRUE["d"]), (TRUE["J"], TRUE["c"]))):
            decay = np.exp(-dt * friction / inertia)
            for t in range(299):
                y[t + 1, i] = u[t, i] / friction + (y[t, i] - u[t, i] / friction) * decay
        y = change(k, y + NOISE * rng.normal(size=y.shape))
        logs.append(Log.from_arrays(f"run {k}", dt * np.arange(300), u, y, CHANNELS))
    return LogSet(logs[:count]), LogSet(logs[count:])


def dead(*numbers):
    """A change by which the gyro shows nothing in the logs of these numbers."""
    return lambda k, y: np.stack([y[:, 0], np.zeros(len(y)) if k in numbers else y[:, 1]], axis=1)


def clipped(limit):
    """A change by which the gyro's range ends at `limit`."""
    return lambda k, y: np.stack([y[:, 0], np.clip(y[:, 1], -limit, limit)], axis=1)
