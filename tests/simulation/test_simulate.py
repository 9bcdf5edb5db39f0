"""Whole logs: lengths, padding, starts and what is not fed back."""

import numpy as np
import pytest

from jaxid import Axis, Integrator, Log, LogSet, Pioneer, simulate
from jaxid.effects import effect_by_id
from jaxid.simulation import direct
from jaxid.simulation.simulate import integrator_for
from reference.logs import simulate as exact_run
from reference.pioneer import PIONEER

ROBOT = Axis().with_values(Fv=2.0, Fc=0.5)


def levels(n, seed):
    return np.repeat(np.random.default_rng(seed).uniform(-2, 2, -(-n // 10)), 10)[:n]


def test_logs_of_different_length_and_sampling_are_each_simulated_as_alone(axis_log, axis_law):
    logs = LogSet(
        [axis_log("long", levels(250, 1)), axis_log("short", levels(40, 2), dt=0.013), axis_log("mid", levels(99, 3))]
    )
    together = simulate(ROBOT, logs, integrator=Integrator(4))
    assert [len(outputs) for outputs in together] == [250, 40, 99]
    for log, outputs in zip(logs, together, strict=True):
        v, q = axis_law(log.inputs[:, 0], np.append(np.diff(log.time), 0.02))
        np.testing.assert_allclose(outputs, np.stack([v, q], axis=1), atol=5e-5)
        alone = simulate(ROBOT, LogSet([log]), integrator=Integrator(4))[0]
        np.testing.assert_allclose(outputs, alone, atol=1e-13)


def test_no_measurement_is_fed_back(axis_log):
    log = axis_log("clean", levels(100, 4))
    wrong = Log.from_arrays(
        "wrong", log.time, log.inputs, np.where(np.arange(100)[:, None] > 0, 7.0, 0.0) + 0 * log.outputs, "axis"
    )
    one, other = (simulate(ROBOT, LogSet([each]), integrator=Integrator(4))[0] for each in (log, wrong))
    np.testing.assert_array_equal(one, other)


def test_the_pioneers_demonstration_logs_are_explained_to_their_noise(demo_logs, demo_truth):
    logs = demo_logs("pioneer", "check_*")
    robot = Pioneer().with_values(**demo_truth("pioneer"))
    for log, outputs in zip(logs, simulate(robot, logs), strict=True):
        exact = exact_run(PIONEER, log.inputs, 0.02).speeds
        assert np.sqrt(np.mean(((outputs - exact) / [0.01, 0.02]) ** 2)) < 0.01
        residual = (log.outputs - outputs) / [0.01, 0.02]
        # 2502 normal numbers: their RMS has a standard deviation of 1 / sqrt(2 * 2502) = 0.014
        assert np.sqrt(np.mean(residual**2)) == pytest.approx(1.0, abs=0.05)


def test_a_given_start_replaces_the_logs_own(axis_log):
    logs = LogSet([axis_log("a", np.zeros(100)), axis_log("b", np.zeros(100))])
    outputs = simulate(ROBOT, logs, start={"v": np.array([0.4, 0.0])}, integrator=Integrator(4))
    time = logs[0].time
    expected = np.maximum((0.4 + 0.25) * np.exp(-2 * time) - 0.25, 0.0)  # slows down and stops
    np.testing.assert_allclose(outputs[0][:, 0], expected, atol=2e-5)
    assert np.all(outputs[1] == 0.0)


def test_the_default_step_suits_the_coarsest_log(axis_log):
    logs = LogSet([axis_log("fine", np.ones(20), dt=0.004), axis_log("coarse", np.ones(20), dt=0.04)])
    assert integrator_for(Pioneer(), logs).substeps == 4  # 40 ms in steps of max_step = 10 ms


def test_more_logs_than_fit_side_by_side_are_simulated_one_after_another(monkeypatch):
    robot = (Axis() + effect_by_id(Axis(), "input_delay")).with_values(**{"input_delay.delay": 0.013})
    rng = np.random.default_rng(5)
    inputs = rng.uniform(-4, 4, (7, 60, 1))
    logs = LogSet(
        [Log.from_arrays(f"{k}", 0.02 * np.arange(60), u, np.zeros((60, 1)), "axis") for k, u in enumerate(inputs)]
    )
    together = simulate(robot, logs)
    monkeypatch.setattr(direct, "_TOGETHER", 2000)
    for one, other in zip(together, simulate(robot, logs), strict=True):
        np.testing.assert_array_equal(one, other)
