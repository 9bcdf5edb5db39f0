"""A refit that runs away is a bad trial and no error: the others go on."""

from dataclasses import replace

import numpy as np
import pytest

import jaxid.explanation.refits.refit as under_test
from jaxid import AXIS, Axis, Log, LogSet
from jaxid.effects import effect_by_id
from jaxid.explanation.refits.refit import continued, refit
from jaxid.logs import noise_scale


def recorded(axis_law, seed):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-4, 4, 30), 10)
    v = axis_law(u, 0.02)[0] + 0.003 * rng.normal(size=len(u))
    return LogSet([Log.from_arrays(f"run {seed}", 0.02 * np.arange(len(u)), u[:, None], {"v": v}, AXIS)])


@pytest.mark.parametrize("mass", [1e-12, float("nan")])
def test_a_model_that_cannot_be_simulated_is_as_bad_as_can_be(axis_law, monkeypatch, mass):
    logs, held_out = recorded(axis_law, 1), recorded(axis_law, 2)
    found = under_test.by_name
    monkeypatch.setattr(under_test, "by_name", lambda *given: {**found(*given), "M": mass})
    robot = Axis()
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    trial = refit(robot, [start], logs, held_out, noise_scale(held_out), {})
    assert trial.squares == trial.score == np.inf
    assert np.isfinite(trial.held_out.normalised_rms) and trial.robot.parameters["M"].value == start["M"]


def test_what_a_refit_leaves_of_held_out_logs_is_worked_out_once_and_only_if_asked_for(axis_law, monkeypatch):
    logs, held_out, asked = recorded(axis_law, 1), recorded(axis_law, 2), []
    found = under_test.predicted
    monkeypatch.setattr(under_test, "predicted", lambda *given: asked.append(given) or found(*given))
    robot = Axis()
    start = {name: robot.parameters[name].value for name in robot.parameters.free_names}
    trial = refit(robot, [start], logs, held_out, noise_scale(held_out), {})
    assert not asked
    left = trial.held_out
    assert replace(trial, id="another").held_out is trial.held_out is left and len(asked) == 1
    known = trial.leaving(trial.fitted)
    assert known.held_out is trial.fitted and len(asked) == 1


def behind_a_lag(u, dt, lag, mass, seed):
    """Speed of a mass with viscous friction 0.5 N s/m and dry friction 0.3 N whose force follows `u` by a first-order lag, in
    steps of 0.2 ms: it stands where the force cannot move it."""
    v, force, found, h = 0.0, 0.0, [], 2e-4
    for command in u:
        found.append(v)
        for _ in range(round(dt / h)):
            force += (command - force) * -np.expm1(-h / lag)
            pushed = v + h * (force - 0.5 * v) / mass
            v = np.sign(pushed) * max(abs(pushed) - 0.3 * h / mass, 0.0)
    return np.array(found) + 0.05 * np.random.default_rng(seed).normal(size=len(u))


def test_of_two_lags_one_after_the_other_each_is_tried_as_the_motors():
    """Mass over friction is 0.04 s, the motor's lag 0.06 s: a search that ends with the two exchanged ends there no more."""
    runs = []
    for seed in range(3):
        u = np.repeat(np.random.default_rng(seed).uniform(-6, 6, 20), 25)
        v = behind_a_lag(u, 0.02, 0.06, 0.02, seed)
        runs.append(Log.from_arrays(f"run {seed}", 0.02 * np.arange(len(u)), u[:, None], {"v": v}, AXIS))
    logs, held_out = LogSet(runs[:2]), LogSet(runs[2:])
    robot = Axis().with_values(M=0.03, Fv=0.5, Fc=0.3)
    robot = robot + effect_by_id(robot, "motor_lag", "first_order")
    exchanged = {"M": 0.03, "Fv": 0.5, "Fc": 0.3, "offset": 0.0, "motor_lag.time_constant": 0.04}
    noise = noise_scale(held_out)
    first = refit(robot, [exchanged], logs, held_out, noise, {})
    found = continued(first, logs, held_out, noise)
    assert first.robot.parameters["M"].value > 0.028 and first.held_out.normalised_rms > 1.05
    assert found.robot.parameters["M"].value == pytest.approx(0.02, rel=0.02)
    assert found.robot.parameters["motor_lag.time_constant"].value == pytest.approx(0.06, rel=0.02)
