"""Inputs of missing rows estimated from what came of them: a linear drive whose samples are known in closed form."""

import numpy as np
import pytest

from jaxid import output_error
from jaxid.estimate.output_error.lost_inputs import with_lost_inputs

from .test_lost_rows import CHANGES, DT, INPUTS, ROBOT, without

NOISE = 0.005
ERROR = NOISE / (1.0 - np.exp(-DT)) * np.sqrt(1.0 - np.exp(-2.0 * DT))
"""Standard deviation of an input of one row as the speeds after it tell it, which fade within a second (least squares)."""


def put_back(rows):
    """The logs without `rows`, a fit to them, and what is put back."""
    logs = without(rows, noise=NOISE)
    return logs, with_lost_inputs(output_error(ROBOT, logs).robot, logs, {"v": NOISE})


@pytest.mark.parametrize(("first", "new"), [(0, 1.0), (-1, 0.0)])
def test_the_moment_of_a_change_is_found_whether_it_came_early_or_late(first, new):
    logs, found = put_back(CHANGES + first)  # of one row, missing where the new input begins or just before
    (log,) = found.logs
    assert found.places == len(CHANGES) and len(log) == len(logs[0]) + len(CHANGES)
    assert np.allclose(np.diff(log.time), DT)
    back = np.flatnonzero(~np.isfinite(log.outputs[:, 0]))
    steps = INPUTS[CHANGES] - INPUTS[CHANGES - 1]
    shares = (log.inputs[back, 0] - INPUTS[CHANGES - 1]) / steps
    assert np.all(np.abs(shares - new) * np.abs(steps) < 4.0 * ERROR)


def test_a_step_in_several_missing_rows_comes_at_one_of_them():
    rows = np.sort(np.concatenate([CHANGES + k for k in (-1, 0, 1)]))
    _, found = put_back(rows)
    (log,) = found.logs
    back = np.flatnonzero(~np.isfinite(log.outputs[:, 0])).reshape(len(CHANGES), 3)
    true = sum(INPUTS[CHANGES + k] for k in (-1, 0, 1))
    assert np.all(np.abs(log.inputs[back, 0].sum(axis=1) - true) < 4.0 * ERROR)


def test_the_parameters_come_nearer_and_their_errors_say_how_near():
    logs, found = put_back(CHANGES)
    before, after = output_error(ROBOT, logs), output_error(ROBOT, found.logs)
    wide = found.widened(after)
    assert all(found.wider[n] >= 1.0 for n in ("M", "Fv")) and max(found.wider.values()) > 1.02
    for n in ("M", "Fv"):
        assert wide[n].std_error == pytest.approx(found.wider[n] * after[n].std_error)
        assert abs(wide[n].value - 1.0) < 3.5 * wide[n].std_error
    k = after.free_names.index("M")
    assert wide.covariance[k, k] == pytest.approx(wide["M"].std_error ** 2)
    off = [max(abs(fit[n].value - 1.0) for n in ("M", "Fv")) for fit in (before, wide)]
    assert off[1] < off[0]


def test_logs_whose_inputs_do_not_change_unseen_stay_as_they_are():
    logs, found = put_back(CHANGES + 10)
    assert found.logs is logs and found.places == 0
