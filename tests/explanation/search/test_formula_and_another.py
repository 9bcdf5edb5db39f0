"""A drag and a gyro's scale that one curve of every axis follows, on a body by Newton's law in small steps."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Channels, Custom, DifferentialDrive, Log, LogSet, Parameter
from jaxid.effects import effect_by_id
from jaxid.explanation.refits.refit import continued, refit
from jaxid.explanation.search.formula_and_another import by_a_formula_and_another
from jaxid.explanation.search.steps import Step
from jaxid.simulation.scaled import scaled_to

DRAG, SCALE, NOISE = 1.6, 0.94, 0.01
TRUE = {"M": 10.0, "B": 3.0, "J": 0.4}
BODY = Custom(
    dynamics=lambda s, u, p: {
        "v": (u["ahead"] - p["B"] * s["v"]) / p["M"],
        "w": (u["turn"] - p["Bw"] * s["w"]) / p["J"],
    },
    state_names=("v", "w"),
    own_channels=Channels(
        inputs=("ahead", "turn"), outputs=("v", "w"), units={"ahead": "N", "turn": "N m", "v": "m/s", "w": "rad/s"}
    ),
    table={
        "M": Parameter(8.0, "kg", free=True, lower=0.0),
        "B": Parameter(4.0, "N s/m", free=True, lower=0.0),
        "J": Parameter(0.3, "kg m^2", free=True, lower=0.0),
        "Bw": Parameter(0.8, "N m s/rad"),
    },
    forces={"v": "M", "w": "J"},
    turning="w",
    plane=("v", "", "w"),
)


def run(seed, drag, scale):
    random = np.random.default_rng(seed)
    forces = np.repeat(random.uniform(-1, 1, (24, 2)) * [25.0, 1.6], 25, axis=0)
    v, w, found = 0.0, 0.0, []
    for ahead, turn in forces:
        found.append((v, scale * w))
        for _ in range(40):
            v += 0.02 / 40 * (ahead - TRUE["B"] * v - drag * v * abs(v)) / TRUE["M"]
            w += 0.02 / 40 * (turn - 0.8 * w) / TRUE["J"]
    seen = np.array(found) + NOISE * random.normal(size=(600, 2))
    return Log.from_arrays(f"{seed}", 0.02 * np.arange(600), forces, seen, BODY)


def by_a_curve(drag, scale):
    """The steps and the model in which one curve of every axis follows it."""
    logs, held_out = (LogSet([run(seed, drag, scale) for seed in seeds]) for seeds in (range(4), (20, 21)))
    noise = {"v": NOISE, "w": NOISE}

    def fitted(model):
        start = {name: model.parameters[name].value for name in model.parameters.free_names}
        return refit(model, [start], logs, held_out, noise, {})

    base = fitted(scaled_to(BODY.with_values(**TRUE), logs))
    every = replace(effect_by_id(base.robot, "quadratic_drag", "shape"), apart=True)
    curve = continued(fitted(base.robot + every), logs, held_out, noise)
    return [Step((curve,), (), (), base, curve, (curve,))], curve, base, logs, held_out, noise


@pytest.mark.slow  # ten seconds; the one below takes the same way
def test_a_drag_and_the_scale_of_a_gyro_are_no_drag_of_every_axis():
    steps, current, base, *logs = by_a_curve(DRAG, SCALE)
    assert current.held_out.normalised_rms < 1.1 and current.free - base.free >= 6
    found, after = by_a_formula_and_another(steps, current, base, (), *logs, lambda message: None)
    (first, drag), (second, scale) = ((step.chosen.id, step.chosen.law) for step in found)
    # That the yaw rate answers less to its command may be the command's gain, too, as the step says.
    assert (first, drag) == ("quadratic_drag", "whole_speed") and second in ("sensor_scale", "steering_error")
    assert {"sensor_scale", "steering_error"} <= {second, *found[1].equivalent}
    assert after.free - base.free <= 3 and after.held_out.normalised_rms < 1.05
    assert after.robot.parameters.numbers["quadratic_drag.coefficient"] == pytest.approx(DRAG, rel=0.02)
    assert after.robot.parameters.numbers["B"] == pytest.approx(TRUE["B"], rel=0.03)


def test_a_curve_that_is_all_there_is_stays():
    """A drag of the yaw rate, too, is of its mechanism."""
    steps, current, base, *logs = by_a_curve(DRAG, 1.0)
    found, after = by_a_formula_and_another(steps, current, base, (), *logs, lambda message: None)
    assert found == steps and after is current


def test_a_curve_of_few_heights_is_not_asked():
    steps, current, base, *logs = by_a_curve(DRAG, 1.0)
    few = [name for name in current.robot.parameters.free_names if name.startswith("quadratic_drag.")][3:]
    robot = current.robot
    for name in few:
        robot = robot.change(name, free=False)
    current = replace(current, robot=robot)
    assert by_a_formula_and_another(steps, current, base, (), *logs, pytest.fail) == (steps, current)


def rims(seed, scale):
    """A differential drive whose rims know nothing of each other (J = M b^2), with friction that rises towards standstill from
    2 to 3.2 N, sticks, and a yaw rate that is measured `scale` times too large; by 100 steps a sample."""
    random, b, M, h = np.random.default_rng(seed), 0.21, 12.0, 2e-4
    forces, s, found = np.repeat(random.uniform(-20, 20, (40, 2)), 15, axis=0), np.zeros(2), []
    for force in forces:
        found.append(s)
        for _ in range(100):
            free = s + 2 * h / M * (force - 6.0 * s)
            level = 2.0 + 1.2 * np.exp(-((s / 0.15) ** 2))
            s = np.sign(free) * np.maximum(np.abs(free) - 2 * h / M * level, 0.0)
    right, left = np.array(found).T
    seen = np.stack([(right + left) / 2, scale * (right - left) / (2 * b)], axis=1)
    seen = seen + random.normal(size=seen.shape) * [0.01, 0.03]
    return Log.from_arrays(f"{seed}", 0.02 * np.arange(600), forces, seen, DifferentialDrive())


@pytest.mark.slow
def test_a_curve_that_is_not_its_own_mechanism_s_is_asked_as_formulas_of_others():
    """Friction that rises towards standstill, beside the scale of a sensor, had been asymmetric viscous friction by a curve for
    either way of every wheel, whose ways were the same."""
    logs, held_out = (LogSet([rims(seed, 1.04) for seed in seeds]) for seeds in (range(4), (20, 21)))
    noise = {"v": 0.01, "w": 0.03}

    def fitted(model):
        start = {name: model.parameters[name].value for name in model.parameters.free_names}
        return continued(refit(model, [start], logs, held_out, noise, {}), logs, held_out, noise)

    robot = DifferentialDrive().with_values(b=0.21, M=12.0, J=0.5, Fv=6.0, Fc=2.0)
    base = fitted(scaled_to(robot, logs))
    ways = effect_by_id(base.robot, "asymmetric_viscous_friction", "shape")
    curve = fitted(base.robot + replace(ways, apart=True))
    numbers = curve.robot.parameters.numbers
    both = {n: 0.5 * (x + numbers[n.replace("forward", "backward")]) for n, x in numbers.items() if "forward" in n}
    alike = {name.replace("forward", way): value for name, value in both.items() for way in ("forward", "backward")}
    curve = replace(curve, robot=curve.robot.with_values(**alike))
    assert not curve.effect.agrees(curve.robot)
    other = fitted(base.robot + effect_by_id(base.robot, "stribeck_friction"))
    steps = [Step((curve, other), (), (), base, curve, (curve,))]
    found, after = by_a_formula_and_another(steps, curve, base, (), logs, held_out, noise, lambda message: None)
    named = [step.chosen.id for step in found]
    assert named[0] == "stribeck_friction" and "sensor_scale" in {named[1], *found[1].equivalent}
    assert after.free < curve.free and after.held_out.normalised_rms < 1.05


FOUR = Custom(
    dynamics=lambda s, u, p: {
        "V": (u["a"] + u["b"] + u["c"] + u["d"] - p["B"] * s["V"]) / p["M"],
        "Vn": (u["b"] + u["c"] - u["a"] - u["d"] - p["B"] * s["Vn"]) / p["M"],
        "W": (0.3 * (u["b"] + u["d"] - u["a"] - u["c"]) - p["Bw"] * s["W"]) / p["J"],
    },
    state_names=("V", "Vn", "W"),
    own_channels=Channels(
        inputs=tuple("abcd"),
        outputs=("V", "Vn", "W"),
        units={**dict.fromkeys("abcd", "N"), "V": "m/s", "Vn": "m/s", "W": "rad/s"},
    ),
    table={
        "M": Parameter(20.0, "kg", free=True, lower=0.0),
        "B": Parameter(15.0, "N s/m", free=True, lower=0.0),
        "J": Parameter(1.0, "kg m^2", free=True, lower=0.0),
        "Bw": Parameter(2.0, "N m s/rad", free=True, lower=0.0),
    },
    forces={"V": "M", "Vn": "M", "W": "J"},
    turning="W",
    plane=("V", "Vn", "W"),
)


def driven_by_four(seed):
    """A body on four wheels, the third of which has 0.88 of its force, and 30 N s/m more friction sideways."""
    random = np.random.default_rng(seed)
    forces = np.repeat(random.uniform(-20.0, 20.0, (24, 4)), 25, axis=0)
    state, found = np.zeros(3), []
    for a, b, c, d in forces * [1.0, 1.0, 0.88, 1.0]:
        found.append(state.copy())
        pushes = np.array([a + b + c + d, b + c - a - d, 0.3 * (b + d - a - c)])
        for _ in range(40):
            state += 0.02 / 40 * (pushes - np.array([15.0, 45.0, 2.0]) * state) / [20.0, 20.0, 1.0]
    seen = np.array(found) + NOISE * random.normal(size=(600, 3))
    return Log.from_arrays(f"{seed}", 0.02 * np.arange(600), forces, seen, FOUR)


def test_a_weak_motor_and_friction_sideways_are_no_cross_talk_of_four_motors():
    logs, held_out = (LogSet([driven_by_four(seed) for seed in seeds]) for seeds in (range(4), (20, 21)))
    noise = dict.fromkeys(("V", "Vn", "W"), NOISE)

    def fitted(model):
        start = {name: model.parameters[name].value for name in model.parameters.free_names}
        return refit(model, [start], logs, held_out, noise, {})

    base = fitted(scaled_to(FOUR, logs))
    cross, gain = (
        continued(fitted(base.robot + effect_by_id(base.robot, name)), logs, held_out, noise)
        for name in ("motor_cross_talk", "motor_gain_mismatch")
    )
    assert cross.score < gain.score  # so that cross talk was the name
    steps = [Step((cross, gain), (), (), base, cross, (cross,))]
    found, after = by_a_formula_and_another(steps, cross, base, (), logs, held_out, noise, lambda message: None)
    assert [step.chosen.id for step in found] == ["motor_gain_mismatch", "sideways_friction"]
    assert after.held_out.normalised_rms < 1.05 and after.score < cross.score
