"""Effects one parameter of which others can do as well, on an axis in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, DifferentialDrive, Log, LogSet, Parameter
from jaxid.effects import effect_by_id
from jaxid.explanation.refits.held_parameters import with_parameters_held
from jaxid.explanation.refits.refit import refit
from jaxid.explanation.search.denser import with_denser_curve
from jaxid.simulation.scaled import scaled_to
from tests.explanation import closed_form_axis
from tests.explanation.closed_form_axis import driven

SEED = 4
NOISE = {"v": closed_form_axis.NOISE}


def with_curve(logs, held_out, known):
    """The axis and a curve of what is lost of its command, all heights free, refitted."""
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0), logs)
    for name in ("Fc", "offset", *known):
        robot = robot.change(name, free=False)
    robot = robot + effect_by_id(robot, "voltage_saturation", "shape")
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    return refit(robot, [start], logs, held_out, NOISE, {})


def limited(u):
    return 3.0 * np.tanh(u / 3.0)


def test_of_a_scale_that_nobody_sees_one_height_is_held():
    logs, held_out = driven(limited, SEED)
    trial = with_curve(logs, held_out, known=())
    held = with_parameters_held(trial, logs, held_out, NOISE)
    fixed = [name for name, p in held.robot.parameters.items() if ".at_" in name and not p.free]
    assert fixed == ["voltage_saturation.at_1"] and held.robot.parameters[fixed[0]].value == 0.0
    assert held.free == trial.free - 1 and held.squares < trial.squares + 5.0
    # What is measured of the motion now says what moves: the same, but for the scale that the held height chooses.
    assert held.robot.parameters["Fv"].value / held.robot.parameters["M"].value == pytest.approx(2.0, rel=0.02)


def test_a_height_that_something_needs_stays_free():
    logs, held_out = driven(lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.8, 0.0), SEED)
    trial = with_curve(logs, held_out, known=("M", "Fv"))
    assert with_parameters_held(trial, logs, held_out, NOISE) is trial


def test_a_model_without_curves_is_left_alone():
    logs, held_out = driven(limited, SEED)
    robot = scaled_to(Axis().with_values(M=1.0, Fv=2.0, Fc=0.0), logs)
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    trial = refit(robot, [start], logs, held_out, NOISE, {})
    assert with_parameters_held(trial, logs, held_out, NOISE, pytest.fail) is trial


def test_of_what_several_motors_have_alike_the_middle_one_is_held():
    """Three motors push one mass, the third a fifth weaker; with mass and friction unknown all is known but for a scale."""
    channels = Channels(("u1", "u2", "u3"), ("v",), units={"u1": "V", "u2": "V", "u3": "V", "v": "m/s"})
    table = {"M": Parameter(1.0, "kg", free=True, lower=0.1), "Fv": Parameter(2.0, "N s/m", free=True, lower=0.0)}
    robot = Custom(
        dynamics=lambda state, u, p: {"v": (u["u1"] + u["u2"] + u["u3"] - p["Fv"] * state["v"]) / p["M"]},
        state_names=("v",),
        own_channels=channels,
        table=table,
    )
    logs = []
    for k in range(3):
        rng = np.random.default_rng([4, k])
        u = np.repeat(rng.uniform(-4, 4, (40, 3)), 10, axis=0)
        decay, v, found = np.exp(-0.04), 0.0, []
        for force in u @ [1.0, 1.0, 0.8]:
            found.append(v)
            v = 0.5 * force + (v - 0.5 * force) * decay
        outputs = np.array(found) + NOISE["v"] * rng.normal(size=400)
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(400), u, outputs[:, None], channels))
    logs, held_out = LogSet(logs[:-1]), LogSet(logs[-1:])
    model = scaled_to(robot, logs) + effect_by_id(robot, "motor_gain_mismatch", "command")
    start = {name: model.parameters[name].value for name in model.parameters.free_names}
    keys = [f"motor_gain_mismatch.gain_u{k}" for k in (1, 2, 3)]
    trial = refit(model, [start | dict(zip(keys, (0.1, 0.1, -0.1), strict=True))], logs, held_out, NOISE, {})
    held = with_parameters_held(trial, logs, held_out, NOISE)
    values = held.robot.parameters
    assert [name for name in keys if not values[name].free][0] in keys[:2] and held.free == trial.free - 1
    assert [values[name].value for name in keys] == pytest.approx([0.0, 0.0, -0.2], abs=0.003)
    assert (values["M"].value, values["Fv"].value) == pytest.approx((1.0, 2.0), rel=0.003)


def test_of_two_sensors_the_one_that_is_right_has_no_curve():
    """A gyro that shows less of more beside a speed that is right: twice as much of both would be other masses and drags."""
    robot = DifferentialDrive().with_values(b=0.2, M=2.0, J=0.05, Fv=1.5, Fc=0.0).change("Fc", free=False)
    logs = []
    for k in range(3):
        random = np.random.default_rng([SEED, k])
        u = np.repeat(random.uniform(-2.0, 2.0, (40, 2)), 10, axis=0)
        v = w = 0.0
        seen = []
        for right, left in u:
            seen.append((v, 5.0 * np.tanh(w / 5.0)))
            for _ in range(20):  # Euler's rule, in steps of a millisecond
                v += 1e-3 * (right + left - 2.0 * 1.5 * v) / 2.0
                w += 1e-3 * (0.2 * (right - left) - 2.0 * 0.2**2 * 1.5 * w) / 0.05
        shown = np.array(seen) + random.normal(size=(400, 2)) * (0.003, 0.005)
        inputs = {"u_right": u[:, 0], "u_left": u[:, 1]}
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(400), inputs, shown, robot))
    fitted, held_out = LogSet(logs[:2]), LogSet(logs[2:])
    noise = {"v": 0.003, "w": 0.005}
    robot = scaled_to(robot, fitted)
    robot = robot + effect_by_id(robot, "sensor_scale", "shape")
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    beyond = robot.with_values(**{"sensor_scale.reach": 1.6})
    trial = replace(refit(beyond, [start], fitted, held_out, noise, {}), id="sensor_scale")
    held = with_parameters_held(trial, fitted, held_out, noise)
    fixed = {name for name, p in held.robot.parameters.items() if ".at_" in name and not p.free}
    assert fixed == {f"sensor_scale.at_{k}_v" for k in (1, 2, 3)} and held.score < trial.score
    numbers = held.robot.parameters.numbers
    assert numbers["M"] == pytest.approx(2.0, rel=0.02) and numbers["J"] == pytest.approx(0.05, rel=0.02)
    assert -0.3 < numbers["sensor_scale.at_3_w"] < -0.1
    # A curve that is nothing stays nothing where the other one gets more points.
    dense = with_denser_curve(held.robot, "sensor_scale").parameters
    assert {name for name, p in dense.items() if ".at_" in name and not p.free} == {
        f"sensor_scale.at_{k}_v" for k in range(1, 6)
    }
