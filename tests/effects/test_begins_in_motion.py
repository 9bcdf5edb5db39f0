"""A log that was cut in motion: what came before it is not in it, and lags and delays remember it.

The same run whole and from a moment on at which its command, or its acceleration, had been the same for long: from there on the
two are one.
"""

import numpy as np
import pytest

from jaxid import Axis, Integrator, Log, LogSet, output_error, simulate
from jaxid._float64 import float64
from jaxid.effects import laws_of
from jaxid.simulation.rollout import rollout, rollout_in_xla

DT, HELD, N = 0.02, 200, 400
LAGS = ("first_order", "second_order", "unequal_lags", "ramp", "unequal_ramps", "ramp_and_lag", "lag_with_limit")
COMMANDS = [("motor_lag", law) for law in LAGS]
COMMANDS += [("input_delay", "constant"), ("input_delay", "jittering"), ("backlash", "command")]
SENSORS = [("sensor_lag", law) for law in ("first_order", "second_order", "butterworth", "moving_average")]
SENSORS += [("sensor_delay", "constant"), ("sensor_delay", "jittering")]


def model(identifier, law, **numbers):
    robot = Axis().with_values(M=1.0, Fc=0.0, **numbers)
    effect = next(own for own in laws_of(robot, identifier) if own.law == law)
    names = effect.parameters(robot)
    values = {name: 0.15 if "width" not in name else 1.0 for name in names if not name.endswith("share_back")}
    return (robot + effect).with_values(**values)


def log_of(inputs, robot):
    time = DT * np.arange(len(inputs))
    return Log.from_arrays("run", time, inputs[:, None], np.zeros((len(inputs), 1)), robot)


def whole_and_cut(robot, inputs):
    """What sensors show of the whole run, and of its part from HELD on, from the state in which the robot then is."""
    bare = Axis().with_values(**{name: robot.parameters[name].value for name in Axis().parameters})
    settings = {"integrator": Integrator(4)}
    (whole,) = simulate(robot, LogSet([log_of(inputs, robot)]), **settings)
    if robot.effects[0].where == "sensor":
        (true,) = simulate(bare, LogSet([log_of(inputs, robot)]), **settings)
    else:
        true = whole
    start = {"v": np.array([true[HELD, 0]]), "q": np.zeros(1)}
    start = {name: start[name] for name in robot.states}
    (cut,) = simulate(robot, LogSet([log_of(inputs[HELD:], robot)]), start=start, **settings)
    (once,) = simulate(bare, LogSet([log_of(inputs[HELD:], robot)]), start=start, **settings)
    return whole[HELD:, 0], cut[:, 0], once[:, 0]


@pytest.mark.parametrize(("identifier", "law"), COMMANDS)
def test_a_command_that_was_held_before_is_remembered(identifier, law):
    robot = model(identifier, law, Fv=2.0)
    inputs = np.repeat([4.0, -3.0, 5.0, 1.0], [HELD + 50, 50, 50, 50])
    whole, cut, once = whole_and_cut(robot, inputs)
    np.testing.assert_allclose(cut, whole, atol=1e-4)
    assert np.max(np.abs(once - whole)) > 0.05  # without the effect it is another motion


@pytest.mark.parametrize(("identifier", "law"), SENSORS)
def test_a_sensor_runs_behind_what_moved_before(identifier, law):
    robot = model(identifier, law, Fv=0.0)
    inputs = np.repeat([0.5, -3.0, 2.0, 1.0], [HELD + 50, 50, 50, 50])
    whole, cut, once = whole_and_cut(robot, inputs)
    np.testing.assert_allclose(cut, whole, atol=1e-8)
    assert abs(once[0] - whole[0]) > 0.03


def test_from_rest_nothing_was_commanded_before():
    robot = model("motor_lag", "first_order", Fv=2.0)
    inputs, dt = np.full((50, 1), 4.0), np.full(50, DT)
    numbers = robot.parameters.numbers
    rest = dict.fromkeys(robot.states, 0.0)
    with float64():
        found = [
            np.asarray(run(robot.structure, numbers, rest, inputs, dt, Integrator(4)))
            for run in (rollout, rollout_in_xla)
        ]
    t, T, tau = DT * np.arange(50), 0.15, 0.5
    expected = 2.0 * (1.0 - (tau * np.exp(-t / tau) - T * np.exp(-t / T)) / (tau - T))
    for own in found:
        np.testing.assert_allclose(own[:, 0], expected, atol=2e-5)


@pytest.mark.parametrize("hidden", ["motor_lag", "sensor_lag"])
def test_a_fit_of_logs_that_were_cut_in_motion_finds_a_lag(hidden):
    robot, rng, logs = model(hidden, "first_order", Fv=2.0), np.random.default_rng(5), []
    for k in range(3):
        inputs = np.repeat(rng.uniform(-5.0, 5.0, 26), 50)
        (y,) = simulate(robot, LogSet([log_of(inputs, robot)]), integrator=Integrator(4))
        noisy = (y[:, 0] + 0.005 * rng.normal(size=len(y)))[290:]
        logs.append(Log.from_arrays(f"run {k}", DT * np.arange(len(noisy)), inputs[290:, None], noisy[:, None], robot))
    usual = robot.parameters.change("Fc", free=False).change("offset", free=False)
    fit = output_error(robot.with_parameters(usual).with_values(**{f"{hidden}.time_constant": 0.05}), LogSet(logs))
    assert fit.judgement.trustworthy
    for name, true in {f"{hidden}.time_constant": 0.15, "M": 1.0, "Fv": 2.0}.items():
        assert abs(fit[name].value - true) < 4 * fit[name].std_error
