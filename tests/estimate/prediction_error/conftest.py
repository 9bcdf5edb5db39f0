"""A drive axis and an inverted pendulum that are really disturbed: Euler-Maruyama with steps of half a millisecond,
nothing of jaxid in it."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import AXIS, Channels, Custom, Log, LogSet, Parameter

SAMPLES, DT, FINE = 256, 0.02, 40


def multilevel(seed, samples=SAMPLES, hold=16, largest=4.0):
    levels = np.random.default_rng(seed).uniform(-largest, largest, -(-samples // hold))
    return np.repeat(levels, hold)[:samples]


@pytest.fixture(scope="session")
def disturbed_axis():
    """`disturbed_axis(seed, q, r)`: M = 1 kg, Fv = 2 N s/m, Fc = 0.5 N, offset 0.05 N; process noise q, sensor noise r;
    a sensor that lags by a time constant `lag`, or whose samples are `late` by so many steps of half a millisecond."""

    def log(seed, q=0.05, r=0.01, M=1.0, Fv=2.0, Fc=0.5, offset=0.05, drag=0.0, lag=0.0, late=0):
        random, h, v, lagged, speeds = np.random.default_rng(seed), DT / FINE, 0.0, 0.0, []
        u, earlier = multilevel(seed), [0.0] * (late + 1)
        for force in u:
            speeds.append(lagged if lag else earlier[-1 - late])
            for _ in range(FINE):
                lagged += h * (v - lagged) / lag if lag else 0.0
                v += h * (force - offset - Fv * v - drag * v * abs(v)) / M + q * np.sqrt(h) * random.normal()
                v = np.sign(v) * max(abs(v) - h * Fc / M, 0.0)
                earlier.append(v)
        measured = np.array(speeds) + r * random.normal(size=SAMPLES)
        return Log.from_arrays(f"axis {seed}", DT * np.arange(SAMPLES), u[:, None], {"v": measured}, AXIS)

    return log


def dynamics(s, u, p):
    return {"angle": s["speed"], "speed": p["k"] * jnp.sin(s["angle"]) - p["c"] * s["speed"] + p["b"] * u["u"]}


def pendulum_robot(k=5.0, c=0.3, b=1.0):
    """An inverted pendulum of which only the angle is measured; the start values are far off."""
    return Custom(
        dynamics=dynamics,
        state_names=("angle", "speed"),
        own_channels=Channels(inputs=("u",), outputs=("angle",), units={"u": "V", "angle": "rad"}),
        table={
            "k": Parameter(k, "1/s^2", free=True, lower=0.0),
            "c": Parameter(c, "1/s", free=True, lower=0.0),
            "b": Parameter(b, "1/(V s^2)", free=True, lower=0.0),
        },
        title="pendulum",
    )


@pytest.fixture(scope="session")
def balanced():
    """Logs of the pendulum (k = 9, c = 0.5, b = 3) held upright by a controller that feeds the noisy angle back."""

    def log(seed, q=0.1, r=0.002, k=9.0, c=0.5, b=3.0):
        random, h = np.random.default_rng(seed), DT / FINE
        angle, speed, last, angles, inputs = 0.0, 0.0, 0.0, [], []
        for wanted in multilevel(seed, largest=2.0):
            y = angle + r * random.normal()
            u = wanted - 8.0 * y - 1.5 * (y - last) / DT
            last = y
            angles.append(y)
            inputs.append(u)
            for _ in range(FINE):
                rate = k * np.sin(angle) - c * speed + b * u
                angle, speed = angle + h * speed, speed + h * rate + q * np.sqrt(h) * random.normal()
        robot = pendulum_robot()
        return Log.from_arrays(
            f"pendulum {seed}", DT * np.arange(SAMPLES), np.array(inputs)[:, None], {"angle": np.array(angles)}, robot
        )

    return pendulum_robot(), LogSet([log(1), log(2)])
