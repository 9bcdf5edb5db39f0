"""jaxid on measured logs: a fast slice of `benchmarks/measured.py` with its targets as assertions."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.measured_sets import bam, emps, robojackets, robotrace

DATA = Path(__file__).parents[1] / "../shared/data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured logs are not beside this checkout")


# -- EMPS --------------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def record():
    return emps.load(DATA / "emps", "DATA_EMPS")


@pytest.fixture(scope="module")
def least_squares(record):
    return emps.integral(record)


@pytest.fixture(scope="module")
def closed_loop(record, least_squares):
    return emps.closed_loop(record, least_squares)


def test_emps_control_law_is_the_published_one(record):
    assert emps.controller_error(record) < 0.3


def test_emps_integral_least_squares_within_half_a_percent(least_squares):
    assert max(map(abs, emps.deviations(least_squares).values())) <= 0.5


def test_emps_output_error_within_half_a_percent(closed_loop):
    assert closed_loop.converged
    assert max(map(abs, emps.deviations(closed_loop).values())) <= 0.5


@pytest.mark.parametrize(("name", "record_name"), [("estimation", "DATA_EMPS"), ("validation", "DATA_EMPS_PULSES")])
def test_emps_simulation_errors_are_no_larger_than_the_published_ones(closed_loop, name, record_name):
    _, errors = emps.simulation(emps.load(DATA / "emps", record_name), closed_loop)
    assert np.all(np.array(errors) <= emps.PUBLISHED_ERRORS[name])


# -- robotrace ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "recording", [r for r in robotrace.CLEAN if r.name in ("tra_A", "rot_B")], ids=lambda r: r.name
)
def test_robotrace_free_run_on_the_held_out_stretch(recording):
    log = robotrace.load(DATA / "robotrace", recording)
    fit = robotrace.identify(log, robotrace.robot(recording, ("motor_lag",)), robotrace.border(log))
    assert fit.converged
    assert robotrace.held_out_fit(log, robotrace.free_run(log, fit)) >= recording.target
    gain, _ = robotrace.quantities(fit)["speed gain"]
    # The set's rough fits: 8.52 m/s and 98.0 rad/s per unit of duty.
    assert gain == pytest.approx({"tra_A": 8.52, "rot_B": 98.0}[recording.name], rel=0.05)


def test_robotrace_disturbed_stretches_are_pointed_out():
    log = robotrace.load(DATA / "robotrace", robotrace.DISTURBED)
    *_, found = robotrace.disturbed(log, robotrace.robot(robotrace.DISTURBED, ()), rounds=2)
    for begin, end in robotrace.STRETCHES:
        assert any(a < end and b > begin for a, b in found)
    assert sum(b - a for a, b in found) < 0.15 * log.duration


# -- RoboJackets -------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def recordings():
    return [robojackets.load(DATA / "robojackets", name) for name in robojackets.NAMES]


def test_robojackets_preflight_names_gyro_idle_stretches_clock_and_signs(recordings):
    checks = {log.name: {f.check for f in robojackets.findings(log)} for log in recordings}
    assert all({"dead_sensor", "idle", "clock_jitter"} <= found for found in checks.values())
    assert {name for name, found in checks.items() if "doubtful_clock" in found} >= {"excite_1", "excite_2"}
    assert "frame_flipped" in checks["excite_4_vely_4"]


def test_robojackets_back_emf_slope_within_four_percent(recordings):
    fit = robojackets.identify([piece for log in recordings for piece in robojackets.driven(log)])
    assert fit.converged
    assert fit["back_emf"].value == pytest.approx(robojackets.BOOK_SLOPE, rel=0.04)
    assert fit["kappa"].value < -0.5  # all wheel signs opposite to the documented geometry


# -- BAM ---------------------------------------------------------------------------------------------------------------
def test_bam_inertia_and_motor_constant_against_the_known_load():
    logs = {log.name: log for log in bam.load(DATA / "bam_xl330")}
    chosen = ("sin_sin_400", "sin_time_square_800", "lift_and_drop_800", "up_and_down_400")
    model = bam.ladder()["load-dependent"]
    fit = bam.identify(model, [logs[name] for name in chosen])
    assert fit.converged
    armatures = [p["armature"] for p in bam.published(DATA / "bam_xl330").values()]
    arm = bam.MASS * bam.LENGTH**2
    assert 0.95 * (arm + min(armatures)) <= fit["J"].value <= 1.05 * (arm + max(armatures))
    assert 0.30 <= fit["kt"].value <= 0.44
    scores = bam.errors(fit, [logs["sin_sin_200"], logs["sin_time_square_400"]])
    assert min(score for _, score in scores.values()) > 80.0
