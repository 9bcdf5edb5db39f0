"""jaxid/explanation/refits/errors_of_angles.py: what angles that are not quite known add to standard errors."""

import numpy as np
import pytest

from jaxid import Axis, output_error
from jaxid.explanation.refits.errors_of_angles import with_errors_of_angles
from jaxid.explanation.where.missing_force import Smoothed
from tests.explanation.closed_form_axis import driven


@pytest.fixture(scope="module")
def fit():
    return output_error(Axis().with_values(M=1.0, Fv=2.0), driven(lambda u: u, 2)[0])


def way(end):
    """An angle [2, 101] that is known at the start and within `end` of the last one."""
    return Smoothed(
        np.tile(np.linspace(0.0, 10.0, 101), (2, 1)), np.tile(np.sqrt(np.linspace(0.04, 0.04 + end**2, 101)), (2, 1))
    )


def test_what_follows_the_angle_is_as_uncertain_as_it(fit):
    values = np.array([fit[name].value for name in fit.free_names])

    def refitted(angles):
        found = values.copy()
        found[0] += 3.0 * float(np.mean(np.asarray(angles["q"])[:, -1] - 10.0))  # of two logs
        return list(found)

    wide = with_errors_of_angles(fit, {"q": way(0.5)}, values, refitted)
    first, *others = fit.free_names
    added = np.sqrt(wide[first].std_error ** 2 - fit[first].std_error ** 2)
    assert added == pytest.approx(3.0 * 0.5 / np.sqrt(2.0), rel=0.5)  # as known as a dozen draws tell it
    assert wide.covariance[0, 0] == pytest.approx(fit.covariance[0, 0] + added**2)
    assert all(wide[name].std_error == fit[name].std_error for name in others)


def test_angles_that_cannot_be_smoothed_add_nothing(fit):
    assert with_errors_of_angles(fit, {}, np.zeros(len(fit.free_names)), lambda angles: []) is fit
