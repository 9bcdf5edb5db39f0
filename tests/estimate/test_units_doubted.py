"""jaxid/estimate/units_doubted.py: a fit that follows logs in wrong units to the noise is not to be trusted."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, instrumental_variables, integral_least_squares, output_error
from jaxid.estimate.units_doubted import with_units_doubted

ROBOT = Axis().change("offset", value=0.0, free=False).change("Fc", value=0.0, free=False)


@pytest.fixture(scope="module")
def log(axis_log):
    inputs = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5, 2.5, -3.0], 80)
    return axis_log("run", inputs, 0.01, 1, position=False, Fc=0.0)


@pytest.mark.parametrize("method", [integral_least_squares, instrumental_variables, output_error])
def test_milliseconds_taken_for_seconds(log, method):
    """A mass a thousand times too large, at the noise: every method says so; in seconds none has a doubt."""
    fit = method(ROBOT, LogSet([replace(log, time=1e3 * log.time)]))
    assert fit["M"].value > 100.0 and not fit.trustworthy
    assert any(
        "sampling interval of 20 s over" in note and "every number here is in them" in note for note in fit.notes
    )
    assert with_units_doubted(fit, LogSet([replace(log, time=1e3 * log.time)])) is fit
    right = method(ROBOT, LogSet([log]))
    assert right.trustworthy and not any("doubts the units" in note for note in right.notes)


@pytest.mark.parametrize(("scale", "doubted"), [(100.0, False), (1e4, True)])
def test_a_motors_shaft_turns_at_hundreds_of_radians_a_second(axis_log, scale, doubted):
    inputs = np.repeat([3.0, -2.0, 4.0, 0.8, -4.0, 1.5, 2.5, -3.0], 80)
    run = axis_log("run", inputs, 0.01, 1, position=False, Fc=0.0)
    fit = output_error(
        ROBOT, LogSet([Log.from_arrays("run", run.time, run.inputs, {"v": scale * run.output("v")}, run.channels)])
    )
    assert any("doubts the units" in note for note in fit.notes) is doubted
