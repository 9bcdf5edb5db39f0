"""A plant in its closed loop against SciPy's, and its parameters from there."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import (
    Channels,
    Controller,
    Custom,
    Integrator,
    Log,
    LogError,
    LogSet,
    Parameter,
    ParameterError,
    closed_loop,
    output_error,
    simulate,
)

CHANNELS = Channels(("u",), ("q",), units={"u": "N m", "q": "rad"})
TRUTH = {"g": 9.0, "d": 0.3, "b": 2.0}
INTERVAL, SAMPLES, NOISE = 0.02, 300, 0.003
GAINS = (12.0, 3.0, 6.0)  # proportional, derivative, integral


def dynamics(state, inputs, p):
    return {"q": state["w"], "w": p["g"] * jnp.sin(state["q"]) - p["d"] * state["w"] + p["b"] * inputs["u"]}


def plant(**values: float) -> Custom:
    """An inverted pendulum, the angle from upright measured."""
    table = {name: Parameter(value, free=True, lower=0.0) for name, value in TRUTH.items()}
    robot = Custom(dynamics=dynamics, state_names=("q", "w"), own_channels=CHANNELS, table=table)
    return robot.with_values(**values)


def law(reference, measured, state, p):
    """PID with the derivative of the measured angle, and a limit."""
    error = reference["goal"] - measured["q"]
    rate = (measured["q"] - state["before"]) / INTERVAL
    u = jnp.clip(GAINS[0] * error - GAINS[1] * rate + GAINS[2] * state["sum"], -8.0, 8.0)
    return {"u": u}, {"before": measured["q"], "sum": state["sum"] + INTERVAL * error}


CONTROLLER = Controller(law, ("goal",), states=("before", "sum"))


def _recorded(name: str, seed: int, noise: float) -> tuple[Log, np.ndarray]:
    """A log, and the motion without noise; the controller sees the measured angle, noise and all."""
    rng, x, before, total = np.random.default_rng(seed), np.zeros(2), 0.0, 0.0
    goal = np.repeat(rng.uniform(-0.4, 0.4, SAMPLES // 30), 30)
    q, u, clean = np.zeros(SAMPLES), np.zeros(SAMPLES), np.zeros(SAMPLES)
    for k in range(SAMPLES):
        clean[k], q[k] = x[0], x[0] + noise * rng.normal()
        error = goal[k] - q[k]
        u[k] = np.clip(GAINS[0] * error - GAINS[1] * (q[k] - before) / INTERVAL + GAINS[2] * total, -8.0, 8.0)
        before, total = q[k], total + INTERVAL * error

        def motion(t, s, held=u[k]):
            return [s[1], TRUTH["g"] * np.sin(s[0]) - TRUTH["d"] * s[1] + TRUTH["b"] * held]

        x = solve_ivp(motion, (0, INTERVAL), x, rtol=1e-9, atol=1e-10).y[:, -1]
    time = INTERVAL * np.arange(SAMPLES)
    return Log.from_arrays(name, time, u[:, None], q[:, None], CHANNELS, extra={"goal": goal}), clean


@pytest.fixture(scope="module")
def logs() -> LogSet:
    return LogSet([_recorded(str(seed), seed, NOISE)[0] for seed in range(2)])


def test_the_loop_is_simulated_as_scipy_does():
    log, clean = _recorded("clean", 5, 0.0)
    loop, looped = closed_loop(plant(), LogSet([log]), CONTROLLER)
    (seen,) = simulate(loop, looped, integrator=Integrator(2))
    np.testing.assert_allclose(seen[:, 0], clean, atol=2e-6)
    np.testing.assert_allclose(seen[:, 1], log.input("u"), atol=2e-3)


def test_the_controller_runs_once_a_sample_whatever_the_steps():
    log, clean = _recorded("clean", 6, 0.0)
    loop, looped = closed_loop(plant(), LogSet([log]), CONTROLLER)
    few, many = (simulate(loop, looped, integrator=Integrator(n))[0] for n in (2, 5))
    np.testing.assert_allclose(few, many, atol=2e-3)


def test_an_unstable_plant_is_identified_from_whole_logs(logs):
    fit = output_error(plant(), logs, controller=CONTROLLER, start=dict(g=7.0, d=0.5, b=1.5))
    assert fit.converged and fit.window is None
    for name, truth in TRUTH.items():
        assert abs(fit[name].value - truth) < 4.0 * fit[name].std_error, (name, fit[name])
        assert fit[name].std_error < 0.1 * max(truth, 1.0)
    assert fit.robot.alone.name == plant().name  # type: ignore[attr-defined]


def test_what_does_not_fit_is_said(logs):
    with pytest.raises(ParameterError, match="asks for 'target'"):
        closed_loop(plant(), logs, Controller(lambda r, y, s, p: {"u": r["target"]}, ("goal",)))
    with pytest.raises(ParameterError, match="no command 'u'"):
        closed_loop(plant(), logs, lambda r, y, s, p: {"v": 0.0})
    with pytest.raises(LogError, match="no column 'speed'"):
        closed_loop(plant(), logs, Controller(lambda r, y, s, p: {"u": 0.0}, ("speed",)))
    with pytest.raises(ParameterError, match="the robot's name, too"):
        closed_loop(plant(), logs, Controller(lambda r, y, s, p: ({"u": 0.0}, {"w": 0.0}), ("goal",), states=("w",)))
