"""Fits that end where the simulation is finite and its derivatives are not: speeds in mm/s of a robot in SI units did."""

import numpy as np
import pytest

from jaxid import Axis, LogSet, ParameterError, output_error
from jaxid.estimate.output_error import fitted


def test_derivatives_that_overflow_are_said_in_a_sentence(axis_log, monkeypatch):
    settled = fitted._settled

    def overflown(*arguments):
        problem, optimum, iterations = settled(*arguments)
        shared = np.array(optimum.triangle.shared)
        shared[:, -1] = np.nan
        return problem, optimum._replace(triangle=optimum.triangle._replace(shared=shared)), iterations

    monkeypatch.setattr(fitted, "_settled", overflown)
    inputs = np.repeat(np.random.default_rng(1).uniform(-5, 5, 20), 15)
    logs = LogSet([axis_log("a", inputs, position=False, noise=0.01)])
    with pytest.raises(ParameterError, match="its derivatives are not"):
        output_error(Axis(), logs, windows=None)
