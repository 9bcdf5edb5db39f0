"""A plant in its closed loop against SciPy's, and its parameters from there."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxid import (
    Axis,
    Channels,
    Controller,
    Custom,
    DifferentialDrive,
    Integrator,
    Log,
    LogError,
    LogSet,
    Omni,
    Parameter,
    ParameterError,
    Pioneer,
    catalogue,
    closed_loop,
    output_error,
    simulate,
)
from jaxid.effects import effect_by_id, laws_of
from jaxid.explanation.search.denser import bare_of
from jaxid.robots.probe import Seen
from jaxid.robots.traits import refusal

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


def _loop(robot):
    """The robot under a proportional controller of its first output."""
    channels, time = robot.channels, INTERVAL * np.arange(20)
    outputs = {name: np.sin(time) for name in channels.outputs}
    zeros = np.zeros((20, len(channels.inputs)))
    log = Log.from_arrays("run", time, zeros, outputs, channels, extra={"goal": np.ones(20)})
    first, names = channels.outputs[0], channels.inputs
    controller = Controller(lambda r, y, s, p: dict.fromkeys(names, 2.0 * (r["goal"] - y[first])), ("goal",))
    return closed_loop(robot, LogSet([log]), controller)[0]


@pytest.mark.parametrize("robot", [Axis(), DifferentialDrive(), Pioneer(), Omni()], ids=lambda robot: robot.name)
def test_a_loop_takes_the_effects_of_its_plant_and_says_the_same_of_them(robot):
    """A search that asks the loop what may be missing adds that to the plant, and simulates it there."""
    loop, seen = _loop(robot), Seen(5.0, 10.0, lambda: None, lambda by_torque: ((), 0))
    there = [law for effect in catalogue(loop) for law in laws_of(loop, effect.id)]
    assert {"stribeck_friction", "quadratic_drag"} <= {effect.id for effect in there}
    assert not {"input_delay", "sensor_lag"} & {effect.id for effect in there}
    state = {**loop.initial_state(), **dict.fromkeys(robot.velocities, 0.3)}
    for effect in there:
        assert refusal(effect, robot) is None
        full, alone = loop + effect, robot + effect
        assert full.plant.effects == full.effects == alone.effects
        assert set(alone.parameters) <= set(full.parameters)
        for probe in effect.probes(full.alone, seen):
            assert set(probe.strengths) <= set(alone.parameters)
        if effect.states_on(robot) or "pose" in effect.needs or "wheel_angles" in effect.needs:
            continue
        numbers = full.parameters.numbers
        of_plant = {name: state[name] for name in alone.states}
        assert np.allclose(full.compliance(state, numbers), alone.compliance(of_plant, numbers))


@pytest.mark.parametrize("robot", [Axis(), DifferentialDrive(), Pioneer(), Omni()], ids=lambda robot: robot.name)
def test_every_robot_is_simulated_in_a_loop_as_alone_at_the_commands_that_it_made(robot):
    channels, time = robot.channels, INTERVAL * np.arange(60)
    zeros = {name: np.zeros(60) for name in channels.outputs}
    empty = np.zeros((60, len(channels.inputs)))
    log = Log.from_arrays("run", time, empty, zeros, channels, extra={"goal": np.sign(np.sin(8.0 * time))})
    gains = {name: 1.0 + 0.2 * k for k, name in enumerate(channels.inputs)}
    first = channels.outputs[0]
    controller = Controller(lambda r, y, s, p: {n: g * (r["goal"] - y[first]) for n, g in gains.items()}, ("goal",))
    loop, logs = closed_loop(robot, LogSet([log]), controller)
    made = simulate(loop, logs)[0]
    n, m = len(channels.outputs), len(channels.inputs)
    outputs, commands = made[:, :n], made[:, n : n + m]
    assert np.ptp(outputs[:, 0]) > 0.0
    again = simulate(robot, LogSet([Log.from_arrays("run", time, commands, zeros, channels)]))[0]
    np.testing.assert_allclose(again[:, :n], outputs, atol=1e-6 * np.ptp(outputs))


def test_a_loop_that_is_copied_without_an_effect_is_simulated_without_it():
    loop = _loop(Axis())
    with_it = loop + effect_by_id(loop, "quadratic_drag")
    assert with_it.plant.effects and not bare_of(with_it, with_it.effects[0]).plant.effects
    assert not replace(with_it, effects=()).plant.effects
