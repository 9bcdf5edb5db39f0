"""What is said of a search that ended where it began, or on a bound."""

from dataclasses import replace

import pytest

from jaxid import Axis
from jaxid.estimate.judgement import Judgement
from jaxid.estimate.output_error.went_nowhere import with_search
from tests.report.test_comparison import fit_of

START = {"M": 1.0, "Fv": 2.0, "Fc": 0.5, "offset": 0.0}
FAILED = Judgement("failed", 30.0, {"v": 30.0}, False, ("The model does not follow v.",))


@pytest.fixture
def still():
    return fit_of("output_error", Axis().with_values(**START))


def test_a_failed_fit_that_is_its_start_has_not_converged(still):
    fit, judgement = with_search(still, FAILED, START)
    assert not fit.converged and "never left its start" in fit.reason
    assert "never left its start" in judgement.sentence and judgement.verdict == "failed"
    fit, judgement = with_search(still, FAILED, START | {"Fc": 0.4})
    assert fit.converged and judgement == FAILED


def test_a_good_fit_from_its_own_optimum_is_left_alone(still):
    sound = Judgement("sound", 1.0, {"v": 1.0}, True)
    assert with_search(still, sound, START) == (still, sound)


def test_a_bound_on_which_a_poor_fit_ended_is_named(still):
    held = replace(still, parameters=still.parameters | {"Fc": replace(still["Fc"], status="at_bound", value=0.0)})
    poor = replace(FAILED, verdict="poor")
    assert "on the bound of Fc (0)" in with_search(held, poor, START)[1].sentence
