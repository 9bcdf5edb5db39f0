"""Logs with seconds of rows missing, in which inputs changed, on an axis in closed form."""

import numpy as np
import pytest

from jaxid import Axis, Log, LogSet, explain, output_error
from jaxid.explanation.left.holes import cut_at_holes
from tests.explanation.closed_form_axis import driven

ROBOT = Axis().with_values(M=1.0, Fv=2.0, Fc=0.0, offset=0.0).change("Fc", free=False).change("offset", free=False)


def without_rows(logs, first, last):
    """The logs without these rows of their first one."""
    log, *rest = logs
    kept = np.r_[:first, last : len(log)]
    cut = Log.from_arrays(log.name, log.time[kept], log.inputs[kept], {"v": log.output("v")[kept]}, log.channels)
    return LogSet([cut, *rest])


def recorded(law, seed):
    logs, held_out = driven(law, seed, count=4)
    return without_rows(logs, 155, 262), without_rows(held_out, 95, 203)


def of_parts(found):
    return [note for note in found.notes if note.startswith("Cut into parts")]


def test_nothing_is_missing_in_a_complete_model_whose_logs_have_holes():
    logs, held_out = recorded(lambda u: u, 3)
    fit = output_error(ROBOT, logs)
    assert fit.judgement.normalised_rms > 2.0
    found = explain(fit, logs, held_out)
    assert found.verdict == "adequate" and len(of_parts(found)) == 1
    assert "run 0" in of_parts(found)[0] and "run 3" in of_parts(found)[0]
    for name, value in (("M", 1.0), ("Fv", 2.0)):
        assert found.final[name].value == pytest.approx(value, abs=4 * found.final[name].std_error)


@pytest.mark.slow
def test_a_dead_zone_is_named_with_its_size_beside_holes():
    logs, held_out = recorded(lambda u: np.sign(u) * np.maximum(np.abs(u) - 0.6, 0.0), 5)
    found = explain(output_error(ROBOT, logs), logs, held_out)
    assert found.verdict == "named" and [effect.id for effect in found.effects] == ["actuator_dead_zone"]
    edge = found.effects[0].parameters["threshold"]
    assert len(of_parts(found)) == 1 and edge.value == pytest.approx(0.6, abs=4 * edge.std_error)


def test_an_input_that_was_held_through_a_hole_is_known():
    logs, held_out = driven(lambda u: u, 6)
    logs = without_rows(logs, 152, 158)  # within one level
    fit = output_error(ROBOT, logs)
    assert cut_at_holes(fit, logs, held_out, lambda message: None) == (fit, logs, held_out, "")


def test_a_short_part_is_left_out_and_said():
    """A hole soon after the start: one part is a log of its own."""
    logs, held_out = driven(lambda u: u, 8)
    logs = without_rows(logs, 25, 80)
    fit = output_error(ROBOT, logs)
    again, own, other, said = cut_at_holes(fit, logs, without_rows(held_out, 25, 80), lambda message: None)
    assert len(own) == len(logs) and len(own[0]) == 320 and "Parts of 1 s together are too short" in said
    assert again.judgement.normalised_rms < 1.1 < fit.judgement.normalised_rms and len(other[0]) == 320


def test_a_log_full_of_holes_stays_whole():
    logs, held_out = driven(lambda u: u, 9)
    for first in (320, 260, 200, 140, 80, 30):
        logs = without_rows(logs, first, first + 25)
    fit = output_error(ROBOT, logs)
    assert cut_at_holes(fit, logs, held_out, lambda message: None) == (fit, logs, held_out, "")
