"""Pre-flight on measured logs whose faults are documented (shared/data, beside the checkout)."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jaxid.checks.preflight import preflight
from jaxid.logs import Channels, Log, LogError, read_logs

DATA = Path(__file__).parents[2] / "../shared/data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured logs are not beside this checkout")

# RoboJackets: published geometry (wheel axis angles, radius, distance) and the rows' scaling.
ANGLES, RADIUS, DISTANCE = np.deg2rad([30, 150, 219, 321]), 0.0285623, 0.0798576
WHEELS = np.stack([-np.sin(ANGLES), np.cos(ANGLES), np.full(4, DISTANCE)], axis=1) / RADIUS
NAMES = ["excite_1", "excite_2", "excite_3_vely", "excite_4_vely_4"]


def _robojackets(name, signs=(1, 1, 1, 1)):
    lines = (DATA / "robojackets" / name).read_text().splitlines()
    rows = [line.split(",") for line in lines if line.count(",") == 9]
    table = pd.DataFrame(rows).apply(pd.to_numeric, errors="coerce").dropna().to_numpy(float)
    interval = table[:, 8] / 18.432e6 * 2 * 128
    speeds = table[:, :4] * 2 * np.pi / (2048 * 3) / interval[:, None]
    body = np.linalg.lstsq(WHEELS, speeds.T, rcond=None)[0].T
    volts = table[:, 4:8] * 19 / 512 * signs
    mixing = {name: tuple(WHEELS[:, k]) for k, name in enumerate(("V", "Vn", "W"))}
    channels = Channels(
        ("u1", "u2", "u3", "u4"), ("V", "Vn", "W"), units={"V": "m/s", "Vn": "m/s", "W": "rad/s"}, mixing=mixing
    )
    time = np.concatenate([[0.0], np.cumsum(interval[:-1])])
    return Log.from_arrays(name, time, volts, body, channels, {"gyro_w": table[:, 9]})


@pytest.mark.parametrize("name", NAMES)
def test_robojackets_dead_gyro_idle_stretches_and_uneven_clock(name):
    log = _robojackets(name)
    findings = preflight(log, also=["gyro_w"])
    assert [f.column for f in findings if f.check == "dead_sensor"] == ["gyro_w"]
    checks = {f.check for f in findings}
    assert {"idle", "clock_jitter"} <= checks
    assert not {"sign_flipped", "swapped"} & checks  # duties and encoders do agree


def test_robojackets_accelerations_make_the_clock_doubtful():
    """31 m/s^2 if rows were contiguous; the third recording is the gentle one."""
    doubtful = [name for name in NAMES if any(f.check == "doubtful_clock" for f in preflight(_robojackets(name)))]
    assert doubtful == ["excite_1", "excite_2", "excite_4_vely_4"]


def test_robojackets_wheel_signs_are_opposite_to_the_documented_geometry():
    """Only the turning terms show it, and only the last recording turns and drives at once: README, -0.73 to -0.97."""
    (found,) = [f for f in preflight(_robojackets("excite_4_vely_4")) if f.check == "frame_flipped"]
    assert -1.1 < float(found.message.split("comes out at ")[1].split()[0]) < -0.6


@pytest.mark.parametrize("flipped", range(4))
def test_robojackets_a_flipped_wheel_is_named(flipped):
    signs = np.where(np.arange(4) == flipped, -1, 1)
    findings = [f for f in preflight(_robojackets("excite_1", signs)) if f.check in ("sign_flipped", "swapped")]
    assert any(f"input 'u{flipped + 1}' has the opposite sign" in f.message for f in findings)


def _robotrace(name, kind, unit, sign=1.0):
    folder = DATA / "robotrace"
    duty, speed = (np.loadtxt(folder / f"{name}_{part}.txt") for part in ("input", kind))
    channels = Channels(("duty",), ("speed",), units={"speed": unit}, mixing={"speed": (1,)})
    return Log.from_arrays(name, 0.001 * np.arange(len(duty)), duty, sign * speed, channels)


def test_robotrace_disturbed_stretches_are_found_where_they_are():
    """tra_B: 2.1-3.1 s and 5.1-6.1 s fit 43-47 %, the rest 79-95 %. The others have none."""
    (found,) = [f for f in preflight(_robotrace("tra_B_fan", "velocity", "m/s")) if f.check == "disturbed"]
    times = [float(time) for time in found.message.split("from t = ")[1].split(" s ")[0].split(",")]
    assert {int(time) for time in times} >= {2, 5} and all(2 <= t <= 3.1 or 5 <= t <= 6.1 for t in times)
    for name, kind in (("tra_A", "velocity"), ("tra_C_fan", "velocity"), ("rot_A", "gyro"), ("rot_B", "gyro")):
        assert "disturbed" not in {f.check for f in preflight(_robotrace(name, kind, "m/s"))}


@pytest.mark.parametrize("name", ["rot_A", "rot_B"])
def test_robotrace_turning_logs_are_clean_and_a_flipped_gyro_is_not(name):
    assert not [f for f in preflight(_robotrace(name, "gyro", "rad/s")) if f.severity != "note"]
    found = [f for f in preflight(_robotrace(name, "gyro", "rad/s", sign=-1.0)) if f.severity != "note"]
    assert [f.check for f in found] == ["sign_flipped"]


UDEA = Channels(("u1", "u2", "u3"), ("w1", "w2", "w3"), mixing={f"w{k + 1}": tuple(np.eye(3)[k]) for k in range(3)})


def test_udea_frozen_heading_spikes_and_repeated_stamps():
    with pytest.raises(LogError, match="exp10.txt.*'t' repeats the previous time at sample 84"):
        read_logs(DATA / "udea_omni3/raw/exp10.txt", UDEA)
    logs = read_logs(DATA / "udea_omni3/raw/exp*.txt", UDEA, mapping={"t": {"interval": 0.01}})
    assert len(logs) == 10
    frozen, spiky = set(), set()
    for log in logs:
        checks = {f.check for f in preflight(log, also=["alpha"]) if f.column == "alpha"}
        if checks & {"frozen_sensor"}:
            frozen.add(log.name)
        if any(f.check == "spike" for f in preflight(log)):
            spiky.add(log.name)
    assert frozen == {f"exp{k}.txt" for k in range(5, 11)}  # README: the heading freezes in exp5 to exp10
    assert len(spiky) >= 8  # README: heavy-tailed encoders, spikes to 380 rad/s
