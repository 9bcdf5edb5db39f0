"""What is late by less than a row: a speed from an encoder's counts is the mean over the row before."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.explanation.search.between_rows import with_rows_between

MASS, VISCOUS, DT, NOISE = 2.0, 8.0, 0.02, 0.0015


def _log(name: str, seed: int) -> Log:
    """The mean speed over each row, in closed form, of an axis whose command changes at every row."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(-8.0, 8.0, 30), 20) + rng.uniform(-6.0, 6.0, 600)
    decay, v, found = np.exp(-VISCOUS / MASS * DT), 0.0, [0.0]
    for force in u[:-1]:
        settled = force / VISCOUS
        found.append(settled + (v - settled) * (1.0 - decay) / (VISCOUS / MASS * DT))
        v = settled + (v - settled) * decay
    outputs = {"v": np.array(found) + NOISE * rng.normal(size=len(u))}
    return Log.from_arrays(name, DT * np.arange(len(u)), u[:, None], outputs, AXIS)


def test_rows_between_hold_the_inputs_and_measure_nothing():
    log = _log("run", 1)
    (fine,) = with_rows_between(LogSet([log]))
    assert len(fine) == 4 * (len(log) - 1) + 1
    np.testing.assert_allclose(fine.time[::4], log.time, atol=1e-12)
    np.testing.assert_allclose(np.diff(fine.time), DT / 4.0, rtol=1e-9)
    np.testing.assert_array_equal(fine.inputs, np.repeat(log.inputs, 4, axis=0)[: len(fine)])
    np.testing.assert_array_equal(fine.output("v")[::4], log.output("v"))
    assert np.isnan(np.delete(fine.output("v"), np.s_[::4])).all()


def test_rows_come_between_those_of_a_log_that_others_were_put_into():
    """Rows in which a command changed unseen were put back, beside further columns of which there are none."""
    log = _log("run", 1)
    read = replace(log, extra=pd.DataFrame(index=range(len(log) - 5)))
    (fine,) = with_rows_between(LogSet([read]))
    assert len(fine) == 4 * (len(log) - 1) + 1 and not len(fine.extra.columns)


@pytest.mark.slow
def test_a_mean_over_the_row_before_is_not_called_a_late_input_alone():
    logs, held_out = LogSet([_log(f"run {k}", k) for k in range(3)]), LogSet([_log("check", 7)])
    robot = Axis().with_values(offset=0.0, Fc=0.0).change("offset", free=False).change("Fc", free=False)
    found = explain(output_error(robot, logs), logs, held_out)
    (effect,) = found.effects
    # Of a linear robot, it is the same as half a row's delay of either the sensor or the command.
    assert {effect.id, *effect.equivalent_to} == {"input_delay", "sensor_delay", "sensor_lag"}
    assert found.verdict == "ambiguous" and found.gap_closed > 0.95
    late = effect.parameters["delay"]
    assert abs(late.value - 0.5 * DT) < 0.02 * DT
