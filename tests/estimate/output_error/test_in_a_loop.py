"""Coloured noise that a controller feeds back biases output error, and not the estimates of the whitened residual."""

import numpy as np
import pytest

from jaxid import Axis, output_error
from jaxid.estimate.output_error.conclude import FED_BACK
from tests.closed_loop_runs import MASS, driven

START = Axis().with_values(M=1.0, Fv=1.5, Fc=0.5, offset=0.0)


def test_a_controller_that_sees_coloured_noise_biases_nothing():
    off = []
    for seed in range(1, 7):
        fit = output_error(START, driven(seed))
        assert fit.judgement.verdict == "coloured" and not fit.judgement.follows and FED_BACK in fit.notes
        off.append((fit["M"].value - MASS) / fit["M"].std_error)
    assert abs(np.mean(off)) < 1.0 and np.max(np.abs(off)) < 3.5  # 1.7 and 3.3 by output error alone


@pytest.mark.parametrize(("memory", "sees_noise"), [(0.6, False), (0.0, True)], ids=["open", "white"])
def test_where_there_is_no_loop_or_no_colour_nothing_is_else(memory, sees_noise):
    fit = output_error(START, driven(11, memory=memory, sees_noise=sees_noise))
    assert fit.judgement.trustworthy and FED_BACK not in fit.notes


def test_what_the_model_lacks_in_a_loop_is_no_colour_of_the_noise():
    fit = output_error(START, driven(12, size=0.03, drag=1.5))
    assert fit.judgement.verdict == "poor" and FED_BACK not in fit.notes


def test_what_is_known_beforehand_counts_in_a_loop_too():
    known = START.change("Fc", prior=(0.8, 0.001))
    fit = output_error(known, driven(1))
    assert FED_BACK in fit.notes
    assert fit["Fc"].std_error < 0.0011 and abs(fit["Fc"].value - 0.8) < 0.004
