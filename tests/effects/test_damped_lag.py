"""Low-passes of second order on sensors, against SciPy's simulation of their state equations, for stamps that are not even."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import signal

from jaxid import Axis, Log, LogSet, float64
from jaxid.effects import effect_by_id
from jaxid.effects.sensor.lag import damped
from jaxid.explanation.search.denser import with_further_terms
from jaxid.robots import Pioneer
from jaxid.simulation.simulate import simulate

TIME = np.concatenate([[0.0], np.cumsum(np.random.default_rng(5).uniform(0.015, 0.025, 400))])


def speed(t):
    return np.sin(1.3 * t) + 0.5 * np.sin(4 * t + 1) - 0.5 * np.sin(1)


def filtered(mean, damping):
    """By SciPy, at TIME."""
    fine, w = np.linspace(0, TIME[-1], 200_001), 2 * damping / mean
    system = signal.StateSpace([[0, 1], [-w * w, -2 * w * damping]], [[0], [w * w]], [[1, 0]], [[0]])
    return np.interp(TIME, fine, signal.lsim(system, speed(fine), fine)[1])


@pytest.mark.slow
@pytest.mark.parametrize(("mean", "damping"), [(0.075, 0.5**0.5), (0.3, 0.4), (0.02, 0.9), (0.1, 0.99)])
def test_a_low_pass_of_second_order(mean, damping):
    with float64():
        found = np.asarray(damped(jnp.asarray(speed(TIME))[:, None], jnp.asarray(TIME), mean, damping))[:, 0]
    truth = filtered(mean, damping)
    assert np.abs(found - truth).max() < 5e-3 * np.abs(truth - speed(TIME)).max()


@pytest.mark.slow
def test_none_of_it_is_none_and_may_grow():
    with float64():
        y, t = jnp.asarray(speed(TIME))[:, None], jnp.asarray(TIME)
        assert np.array_equal(damped(y, t, 0.0, 0.7), y)
        slope = np.asarray(jax.jacfwd(lambda T: damped(y, t, T, 0.7))(0.0))
        small = np.asarray(damped(y, t, 1e-4, 0.7) - y)
    assert np.allclose(1e-4 * slope, small) and np.abs(small).max() > 1e-5


def test_a_gyros_own_filter_leaves_the_wheels_speed_as_it_is():
    """And of any damping is at first what it was."""
    robot = Pioneer()
    robot = robot + effect_by_id(robot, "sensor_lag", "butterworth_per_channel")
    robot = robot.with_values(**{"sensor_lag.time_constant_eta2": 0.075})
    volts = np.repeat(np.random.default_rng(2).uniform(-8, 8, (6, 2)), 50, axis=0)
    logs = LogSet([Log.from_arrays("one", 0.02 * np.arange(300), volts, np.zeros((300, 2)), robot)])
    (plain,), (late,) = (simulate(each, logs) for each in (Pioneer(), robot))
    assert np.allclose(plain[:, 0], late[:, 0]) and np.abs(plain[:, 1] - late[:, 1]).max() > 0.05
    (free,) = simulate(with_further_terms(robot, "sensor_lag"), logs)
    assert np.allclose(late, free, atol=1e-12)


def test_a_robot_of_one_sensor_has_the_law_of_all():
    assert effect_by_id(Axis(), "sensor_lag", "butterworth").parameters(Axis())
    with pytest.raises(KeyError, match="measures one output"):
        effect_by_id(Axis(), "sensor_lag", "butterworth_per_channel")
