"""Small simulated robots for the tests of the logs package: first order, dry friction, noise; formulas of their own."""

import numpy as np
import pytest

from jaxid.logs import OMNI, PIONEER, Log

MIXING = np.array([[0, -1, 0, 1], [1, 0, -1, 0], [1, 1, 1, 1.0]])


def _held(random, samples, inputs, hold, levels):
    """Random levels, each held for `hold` samples, `[samples, inputs]`."""
    return np.repeat(random.choice(levels, size=(-(-samples // hold), inputs)), hold, axis=0)[:samples]


def _pioneer(inputs, seed, noise=1.0, dt=0.02, name="pioneer.csv"):
    """Forward speed and yaw rate with time constants 0.227 and 0.198 s; noise 1 is 0.005 m/s and 0.01 rad/s."""
    v = w = 0.0
    outputs = []
    for right, left in inputs:
        outputs.append((v, w))
        for _ in range(10):
            v += dt / 10 * (-v / 0.227 + 0.33 * (right + left) - 0.56 * np.tanh(v / 0.005))
            w += dt / 10 * (-w / 0.198 + 1.2 * (right - left) - 1.5 * np.tanh(w / 0.02))
    outputs = np.array(outputs)
    outputs += noise * np.random.default_rng(seed).normal(size=outputs.shape) * [0.005, 0.01]
    return Log.from_arrays(name, dt * np.arange(len(inputs)), inputs, outputs, PIONEER)


def _omni(inputs, seed, noise=1.0, dt=0.02, frame=1.0, name="omni.csv"):
    """V, Vn and W with the turning frame's terms times `frame` (1 is physics)."""
    state = np.zeros(3)
    outputs = []
    for row in inputs:
        outputs.append(state.copy())
        for _ in range(5):
            rate = np.array([0.15, 0.15, 0.4]) * (MIXING @ row) - np.array([1.2, 1.2, 3.0]) * state
            rate -= np.array([0.85, 0.85, 3.7]) * np.tanh(state / np.array([0.01, 0.01, 0.03]))
            rate += frame * state[2] * np.array([state[1], -state[0], 0.0])
            state = state + dt / 5 * rate
    outputs = np.array(outputs)
    outputs += noise * np.random.default_rng(seed).normal(size=outputs.shape) * [0.005, 0.005, 0.01]
    return Log.from_arrays(name, dt * np.arange(len(inputs)), inputs, outputs, OMNI)


@pytest.fixture(scope="session")
def held():
    return _held


@pytest.fixture(scope="session")
def pioneer_log():
    return _pioneer


@pytest.fixture(scope="session")
def omni_log():
    return _omni
