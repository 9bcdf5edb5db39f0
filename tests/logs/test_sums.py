"""jaxid/logs/sums.py: a robot's speeds from those of its wheels, or from their encoders."""

import numpy as np
import pandas as pd
import pytest

from jaxid import read_logs
from jaxid.logs import LogError
from tests.recordings import Ros, ns

TIMES = np.round(np.arange(200) * 0.02, 6)
RADIUS, HALF_TRACK = 0.09, 0.21
SPEED, RATE = 0.5 * np.sin(TIMES), 0.8 * np.cos(1.3 * TIMES)
RIGHT, LEFT = ((SPEED + side * HALF_TRACK * RATE) / RADIUS for side in (1, -1))


def mapping(right, left, rate=""):
    forward, turning = RADIUS / 2, RADIUS / (2 * HALF_TRACK)
    more = {"derivative": True} if rate else {}
    return {
        "u_right": "/volts.data[0]",
        "u_left": "/volts.data[1]",
        "v": {"fields": {right: forward, left: forward}, **more},
        "w": {"fields": {right: turning, left: -turning}, **more},
    }


@pytest.fixture
def ros():
    pytest.importorskip("rosbags", reason="bags are written and read by rosbags")
    return Ros()


def bag(ros, folder, **topics):
    return ros.write(folder, {"/volts": [(ns(t), ros.numbers([t % 3, t % 2])) for t in TIMES], **topics})


def test_joints_in_changing_order_give_the_bodys_speeds(ros, tmp_path):
    joints = []
    for k, t in enumerate(TIMES):
        names, speeds = ["drive_l", "drive_r"], [LEFT[k], RIGHT[k]]
        joints.append((ns(t), ros.joints(ns(t), names[:: 1 - 2 * (k % 2)], speeds[:: 1 - 2 * (k % 2)])))
    path = bag(ros, tmp_path / "run", **{"/joints": joints})
    log = read_logs(path, "differential", mapping=mapping("/joints.velocity[drive_r]", "/joints.velocity[drive_l]"))[0]
    np.testing.assert_allclose(log.output("v"), SPEED, atol=1e-12)
    np.testing.assert_allclose(log.output("w"), RATE, atol=1e-12)
    assert not [finding for finding in log.findings if finding.check == "interpolated"]


def test_encoders_that_run_over_and_tick_apart(ros, tmp_path):
    """Counters of 16 bits on topics of their own, the left one 3 ms later: a step is 0.2 mm, over 40 ms no 3 mm/s."""
    counts = 2000 / (2 * np.pi)
    ways = [np.concatenate([[0], np.cumsum((w[1:] + w[:-1]) / 2 * 0.02)]) for w in (RIGHT, LEFT)]
    ticks = [np.round(30000 + counts * 20 * way) for way in ways]
    wrapped = [(tick + 32768) % 65536 - 32768 for tick in ticks]
    assert all(np.max(np.abs(np.diff(wrap))) > 60000 for wrap in wrapped)
    topics = {
        "/enc_r": [(ns(t), ros.number(wrapped[0][k])) for k, t in enumerate(TIMES)],
        "/enc_l": [(ns(t + 0.003), ros.number(wrapped[1][k])) for k, t in enumerate(TIMES)],
    }
    own = mapping("/enc_r.data", "/enc_l.data", "derivative")
    for name in ("v", "w"):
        own[name]["scale"] = 1 / (20 * counts)
    log = read_logs(bag(ros, tmp_path / "run", **topics), "differential", mapping=own)[0]
    there = np.isfinite(log.output("v"))
    # The left wheel was first seen at 3 ms, so that sums begin at 20 ms, and central differences at 40.
    expected = 0.5 * np.sin(log.time[there] + 0.04)
    assert there.sum() == 197 and np.max(np.abs(log.output("v")[there] - expected)) < 0.003
    assert {"interpolated", "differentiated"} <= {finding.check for finding in log.findings}


def test_columns_of_a_table_are_summed_alike(tmp_path):
    path = tmp_path / "run.csv"
    pd.DataFrame(
        {"t": TIMES, "u_right": TIMES % 3, "u_left": TIMES % 2, "wr": RIGHT, "wl": LEFT, "wheels": 1.0}
    ).to_csv(path, index=False)
    own = {name: entry for name, entry in mapping("wr", "wl").items() if name in "vw"}
    log = read_logs(path, "differential", mapping=own)[0]
    np.testing.assert_allclose(log.output("w"), RATE, atol=1e-12)
    with pytest.raises(LogError, match="no column 'wheel'.*close: 'wheels'"):
        read_logs(path, "differential", mapping={**own, "v": {"fields": {"wheel": 1.0, "wl": 1.0}}})


@pytest.mark.parametrize("weights", [{}, {"wr": 0.0}, {"wr": "?"}, ["wr", "wl"], {"wr": float("nan")}])
def test_weights_that_are_none(tmp_path, weights):
    with pytest.raises(LogError, match="give the fields with their weights"):
        read_logs(tmp_path / "none.csv", "differential", mapping={"v": {"fields": weights}})
