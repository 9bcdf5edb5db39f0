"""Growth of errors along a log against eigenvalues known on paper, in any units, and feedback in a record."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import AXIS, Axis, Channels, Custom, Integrator, Log, LogSet, Parameter
from jaxid.estimate.output_error.feedback import feedback
from jaxid.estimate.output_error.predictability import predictability
from jaxid.simulation.start import states_at
from jaxid.simulation.states_at_samples import local_parabola

SAMPLES = 300


@pytest.fixture(scope="module")
def inverted(pendulum) -> Log:
    return pendulum.recorded(
        "inverted", pendulum.held(1.0, SAMPLES, 25), (np.pi, 0.0), controller=pendulum.upright, noise=0.002
    )


def test_around_the_bottom_errors_die_away_with_half_the_damping(pendulum):
    log = pendulum.recorded("hanging", pendulum.held(1.0, SAMPLES, 25), d=2.0)
    found = predictability(pendulum.robot(d=2.0), LogSet([log]))
    assert found.kind == "stable"
    assert found.growth_rate == pytest.approx(-1.0, rel=0.15)
    assert found.horizon == np.inf and "forget" in found.sentence


def test_upright_errors_grow_with_the_unstable_eigenvalue(inverted, pendulum):
    found = predictability(pendulum.robot(), LogSet([inverted]))
    unstable = -0.05 + np.sqrt(0.05**2 + 9.0)  # s² + d s - g = 0
    assert found.kind == "unstable"
    assert found.growth_rate == pytest.approx(unstable, rel=0.05)
    assert found.doubling_time == pytest.approx(np.log(2) / unstable, rel=0.05)
    assert 0.0 < found.horizon < 2.0 and "doubl" in found.sentence


@pytest.mark.parametrize("time, angle, torque", [(1e-3, 1.0, 1.0), (1e3, 1e-3, 1e3)])
def test_the_answer_does_not_hang_on_units(inverted, time, angle, torque, pendulum):
    """The same record with seconds, radians and newton metres in other units."""

    def dynamics(state, inputs, p):
        force = -p["g"] * jnp.sin(state["q"] / angle) + p["b"] * inputs["u"] / torque
        return {"q": state["w"], "w": (force * angle - p["d"] * state["w"] * time) / time**2}

    table = {"g": Parameter(9.0), "d": Parameter(0.1), "b": Parameter(1.0, free=True)}
    channels = Channels(("u",), ("q",))
    other = Custom(dynamics=dynamics, state_names=("q", "w"), own_channels=channels, table=table)
    log = Log.from_arrays(
        "inverted", inverted.time * time, inverted.inputs * torque, inverted.outputs * angle, channels
    )
    plain = predictability(pendulum.robot(), LogSet([inverted]), integrator=Integrator(2))
    found = predictability(other, LogSet([log]), integrator=Integrator(2))
    assert found.kind == plain.kind
    assert found.growth_rate * time == pytest.approx(plain.growth_rate, rel=1e-6)
    assert found.horizon == pytest.approx(plain.horizon * time, rel=1e-6)


def test_a_position_integrates_and_its_speed_is_stable(pendulum):
    time, u = 0.02 * np.arange(SAMPLES), pendulum.held(2.0, SAMPLES, 20)
    v = np.zeros(SAMPLES)
    for k in range(SAMPLES - 1):
        v[k + 1] = u[k] / 2.0 + (v[k] - u[k] / 2.0) * np.exp(-2.0 * 0.02)
    q = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * 0.02)])
    axis = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0)
    position = predictability(axis, LogSet([Log.from_arrays("q", time, u, {"q": q}, AXIS)]))
    speed = predictability(axis, LogSet([Log.from_arrays("v", time, u, {"v": v}, AXIS)]))
    assert position.kind == "integrating" and "disturb" in position.sentence
    assert speed.kind == "stable"
    assert speed.memory == pytest.approx(np.log(20) / 2.0, rel=0.2)


def test_states_are_read_off_the_measurement(pendulum):
    log = pendulum.recorded("hanging", pendulum.held(1.0, SAMPLES, 25), noise=0.0)
    at = np.array([0, 40, 130, 299])
    found = states_at(pendulum.robot(), log, at)
    np.testing.assert_allclose(found["q"], log.output("q")[at], atol=1e-3)
    slope = np.gradient(log.output("q"), 0.02)
    np.testing.assert_allclose(found["w"][1:3], slope[at[1:3]], atol=0.05)


def test_a_parabola_gives_value_and_slope_of_a_parabola():
    t = np.array([0.0, 0.1, 0.25, 0.3, 0.5, 0.6, 0.9, 1.0, 1.1, 1.2, 1.4])
    y = 1.0 + 2.0 * t - 3.0 * t**2
    y[4] = np.nan
    level, slope = local_parabola(t, y, np.array([0, 4, 10]))
    np.testing.assert_allclose(level, 1.0 + 2.0 * t[[0, 4, 10]] - 3.0 * t[[0, 4, 10]] ** 2)
    np.testing.assert_allclose(slope, 2.0 - 6.0 * t[[0, 4, 10]])


def test_feedback_is_seen_and_an_open_loop_is_none(inverted, pendulum):
    rng = np.random.default_rng(3)
    assert feedback([inverted.input("u")], [inverted.outputs]).closed
    shut = []
    for seed in range(20):
        u = pendulum.held(1.0, SAMPLES, 5, seed)
        shut.append(feedback([u], [rng.normal(size=(SAMPLES, 1)).cumsum(axis=0)]).closed)
    assert not any(shut)
