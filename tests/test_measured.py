"""jaxid on measured logs: a fast slice of what docs/measured.md holds, measured again."""

import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.measured_sets import bam, emps, robojackets, robotrace
from jaxid import AXIS, Axis, Log, LogSet, integral_least_squares
from jaxid.cli.fit import _stretch
from jaxid.logs.intersample import between_samples

ROOT = Path(__file__).parents[1]
DATA = ROOT / "../shared/data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the measured logs are not beside this checkout")
PARAMETERS = ("M", "Fv", "Fc", "offset")


# -- the committed page and figures ------------------------------------------------------------------------------------
def test_the_page_shows_every_picture_it_has_and_no_other():
    page = (ROOT / "docs/measured.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"\]\(measured/(.+?)\)", page))
    assert shown == {path.name for path in (ROOT / "docs/measured").glob("*.png")}
    assert len(shown) == 5


# -- measured again ----------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def record():
    return emps.load(DATA / "emps", "DATA_EMPS")


@needs_data
def test_emps_control_law_is_the_published_one(record):
    assert emps.controller_error(record) < 0.3


@needs_data
def test_emps_integral_least_squares_of_the_plain_position_comes_within_half_a_percent(record):
    """`jaxid fit axis --fit emps.csv --intersample linear --windows 0.006 --method integral_least_squares`."""
    log = Log.from_arrays("record", record.t, record.gain * record.vir, {"q": record.q}, AXIS)
    logs = between_samples(LogSet([log]), "linear")
    fit = integral_least_squares(Axis(), logs, window=_stretch(logs, 0.006))
    assert emps.furthest(fit) <= 0.5
    assert _stretch(logs, "auto") is None and _stretch(logs, 0.0001) == 2


@needs_data
@pytest.mark.slow
def test_emps_force_and_position_in_windows_come_within_a_percent_of_the_published_values(record):
    fit = emps.by_command(record)
    assert fit.window is not None and fit.converged
    assert emps.furthest(fit) <= 1.0


@needs_data
def test_robotrace_preflight_names_the_disturbed_seconds():
    log = robotrace.load(DATA / "robotrace", robotrace.DISTURBED)
    (finding,) = [f for f in robotrace.preflight(log) if f.check == "disturbed"]
    times = [float(time) for time in finding.message.split("from t = ")[1].split(" s ")[0].split(",")]
    assert all(any(begin - 0.1 <= t <= end for begin, end in robotrace.STRETCHES) for t in times) and len(times) >= 2


@pytest.fixture(scope="module")
def recordings():
    return [robojackets.load(DATA / "robojackets", name) for name in robojackets.NAMES]


@needs_data
def test_robojackets_preflight_names_gyro_idle_stretches_clock_and_signs(recordings):
    checks = {log.name: {f.check for f in robojackets.findings(log)} for log in recordings}
    assert all({"dead_sensor", "idle", "clock_jitter"} <= found for found in checks.values())
    assert {name for name, found in checks.items() if "doubtful_clock" in found} >= {"excite_1", "excite_2"}
    assert "frame_flipped" in checks["excite_4_vely_4"]


@needs_data
def test_robojackets_preflight_calls_no_encoder_dead(recordings):
    dead = {f.column for log in recordings for f in robojackets.findings(log) if f.check == "dead_sensor"}
    assert dead == {"gyro_w"}


@needs_data
def test_robojackets_slope_at_steady_speed(recordings):
    slope, error, points = robojackets.steady_slope(recordings, 2.0)
    assert points > 200
    assert error < 0.03 * slope
    assert slope == pytest.approx(robojackets.BOOK_SLOPE, rel=0.04)


@needs_data
def test_bam_reads_the_known_load_and_signed_duties():
    logs = {log.name: log for log in bam.load(DATA / "bam_xl330")}
    assert len(logs) == 16 and set(bam.CHECK) <= set(logs)
    for log in logs.values():
        assert np.all(np.abs(log.inputs[:, 0]) <= 10.0)  # V; duties are signed and at most 1
        assert np.all(np.diff(log.time) > 0)
    released = logs["lift_and_drop_400"]
    assert 0 < np.mean(released.inputs[:, 1] == 0) < 1
