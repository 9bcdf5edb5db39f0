"""jaxid/logs/recorded.py: from a bag and a mapping to a log, and what is said where that does not go."""

import numpy as np
import pytest

from jaxid import LogError, LogWarning, read_logs
from jaxid.logs import PIONEER
from tests.recordings import Ros, ns, write_wpilog

pytest.importorskip("rosbags", reason="bags are written and read by rosbags")

TIMES = np.round(np.arange(100) * 0.02, 6)
MAP = {"u": "/volts.data", "v": "/joint_states.velocity[wheel]"}


@pytest.fixture
def written(tmp_path):
    """`written(**topics)`: a bag of an axis whose wheel's speed is k; messages in `topics` replace its own."""
    ros = Ros()
    own = {
        "/volts": [(ns(t), ros.number(k % 7)) for k, t in enumerate(TIMES)],
        "/joint_states": [
            (ns(t) + 2_000_000, ros.joints(ns(t), ["wheel"], [k], [2.0 * k])) for k, t in enumerate(TIMES)
        ],
    }

    def write(storage="mcap", **topics):
        place = tmp_path / "run"
        return ros.write(place, own | {f"/{name}": messages for name, messages in topics.items()}, storage)

    write.ros = ros
    return write


def test_fields_become_channels_in_the_robots_units(written):
    mapping = MAP | {"v": {"field": "/joint_states.velocity[wheel]", "scale": -0.1, "offset": 1.0}}
    log = read_logs(written(), "axis", mapping=mapping)[0]
    np.testing.assert_allclose(log.time, TIMES, atol=1e-12)
    np.testing.assert_array_equal(log.input("u"), np.arange(100) % 7)
    np.testing.assert_allclose(log.output("v"), 1.0 - 0.1 * np.arange(100))
    (told,) = log.findings
    assert told.check == "receive_stamps" and "which it had 2 ms later" in told.message and "one clock" in told.message


def test_a_folder_is_one_log_and_patterns_find_it(written, tmp_path):
    whole = read_logs(written().parent, "axis", mapping=MAP)[0]
    assert whole.name == "run"
    assert len(read_logs(tmp_path / "r*", "axis", mapping=MAP)[0]) == len(whole)


def test_the_recorders_clock_on_demand(written):
    """The wheel then comes 2 ms after the commands, by which it is shifted: every row is between two others."""
    log = read_logs(written(), "axis", mapping=MAP | {"t": {"stamp": "receive"}})[0]
    there = np.isfinite(log.output("v"))
    np.testing.assert_allclose(log.time[there], TIMES, atol=1e-9)
    np.testing.assert_allclose(log.time[~there][0], 0.018, atol=1e-9)
    assert "several_clocks" in [finding.check for finding in log.findings]


def test_a_speed_from_positions_says_what_it_costs(written):
    """An encoder of 0.25 rad a step: central differences over 0.04 s, exact for what runs evenly."""
    ros = written.ros
    angle = np.floor(10.0 * TIMES / 0.25) * 0.25
    joints = [(ns(t), ros.joints(ns(t), ["wheel"], (), [a])) for t, a in zip(TIMES, angle, strict=True)]
    mapping = MAP | {"v": {"field": "/joint_states.position[wheel]", "derivative": True}}
    log = read_logs(written(joint_states=joints), "axis", mapping=mapping)[0]
    np.testing.assert_allclose(log.output("v"), (angle[2:] - angle[:-2]) / 0.04, rtol=1e-9)
    assert abs(np.mean(log.output("v")) - 10.0) < 0.25 / 0.04 / 49
    (said,) = [f.message for f in log.findings if f.check == "differentiated"]
    assert "steps of 0.25 become noise of 2.55" in said  # 0.25 / sqrt(6) / 0.04


def test_a_heading_that_jumps_by_a_turn_is_unwrapped_before_it_is_differentiated(written):
    ros = written.ros
    heading = (5.0 * TIMES + np.pi) % (2 * np.pi) - np.pi
    angles = [(ns(t), ros.number(a)) for t, a in zip(TIMES, heading, strict=True)]
    log = read_logs(
        written(heading=angles), "axis", mapping=MAP | {"v": {"field": "/heading.data", "derivative": True}}
    )[0]
    np.testing.assert_allclose(log.output("v"), 5.0, rtol=1e-6)


def test_positions_stand_in_for_speeds_where_the_robot_measures_them(written):
    log = read_logs(written(), "axis", mapping={"u": "/volts.data", "q": "/joint_states.position[wheel]"})[0]
    assert log.measured == ("q",)


def test_a_pose_says_where_the_run_starts(written):
    ros = written.ros
    odometry = [(ns(t + 0.03), ros.odometry(ns(t + 0.03), 0, 0, 3.0 + t, 4.0, 1.5)) for t in TIMES]
    mapping = MAP | {"x": "/odom.pose.pose.position.x", "theta": "/odom.pose.pose.orientation.yaw"}
    log = read_logs(written(odom=odometry), "axis", mapping=mapping)[0]
    assert (log.extra["x"][0], log.extra["theta"][0]) == pytest.approx((3.0, 1.5))
    assert "the 'x' that was measured 0.03 s after" in str([f.message for f in log.findings])


def test_other_data_logs_need_no_mapping_where_names_are_the_robots(tmp_path):
    pytest.importorskip("wpiutil", reason="data logs are written by robotpy-wpiutil")
    entries = {
        "u": [(t + 1, float(k)) for k, t in enumerate(TIMES)],
        "v": [(t + 1, 2.0 * k) for k, t in enumerate(TIMES)],
    }
    log = read_logs(write_wpilog(tmp_path / "run.wpilog", entries), "axis")[0]
    np.testing.assert_array_equal(log.output("v"), 2.0 * np.arange(100))


def faults(ros):
    """What stands in the bag beside the sound topics, or in their place; the mapping; what is said."""
    odd = [(ns(t), ros.joints(ns(0.1 if k == 50 else t), ["wheel"], [k])) for k, t in enumerate(TIMES)]
    twice = [(ns(t), ros.joints(ns(TIMES[k - (k == 9)]), ["wheel"], [k])) for k, t in enumerate(TIMES)]
    again = [(ns(t), ros.joints(ns(TIMES[k - (k == 9)]), ["wheel"], [k - (k == 9)])) for k, t in enumerate(TIMES)]
    sim = [(ns(t), ros.joints(round(t * 1e9) + 1, ["wheel"], [k])) for k, t in enumerate(TIMES)]
    broken = [(ns(t), ros.number(np.nan if k == 3 else k)) for k, t in enumerate(TIMES)]
    lost = [(ns(t), ros.joints(ns(t), ["wheel"], [np.nan])) for t in TIMES]
    growing = [(ns(t), ros.numbers([1.0] * (1 + k % 2))) for k, t in enumerate(TIMES)]
    return {
        "no mapping": ({}, {}, r"nothing says which field is 'u'; map it.*jaxid look"),
        "half a mapping": ({}, {"u": "/volts.data"}, "nothing says which field is 'v'"),
        "field": (
            {},
            MAP | {"v": "/joint_states.velocity[whel]"},
            r"no field .*\(close: '/joint_states.velocity\[wheel\]",
        ),
        "topic": (
            {},
            MAP | {"v": "/joint_state.velocity[wheel]"},
            r"no topic '/joint_state' \(close: '/joint_states'\)",
        ),
        "no messages": ({"silent": "std_msgs/msg/Float64"}, MAP | {"u": "/silent.data"}, "'/silent' .*has no messages"),
        "text": ({"words": [(ns(0), ros.text("a"))]}, MAP | {"u": "/words.data"}, "'/words' .*has no numbers"),
        "backwards": ({"joint_states": odd}, MAP, "message 50 of topic '/joint_states'.*earlier.*receive"),
        "repeats": ({"joint_states": twice}, MAP, "message 9 of topic '/joint_states'.*repeats the stamp.*receive"),
        "repeats itself": ({"joint_states": again}, MAP, ""),
        "simulation's clock": ({"joint_states": sim}, MAP, "'/joint_states' has stamps .* from the recorder.*receive"),
        "command that is none": ({"volts": broken}, MAP, "'/volts.data' .input 'u'. is nan in message 3; cut"),
        "sensor that is none": (
            {"joint_states": lost},
            MAP,
            "'/joint_states.velocity.wheel.' .* holds no usable number",
        ),
        "array that grows": ({"volts": growing}, MAP | {"u": "/volts.data[1]"}, "changes its length"),
        "one field for two": ({}, MAP | {"q": MAP["v"]}, "stands for both 'v' and 'q'"),
        "interval": ({}, MAP | {"t": {"interval": 0.02}}, "stamps of its own"),
        "stamp": ({}, MAP | {"t": {"stamp": "sender"}}, "stamp = 'sender'; use 'header' or 'receive'"),
        "two names": ({}, MAP | {"u": {"field": "a", "column": "b"}}, "a column and a field"),
    }


@pytest.mark.parametrize("name", list(faults(Ros())))
def test_faults_are_one_sentence_with_file_topic_and_remedy(written, name):
    topics, mapping, says = faults(written.ros)[name]
    file = written(**topics)
    if not says:
        log = read_logs(file, "axis", mapping=mapping)[0]
        assert (
            "repeat the one before" in str([f.message for f in log.findings])
            and np.isfinite(log.output("v")).sum() == 99
        )
        return
    with pytest.raises(LogError, match=says) as error:
        read_logs(file, "axis", mapping=mapping)
    said = str(error.value)
    assert "\n" not in said and said.endswith(".") and (file.name in said or "mapping" in said)


def test_clocks_that_differ_are_a_warning(written):
    """The commands carry no stamp; the wheel's clock is 0.3 s behind."""
    ros = written.ros
    late = [(ns(t + 0.3), ros.joints(ns(t), ["wheel"], [k])) for k, t in enumerate(TIMES)]
    log = read_logs(written(joint_states=late), "axis", mapping=MAP)[0]
    (said,) = [f.message for f in log.findings if f.check == "clocks_apart"]
    assert "'/joint_states' usually arrive 300 ms after" in said


def test_tables_take_the_same_mapping(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("t,u,p\n" + "".join(f"{0.1 * k:.1f},1,{k * k}\n" for k in range(30)))
    log = read_logs(path, "axis", mapping={"v": {"field": "p", "derivative": True}})[0]
    np.testing.assert_allclose(log.output("v")[1:-1], 20.0 * np.arange(1, 29), rtol=1e-9)
    assert np.isnan(log.output("v")[[0, -1]]).all() and log.findings[0].check == "differentiated"
    with pytest.raises(LogError, match="table with one clock"):
        read_logs(path, "axis", mapping={"t": {"stamp": "header"}, "v": "p"})


def test_a_sensor_is_looked_at_on_its_own_clock(written):
    """Gaps and frozen stretches are those of a topic; that the others have rows in between is none."""
    ros, rng = written.ros, np.random.default_rng(1)
    times = np.arange(300) * 0.02
    speeds = np.sin(times) + rng.normal(0, 0.01, 300)
    joints = [
        (ns(t), ros.joints(ns(t), ["wheel"], [v]))
        for k, (t, v) in enumerate(zip(times, speeds, strict=True))
        if not 100 <= k < 130
    ]
    imu = [
        (ns(t) + 1, ros.imu(ns(t + 0.003), 0.5 if 200 <= k < 250 else v))
        for k, (t, v) in enumerate(zip(times, speeds, strict=True))
    ]
    volts = [(ns(t), ros.number(np.sin(t) + 0.01 * (k % 3))) for k, t in enumerate(times)]
    file = written(joint_states=joints, imu=imu, volts=volts)
    log = read_logs(file, "differential", mapping={
        "u_right": "/volts.data", "u_left": "/volts.data", "v": "/joint_states.velocity[wheel]", "w": "/imu.angular_velocity.z"
    })  # fmt: skip
    found = {(f.check, f.column) for f in log.preflight() if f.severity == "warning"}
    assert ("time_gap", "v") in found and ("frozen_sensor", "w") in found
    assert not {check for check, _ in found} & {"clock_jitter", "missing_samples", "idle"}


def test_messages_that_others_overtook_are_put_in_the_order_of_their_stamps(tmp_path):
    """Of what one program sends; where two publish, or a clock was set, it stays an error."""
    ros, times = Ros(), np.arange(100) * 20_000_000 + ns(0)

    def bag(name, stamps):
        seconds = 1e-9 * (stamps - ns(0))
        odometry = [
            (int(times[k]) + 1_000_000, ros.odometry(int(stamps[k]), seconds[k], 0.0)) for k in range(len(times))
        ]
        return ros.write(tmp_path / name, {"/odom": odometry, "/volts": [(int(times[0]), ros.numbers([1.0, 2.0]))]})

    fields = {"V2": "/volts.data[0]", "V3": "/volts.data[1]"} | {
        "eta1": "/odom.twist.twist.linear.x", "eta2": "/odom.twist.twist.angular.z",
    }  # fmt: skip
    overtaken = times.copy()
    overtaken[[40, 41, 70, 71, 72]] = times[[41, 40, 72, 70, 71]]
    with pytest.warns(LogWarning, match="2 message.s. of '/odom' came after later ones") as said:
        log = read_logs(bag("late", overtaken), PIONEER, mapping=fields)[0]
    assert len(said) == 1  # not once for each of the topic's fields
    there = np.isfinite(log.output("eta1"))
    np.testing.assert_allclose(log.output("eta1")[there], log.time[there], atol=1e-6)
    set_back = np.where(np.arange(100) > 50, times - 900_000_000, times)
    with pytest.raises(LogError, match="stamped earlier than the one before"):
        read_logs(bag("set", set_back), PIONEER, mapping=fields)
    two = np.where(np.arange(100) % 2, times - 30_000_000, times)
    with pytest.raises(LogError, match="unless two programs publish it"):
        read_logs(bag("two", two), PIONEER, mapping=fields)
