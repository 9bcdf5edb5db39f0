"""Periods at which a missing force repeats: any number along the way, in anybody's units, and none in noise."""

import numpy as np
import pytest
from scipy import signal
from scipy.integrate import solve_ivp

from jaxid import Axis, Log, LogSet
from jaxid.effects import effect_by_id
from jaxid.explanation.screening.ripple_periods import Grid, Periodogram, Smoothed, _peaks, ripple_periods
from jaxid.logs import AXIS, noise_scale

M, FV, N, DT, NOISE = 1.3, 1.6, 500, 0.02, 0.004
UNITS = [(1.0, 1.0, 1.0), (1e-3, 1e3, 1.0), (1e3, 1e-3, 1e-3), (1.0, 1e3, 1e3)]
"""How many times as large the units of time, length and force are."""


def driven(seed, amplitude, period, share=0.0):
    """Inputs and speeds of an axis with a ripple of `period` [m] and another that is a `share` of the force, from SciPy;
    reversing, with noise."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-4, 4, N // 50), 50)
    state, states = np.zeros(2), []
    for volts in u:
        states.append(state)
        state = solve_ivp(
            lambda t, x, volts=volts: [
                x[1],
                (volts - FV * x[1] + (amplitude + share * volts) * np.sin(2 * np.pi * x[0] / period)) / M,
            ],
            (0, DT), state, rtol=1e-8, atol=1e-10,
        ).y[:, -1]  # fmt: skip
    return u, np.array(states)[:, 1] + NOISE * rng.normal(size=N)


def found(runs, time=1.0, length=1.0, force=1.0):
    logs = LogSet(
        [
            Log.from_arrays(f"run {k}", DT * np.arange(N) / time, u[:, None] / force, v[:, None] * time / length, AXIS)
            for k, (u, v) in enumerate(runs)
        ]
    )
    robot = Axis().with_values(M=M * length / force / time**2, Fv=FV * length / force / time, Fc=0.0, offset=0.0)
    return ripple_periods(robot + effect_by_id(robot, "cogging_torque"), logs, noise_scale(logs), {})


@pytest.mark.parametrize("period", [1.3, 0.11, 0.031])
def test_a_ripple_is_found_whatever_its_period_and_the_units(period):
    runs = [driven(seed, 0.4, period) for seed in range(2)]
    for units in UNITS if period == 0.11 else UNITS[:1]:
        periods = found(runs, *units).steady
        # The way tells a period to a fraction of one cycle more or less along it (here some 5 m).
        assert 2 * np.pi / periods.values[0] * units[1] == pytest.approx(period, rel=0.2 * period / 5 + 1e-3), units
        assert len(periods.values) <= 8 < periods.looked_at


def test_a_ripple_in_proportion_to_the_torque_is_found_by_it():
    period = 0.31
    steady, by_torque = found([driven(seed, 0.0, period, 0.15) for seed in range(2)])
    assert by_torque.values[0] == pytest.approx(2 * np.pi / period, rel=0.02)
    assert all(abs(value * period / (2 * np.pi) - 1) > 0.02 for value in steady.values)  # it alternates with the torque


@pytest.mark.slow
def test_noise_repeats_with_nothing():
    """Hundreds of periods are looked at each time; 5 % of complete models may show one. (P(4 or more of 20) = 1.6 %.)"""
    ripples = [found([driven(seed, 0.0, 1.0)]) for seed in range(20)]
    assert sum(bool(ripple.steady.values) for ripple in ripples) <= 3
    assert sum(bool(ripple.by_torque.values) for ripple in ripples) <= 3


def test_the_periodogram_is_that_of_scipy():
    rng = np.random.default_rng(0)
    way = np.sort(rng.uniform(3.0, 9.0, 400))
    force = 0.3 * np.cos(21.0 * way + 1.0) + rng.normal(size=way.size)
    grid = Grid(way, 40.0)
    other = signal.lombscargle(way, force - force.mean(), grid.periods)  # half of the squares that a period reproduces
    assert grid.periods[-1] == pytest.approx(40.0, rel=0.02)
    power = Periodogram(grid, np.ones(way.size))(force - force.mean())
    np.testing.assert_allclose(power, 2 * other, atol=0.05 * np.max(2 * other))


def test_forces_too_large_to_be_squared_are_looked_at_without_a_warning():
    """Of a fit that ran away; every warning is an error here."""
    time = DT * np.arange(N)
    way, force = [0.5 * time], np.sin(2 * np.pi * 0.5 * time / 0.5)
    usual = _peaks(way, [Smoothed(force, np.full(N, 0.1))], 0.05)
    large = _peaks(way, [Smoothed(1e250 * force, np.full(N, 1e249))], 0.05)
    assert usual[1] == large[1] > 0
    np.testing.assert_allclose(large[0], usual[0], rtol=1e-6)
