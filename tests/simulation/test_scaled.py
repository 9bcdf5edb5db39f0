"""Orders of magnitude of what a robot does."""

import numpy as np
import pytest

from jaxid import Log, LogSet, Omni
from jaxid.simulation.scaled import scales_of


def logs(robot):
    time = 0.02 * np.arange(300)
    inputs = 3.0 * np.sin(time)[:, None] * np.array([1.0, -1.0, 1.0, 0.5])
    outputs = 0.3 * np.sin(time)[:, None] * np.ones(3)
    return LogSet([Log.from_arrays("run", time, inputs, outputs, robot.channels)])


@pytest.mark.filterwarnings("error")
def test_a_parameter_at_its_bound_that_something_is_divided_by_is_no_error():
    usual = scales_of(Omni(), logs(Omni()))
    bound = scales_of(Omni().with_values(J=0.0), logs(Omni()))
    assert bound.torque == usual.torque
    assert bound.force == usual.force
    assert np.isfinite(bound.friction) and bound.friction > 0.0
