"""Mechanisms of users' own robots against closed forms."""

import numpy as np
from scipy.signal import lsim

from reference import mechanisms as me


def simulated(mechanism: me.Mechanism, p: dict[str, float], start, time, inputs) -> np.ndarray:
    """States at uneven times under inputs without disturbances."""
    vector = np.array([p[symbol.name] for symbol in mechanism.symbols])
    u = np.hstack([inputs, np.zeros((len(time), mechanism.n_forces))])
    layout = mechanism.first, mechanism.speeds, mechanism.n_axes
    return me.states_at(mechanism.dynamics, vector, me.NOTHING, np.array(start, float), time, u, layout)


def test_a_pendulum_rests_where_friction_holds_it_and_swings_at_its_frequency() -> None:
    p = {"J": 2.0, "k": 1.0, "b": 0.0, "mgl": 18.0, "tau": 0.5}
    time = np.arange(0, 3, 0.01)
    held = simulated(me.PENDULUM, p, [0.02, 0.0], time, np.zeros((len(time), 1)))
    np.testing.assert_array_equal(held[:, 0], 0.02)  # 18 sin 0.02 = 0.36 < 0.5
    free = simulated(me.PENDULUM, p | {"tau": 0.0}, [1e-3, 0.0], time, np.zeros((len(time), 1)))
    np.testing.assert_allclose(free[:, 0], 1e-3 * np.cos(3.0 * time), atol=2e-8)


def test_two_masses_without_friction_are_a_linear_system() -> None:
    p = {"m1": 0.7, "m2": 0.4, "s": 60.0, "d": 0.5, "b": 1.2, "Fc": 0.0, "k": 1.5}
    time = np.arange(300) * 0.01
    u = np.sign(np.sin(7 * time + 0.3))[:, None]
    A = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-60, 60, -1.7, 0.5], [60, -60, 0.5, -0.5]], float)
    A[2] /= 0.7
    A[3] /= 0.4
    B = np.array([[0], [0], [1.5 / 0.7], [0]])
    _, _, expected = lsim((A, B, np.eye(4), np.zeros((4, 1))), u, time, interp=False)
    found = simulated(me.TWO_MASSES, p, np.zeros(4), time, u)
    np.testing.assert_allclose(found, expected, atol=1e-7)


def test_a_crane_without_losses_keeps_its_momentum_and_its_energy() -> None:
    p = {"M": 1.3, "m": 0.6, "l": 0.4, "g": 9.81, "b": 0.0, "Fc": 0.0, "c": 0.0}
    time = np.cumsum(np.random.default_rng(1).uniform(0.005, 0.03, 200))
    x = simulated(me.CRANE, p, [0.0, 1.2, 0.1, 0.0], time, np.zeros((200, 1)))
    _, phi, v, w = x.T
    momentum = 1.9 * v + 0.24 * w * np.cos(phi)
    energy = 0.95 * v**2 + 0.24 * v * w * np.cos(phi) + 0.5 * 0.096 * w**2 - 0.24 * 9.81 * np.cos(phi)
    np.testing.assert_allclose(momentum, momentum[0], atol=1e-7)
    np.testing.assert_allclose(energy, energy[0], atol=1e-6)


def test_a_differential_drive_spins_on_the_spot_and_reaches_its_speed() -> None:
    p = {"M": 10.0, "J": 0.3, "L": 0.2, "kf": 5.0, "ke": 3.0, "B": 4.0, "Fc": 2.0}
    time = np.arange(0, 8, 0.02)
    u = np.tile([6.0, -6.0], (len(time), 1))
    v, w = simulated(me.DIFFERENTIAL_DRIVE, p, [0.0, 0.0], time, u).T
    rim = (5.0 * 6.0 - 2.0) / (5.0 * 3.0 + 4.0)
    np.testing.assert_allclose(v, 0.0, atol=1e-9)
    np.testing.assert_allclose(w[-1], rim / 0.2, rtol=1e-6)
