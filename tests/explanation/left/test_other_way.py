"""Outputs whose sign, or unit in one log, contradicts the model, on an axis in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, Channels, Custom, Log, LogSet, Parameter, ParameterTable, explain_change, output_error
from jaxid.explanation.left.other_way import other_way

ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.5)


def runs(axis_log, factors, noise=0.01):
    logs = []
    for k, factor in enumerate(factors):
        inputs = np.repeat(np.random.default_rng(k).uniform(-5, 5, 25), 20)
        log = axis_log(f"run {k}", inputs, noise=noise, seed=k, position=False, M=1.3, Fv=2.0, Fc=0.5)
        logs.append(Log.from_arrays(log.name, log.time, log.inputs, factor * log.output("v"), "axis"))
    return LogSet(logs[:-2]), LogSet(logs[-2:])


@pytest.mark.parametrize("factors", [(1, 1, 1, 1, 1, 1), (1.1, 1, 0.9, 1, 1.2, 1)])
def test_of_logs_that_agree_in_sign_and_unit_nothing_is_said(axis_log, factors):
    logs, held_out = runs(axis_log, factors)
    assert other_way(output_error(ROBOT, logs), logs, held_out) == ""


def test_a_sign_that_one_log_has_alone_is_said_with_the_log(axis_log):
    logs, held_out = runs(axis_log, (1, 1, -1, 1, 1, 1))
    fit = output_error(ROBOT, logs)
    said = other_way(fit, logs, held_out)
    assert "v goes the other way than the model says in run 2" in said and "run 1" not in said
    assert other_way(fit, logs, logs) == other_way(fit, logs)  # names that both have are looked at once


def test_a_table_whose_own_value_lies_beyond_the_users_bound_is_asked_all_the_same(axis_log):
    logs, held_out = runs(axis_log, (1, 1, -1, 1, 1, 1))
    fit = output_error(ROBOT.change("M", lower=1.2, upper=1.5, value=1.3), logs)
    assert not 1.2 <= ROBOT.defaults()["M"].value <= 1.5
    assert "v goes the other way than the model says in run 2" in other_way(fit, logs, held_out)


@pytest.mark.parametrize("noise", [0.01, 0.6])
def test_a_sign_that_is_wrong_in_every_log_is_said(axis_log, noise):
    """No mass is negative: the fit makes it so large that nothing moves, or the friction."""
    logs, held_out = runs(axis_log, (-1, -1, -1, -1, -1, -1), noise)
    said = other_way(output_error(ROBOT, logs), logs, held_out)
    assert "v goes the other way than the model says" in said and "its unit" not in said


def test_a_unit_that_one_log_has_alone_is_said_with_the_factor(axis_log):
    logs, held_out = runs(axis_log, (1, 3.6, 1, 1, 1, 1))
    said = other_way(output_error(ROBOT, logs), logs, held_out)
    assert "times as far in run 1 as in the other logs (its unit)" in said and "other way" not in said


@pytest.mark.parametrize("factor", [1.0, 1.6, 4.0])
def test_two_sensors_of_one_motion_that_differ_by_a_unit_are_said_with_the_factor(factor):
    """A cart's speed and the rate of its wheel of 0.1 m, counted in quarters; a scale of 1.6 may be the wheel's."""
    robot = Custom(
        dynamics=lambda s, u, p: {"v": (u["u"] - p["fv"] * s["v"]) / p["m"]},
        state_names=("v",),
        output=lambda s, u, p: {"speed": s["v"], "rate": s["v"] / 0.1},
        own_channels=Channels(inputs=("u",), outputs=("speed", "rate")),
        table=ParameterTable({"m": Parameter(1.0, "kg", free=True), "fv": Parameter(1.0, "N s/m", free=True)}),
    )
    logs = []
    for k in range(3):
        rng = np.random.default_rng(k)
        u, v = np.repeat(rng.uniform(-5, 5, 25), 20), np.zeros(500)
        keep = np.exp(-0.02 * 2.0 / 1.3)
        for t in range(499):
            v[t + 1] = keep * v[t] + (1 - keep) * u[t] / 2.0
        outputs = {"speed": v + 0.01 * rng.normal(size=500), "rate": factor * v / 0.1 + 0.1 * rng.normal(size=500)}
        logs.append(Log.from_arrays(f"run {k}", 0.02 * np.arange(500), u[:, None], outputs, robot.channels))
    said = other_way(output_error(robot, LogSet(logs[:2])), LogSet(logs[:2]), LogSet(logs[2:]))
    if factor < 2:
        assert said == ""
    else:
        assert "every log goes in" in said and ("speed 0.2" in said or "rate 4 times" in said or "rate 3.9" in said), (
            said
        )


@pytest.mark.slow
def test_between_two_sets_a_turned_sign_is_no_change_of_the_robot(axis_log):
    usual, turned = (runs(axis_log, (sign,) * 6)[0] for sign in (1, -1))
    before, after = output_error(ROBOT, usual), output_error(ROBOT, turned)
    renamed = LogSet([replace(log, name=f"after {log.name}") for log in turned])
    found = explain_change(before, after, usual, renamed)
    assert found.verdict == "unexplained" and "v goes the other way" in " ".join(found.doubts)
