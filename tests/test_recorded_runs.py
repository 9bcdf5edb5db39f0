"""A robot's own recording, end to end: bags of an independent simulator's runs, read, fitted, held against the truth.

Every channel has a clock of its own: commands come when they change, odometry at 50 Hz, the gyro at 200 Hz.
"""

import numpy as np
import pytest

import jaxid
from tests.recordings import Ros, ns

pytest.importorskip("rosbags", reason="bags are written and read by rosbags")
pytest.importorskip("numba", reason="the independent simulator needs numba")

STEP = 0.005
"""Interval at which the simulator tells its state [s]; commands change at its multiples, which are no odometry's."""
SPEED_NOISE, RATE_NOISE = 0.01, 0.02  # m/s, rad/s


def commands(count, seconds, seed):
    """[n, count] V: a straight start, then levels held for 0.2 to 0.7 s, and the rows at which they change."""
    rng = np.random.default_rng(seed)
    n = round(seconds / STEP) + 1
    volts, changes, k = np.zeros((n, count)), [0], 240
    volts[:k] = 4.0 if count == 2 else np.array([-3.0, 3.0, 3.0, -3.0])[:count]
    while k < n:
        volts[k:] = rng.choice([-8.0, -5.0, -3.0, 3.0, 5.0, 8.0], count)
        changes.append(k)
        k += int(rng.integers(41, 140))
    return volts, changes


def recorded(robot, place, seed, seconds=10.0):
    """A bag of one run of the reference `robot`: odometry every 20 ms, gyro every 5 ms and 2 ms later, pose every 100 ms."""
    from reference.logs import simulate

    volts, changes = commands(len(robot.inputs), seconds, seed)
    run = simulate(robot, volts, STEP)
    rng = np.random.default_rng(seed + 1000)
    ros, pose = Ros(), run.states
    speeds, rate = run.speeds[:, :-1], run.speeds[:, -1]
    seen = speeds + SPEED_NOISE * rng.normal(size=speeds.shape)
    turning = rate + RATE_NOISE * rng.normal(size=rate.shape)
    times = [ns(t) for t in run.t]
    odometry = []
    for k in range(0, len(times), 4):
        message = ros.odometry(times[k], seen[k, 0], 0.0, *pose[k, :2])
        message.twist.twist.linear.y = float(seen[k, 1]) if seen.shape[1] > 1 else 0.0
        odometry.append((times[k] + 1_500_000 + int(rng.integers(0, 800_000)), message))
    topics = {
        "/motor_volts": [(times[k], ros.numbers(volts[k])) for k in changes],
        "/odom": odometry,
        "/imu/data": [(times[k] + 700_000, ros.imu(times[k], turning[k])) for k in range(len(times))],
        "/tf": [
            (times[k], ros.transforms(ros.transform(times[k], "odom", "base_link", *pose[k, :2], 0.0)))
            for k in range(0, len(times), 20)
        ],
    }
    return ros.write(place, topics)


@pytest.mark.parametrize("name", ["pioneer", "omni"])
def test_a_bags_channels_with_clocks_of_their_own_give_the_robots_parameters(name, tmp_path, demo_truth):
    from reference.omni import OMNI
    from reference.pioneer import PIONEER

    truth = demo_truth(name)
    reference = PIONEER if name == "pioneer" else OMNI
    mapping = {"eta1": "/odom.twist.twist.linear.x", "eta2": "/imu/data.angular_velocity.z"}
    if name == "omni":
        mapping = {"V": mapping["eta1"], "Vn": "/odom.twist.twist.linear.y", "W": mapping["eta2"]}
    mapping |= {channel: f"/motor_volts.data[{k}]" for k, channel in enumerate(reference.inputs)}
    for seed in (1, 2):
        recorded(reference, tmp_path / f"run{seed}", seed)
    logs = jaxid.read_logs(tmp_path / "run*", name, mapping=mapping)
    assert not [finding for finding in logs.preflight() if finding.severity != "note"]
    fit = jaxid.output_error(jaxid.Pioneer() if name == "pioneer" else jaxid.Omni(), logs)
    assert fit.converged and fit.trustworthy, fit.judgement
    far = {n: (fit[n].value - truth[n]) / fit[n].std_error for n in fit.free_names if fit[n].status == "identified"}
    assert len(far) >= 7 and max(map(abs, far.values())) < 4.0, far
