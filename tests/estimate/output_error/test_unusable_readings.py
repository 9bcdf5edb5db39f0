"""Fits of logs in which a sensor is dead or at the end of its range."""

import pytest

from jaxid import output_error
from tests.closed_form_rover import TRUE, clipped, dead, driven, rover


@pytest.mark.parametrize(
    ("change", "what"),
    [
        pytest.param(dead(1, 2), "W of run 1, which never changes there; W of run 2", id="dead"),
        pytest.param(clipped(0.5), "of W of run 0, at the end of its range (0.5 rad/s)", id="clipped"),
    ],
)
def test_one_bad_sensor_does_not_spoil_the_fit(change, what):
    logs, _ = driven(3, change=change)
    fit = output_error(rover(), logs)
    assert fit.trustworthy, fit.judgement.sentence
    assert all(abs(fit[name].value - value) < 4.0 * fit[name].std_error for name, value in TRUE.items())
    assert what in fit.notes[0] and "They are left out" in fit.notes[0]


def test_a_fit_that_is_doubtful_for_other_reasons_says_what_else_there_is():
    """A rover with friction that the model lacks, and a gyro that clips: left out, the readings mend only a part."""
    logs, _ = driven(3, change=lambda k, y: clipped(0.5)(k, y + [0.3, 0.0] * (y > 0.2)))
    fit = output_error(rover(), logs)
    assert not fit.trustworthy
    assert "leave these cells empty, and fit again" in fit.notes[0]


def test_a_sound_fit_is_left_alone():
    logs, _ = driven(3)
    fit = output_error(rover(), logs)
    assert fit.trustworthy and not any("tell nothing of the motion" in note for note in fit.notes)
