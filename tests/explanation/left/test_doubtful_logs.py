"""What pre-flight doubts in the logs is said beside what is missing: stamps that jitter, on an axis in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from jaxid import AXIS, Axis, Log, LogSet, explain, output_error
from jaxid.checks.in_words import doubtful_units
from jaxid.explanation.left.doubtful_logs import doubtful_logs
from jaxid.logs import Finding

SAMPLES, DT = 600, 0.02


def recorded(axis_law, jitter, count=4):
    """The same motion, sampled regularly and stamped by a clock whose intervals are up to `jitter` seconds wrong."""
    logs = []
    for k in range(count):
        rng = np.random.default_rng([3, k])
        u = np.repeat(rng.uniform(-4, 4, SAMPLES // 10), 10)
        time = np.cumsum(DT + rng.uniform(-jitter, jitter, SAMPLES))
        outputs = {"v": axis_law(u, DT)[0] + 0.003 * rng.normal(size=SAMPLES)}
        logs.append(Log.from_arrays(f"run {k}", time - time[0], u[:, None], outputs, AXIS))
    return LogSet(logs[: count - 1]), LogSet(logs[count - 1 :])


@pytest.mark.slow
def test_a_clock_that_jitters_is_said_beside_what_has_no_name(axis_law):
    logs, held_out = recorded(axis_law, 0.007)
    found = explain(output_error(Axis(), logs), logs, held_out)
    assert found.verdict == "unexplained"
    (said,) = [note for note in found.notes if note.startswith("Pre-flight doubts")]
    assert "sampling intervals differ" in said and "in 4 of 4 logs" in said


def test_logs_without_doubts_say_nothing(axis_law):
    assert doubtful_logs(*recorded(axis_law, 0.0)) == ""


def test_commands_on_the_recorders_clock_are_told_though_nothing_else_doubts_them(axis_law):
    logs, held_out = recorded(axis_law, 0.0)
    text = "run 0: /volts has no stamps of its own (for u), so that the recorder's count there."
    note = Finding("run 0", "u", None, "note", "receive_stamps", text)
    logs = LogSet([replace(log, findings=(note,)) if log.name == "run 0" else log for log in logs])
    assert "/volts has no stamps" in doubtful_logs(logs, held_out)


def test_units_that_no_robot_has_are_said_though_the_model_follows_them(axis_law):
    logs, held_out = recorded(axis_law, 0.0)
    assert doubtful_units(logs, held_out) == ""
    slow = [LogSet([replace(log, time=1e3 * log.time) for log in own]) for own in (logs, held_out)]
    said = doubtful_units(*slow)
    assert said.startswith("Pre-flight doubts the units of these logs") and "(in 4 of 4 logs)" in said
    assert "a sampling interval of 20 s" in said and doubtful_units(slow[0], None)
