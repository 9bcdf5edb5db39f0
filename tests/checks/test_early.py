"""jaxid/checks/early.py: rows that hold a command beside what came of it, against rows as they should be.

A base that follows commanded speeds with a first-order lag, discretised exactly.
"""

from pathlib import Path

import numpy as np
import pytest

from jaxid.checks.motion import even
from jaxid.checks.preflight import preflight
from jaxid.logs import DIFFERENTIAL, Log, read_logs

DATA = Path(__file__).parents[2] / "jaxid/demo_logs"
HALF_TRACK = 0.2


def _log(kind, interval, lag, *, ahead, seed=0, sign=1.0, n=1000):
    random = np.random.default_rng(seed)
    if kind == "steps":
        body = np.repeat(random.uniform([-0.5, -1.0], [0.8, 1.0], (n // 20, 2)), 20, axis=0)
    elif kind == "ramps":
        at, corners = np.arange(0, n + 50, 50), random.uniform([-0.5, -1.0], [0.8, 1.0], (21, 2))
        body = np.stack([np.interp(np.arange(n), at, column) for column in corners.T], axis=1)
    else:
        body = np.sin(np.outer(interval * np.arange(n), [0.7, 0.5])) * [0.5, 1.0]
    body[:10] = 0.0
    speeds, x = np.zeros((n + 1, 2)), np.zeros(2)
    for k, wanted in enumerate(body):
        speeds[k + 1] = x = wanted + (x - wanted) * np.exp(-interval / lag)
    measured = (speeds[1:] if ahead else speeds[:-1]) * [1.0, sign] + random.normal(size=(n, 2)) * 0.005
    sides = body @ np.array([[1.0, 1.0], [HALF_TRACK, -HALF_TRACK]])
    return Log.from_arrays("base", interval * np.arange(n), sides, measured, DIFFERENTIAL)


def _found(log, *checks):
    return {(f.check, f.column) for f in preflight(log) if f.check in checks}


@pytest.mark.parametrize(("interval", "lag"), [(0.02, 0.001), (0.02, 0.1), (0.1, 0.05), (0.1, 0.3)])
def test_rows_of_a_command_and_its_answer_are_named_and_no_wrong_sign(interval, lag):
    for kind in ("steps", "ramps", "sines"):
        log = _log(kind, interval, lag, ahead=True)
        assert not _found(log, "sign_flipped", "swapped", "coarse_sampling"), kind
        if kind == "steps":
            assert _found(log, "ahead_of_input") == {("ahead_of_input", "v"), ("ahead_of_input", "w")}
    message = next(
        f.message for f in preflight(_log("steps", interval, lag, ahead=True)) if f.check == "ahead_of_input"
    )
    assert "move what was measured one row down" in message


@pytest.mark.parametrize(("interval", "lag"), [(0.02, 0.001), (0.02, 0.1), (0.1, 0.05), (0.1, 0.3)])
def test_rows_in_order_raise_no_alarm_and_a_wrong_sign_is_found(interval, lag):
    for kind in ("steps", "ramps", "sines"):
        for seed in range(5):
            assert not _found(
                _log(kind, interval, lag, ahead=False, seed=seed), "ahead_of_input", "sign_flipped", "swapped"
            )
        for ahead in (False, True):
            wrong = _found(_log(kind, interval, lag, ahead=ahead, sign=-1.0), "sign_flipped", "swapped")
            assert wrong, (kind, ahead)


@pytest.mark.parametrize("robot", ["pioneer", "omni"])
def test_the_shipped_logs_are_in_order(robot):
    for log in read_logs(sorted((DATA / robot).glob("*.csv")), robot):
        assert not _found(log, "ahead_of_input")


def test_a_long_log_is_looked_at_row_by_row():
    """Of every fifth row alone the motion is beside the command that it came from."""
    assert not _found(_log("steps", 0.01, 0.03, ahead=False, n=100_000), "ahead_of_input", "sign_flipped", "exchanged")
    idle_first = _log("steps", 0.01, 0.05, ahead=True, n=20_000)
    still = np.zeros((20_000, 2))
    inputs = np.concatenate([still, idle_first.inputs])
    outputs = np.concatenate([still, np.stack([idle_first.output(name) for name in ("v", "w")], axis=1)])
    log = Log.from_arrays("base", 0.01 * np.arange(len(inputs)), inputs, outputs, DIFFERENTIAL)
    assert _found(log, "ahead_of_input") == {("ahead_of_input", "v"), ("ahead_of_input", "w")}


def test_a_clock_that_was_set_anew_fills_no_memory():
    """Fifty years between two samples would be 10^11 rows at even intervals."""
    log = _log("steps", 0.02, 0.1, ahead=False)
    outputs = np.stack([log.output(name) for name in ("v", "w")], axis=1)
    time = log.time + np.where(np.arange(len(log)) < 500, 0.0, 1.6e9)
    rows = even(Log.from_arrays("base", time, log.inputs, outputs, DIFFERENTIAL))
    assert len(rows.rows) <= 100_001 and rows.rows[0] == 0 and rows.rows[-1] == len(log) - 1
