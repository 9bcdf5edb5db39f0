"""Inputs and outputs on different clocks, jittering stamps, and logs on which a simulation diverges."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxid import Axis, Integrator, Log, LogSet, output_error
from jaxid.estimate.output_error.problem import shifted

TRUE = {"M": 1.0, "Fv": 2.0, "Fc": 0.5}
ROBOT = Axis().change("offset", free=False).with_values(**TRUE)
INPUTS = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5], 100)
FINE = Integrator(4)


@pytest.mark.usefixtures("double_precision")
def test_shifted_outputs_are_those_of_a_later_time():
    dt = jnp.array([0.1, 0.2, 0.1, 0.3, 0.1])
    time = jnp.cumsum(dt) - dt
    y = jnp.stack([2.0 * time, 1.0 - time], axis=1)
    assert np.allclose(shifted(y, dt, jnp.array(0.0)), y)
    assert np.allclose(shifted(y, dt, jnp.array(0.05))[:-1, 0], 2.0 * (time[:-1] + 0.05))
    slope = jax.jacfwd(lambda offset: shifted(y, dt, offset))(jnp.array(0.02))
    assert np.allclose(slope[:-1], [[2.0, -1.0]])


def late(axis_log, offsets, noise=0.01):
    """Runs of which the outputs' stamps lag the inputs' clock by `offsets` [s]."""
    logs = []
    for k, offset in enumerate(offsets):
        inputs = np.repeat(np.roll(INPUTS, 100 * k), 10)
        fine = axis_log(f"run {k}", inputs, 0.0, 0, dt=0.002, position=False, **TRUE)
        at = np.clip(np.arange(0, 6000, 10) + round(offset / 0.002), 0, 5999)
        v = fine.output("v")[at] + noise * np.random.default_rng(k).normal(size=600)
        logs.append(Log.from_arrays(f"run {k}", fine.time[::10], fine.inputs[::10], {"v": v}, fine.channels))
    return LogSet(logs)


def test_each_logs_clock_offset_is_estimated_and_the_parameters_come_right(axis_log):
    offsets = {"run 0": 0.064, "run 1": -0.042, "run 2": 0.0}
    logs = late(axis_log, offsets.values())
    blind = output_error(ROBOT, logs, integrator=FINE)
    fit = output_error(ROBOT, logs, integrator=FINE, clock_offset=True)
    assert fit.converged and blind.clock_offsets == {}
    for name, true in offsets.items():
        estimate = fit.clock_offsets[name]
        assert estimate.unit == "s" and 0 < estimate.std_error < 0.002
        assert abs(estimate.value - true) < 4 * estimate.std_error
    for name, true in TRUE.items():
        assert abs(fit[name].value - true) < 4 * fit[name].std_error
        assert fit[name].std_error < blind[name].std_error
    assert fit.noise["v"] == pytest.approx(0.01, rel=0.1) and blind.noise["v"] > 0.03
    assert set(fit.initial_states["run 0"]) == set(ROBOT.states)


def test_jittering_and_irregular_stamps_leave_the_parameters_where_they_are(axis_log):
    rng = np.random.default_rng(6)
    logs = []
    for k in range(2):
        intervals = 0.02 * rng.uniform(0.3, 1.7, 600)  # truly irregular sampling
        log = axis_log(f"run {k}", np.roll(INPUTS, 100 * k), 0.01, k, dt=intervals, position=False, **TRUE)
        stamps = log.time + rng.normal(scale=0.001, size=600)  # and stamps that are a millisecond off
        logs.append(replace(log, time=np.maximum.accumulate(stamps + 1e-9 * np.arange(600))))
    fit = output_error(ROBOT, LogSet(logs), integrator=FINE)
    for name, true in TRUE.items():
        assert abs(fit[name].value - true) < 4 * fit[name].std_error


def test_a_log_on_which_the_simulation_diverges_is_left_out_and_named(axis_log):
    logs = list(late(axis_log, [0.0, 0.0]))
    wild = axis_log("wild", INPUTS, 0.01, dt=10.0, position=False)  # ten seconds are no step for this axis
    fit, sound = (output_error(ROBOT, LogSet(some), integrator=FINE) for some in ([*logs, wild], logs))
    assert fit.log_status["wild"].startswith("left out: the simulation diverges")
    assert any(note.startswith("wild left out") for note in fit.notes)
    for name in TRUE:
        assert fit[name].value == pytest.approx(sound[name].value, rel=1e-4)
        assert fit[name].std_error == pytest.approx(sound[name].std_error, rel=0.05)
    # Alone it has no start that simulates; least squares finds one, and that is told.
    said = []
    alone = output_error(ROBOT, LogSet([wild]), integrator=FINE, report=said.append)
    assert any("poor minimum" in sentence for sentence in said) and alone.log_status == {"wild": "fitted"}
    assert all(np.isfinite(alone[name].value) for name in TRUE)
