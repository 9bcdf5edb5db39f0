"""Explanations of logs in which a sensor is dead or at the end of its range."""

import numpy as np
import pytest

from jaxid import explain, output_error
from tests.closed_form_rover import clipped, dead, driven, rover


def test_a_sensor_that_clips_is_no_missing_effect():
    logs, held_out = driven(5, change=clipped(0.5))
    story = explain(output_error(rover(), logs), logs, held_out)
    assert story.verdict == "adequate" and not story.effects
    assert any("at the end of its range (0.5 rad/s)" in note for note in story.notes)


@pytest.mark.slow
def test_a_sensor_that_is_dead_in_some_logs_hides_no_effect():
    """A sensor that reads 10 % too much forwards, beside a gyro that is dead in a fitted and in a held-out log."""

    def change(k, y):
        return dead(1, 4)(k, y * [1.1, 1.0] * (y > 0) + y * (y <= 0))

    logs, held_out = driven(6, change=change)
    story = explain(output_error(rover(), logs), logs, held_out)
    assert any("W of run 1, which never changes there" in note for note in story.notes)
    assert story.after.normalised_rms < 1.1 < story.before.normalised_rms
    assert np.isfinite(story.before.normalised_rms) and story.verdict in ("named", "ambiguous")


def test_logs_without_such_readings_are_explained_as_they_are():
    logs, held_out = driven(7)
    story = explain(output_error(rover(), logs), logs, held_out)
    assert story.verdict == "adequate" and not any("Left out" in note for note in story.notes)
