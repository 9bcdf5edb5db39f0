"""jaxid/logs/formats/ros.py and messages.py: bags of rosbags' own writers give back their numbers and stamps."""

import shutil
import sys

import numpy as np
import pytest

from jaxid.logs import LogError
from jaxid.logs.formats import read_recording
from jaxid.logs.recorded import found
from tests.recordings import Ros, ns

pytest.importorskip("rosbags", reason="bags are written and read by rosbags")

SECONDS = np.arange(20) * 0.1
TURN = np.linspace(0.0, 9.0, 20)  # more than a turn, which the yaw has to follow


def topics(ros):
    """A message of every kind that robots publish, received 2 ms after its stamp."""
    times = [ns(t) for t in SECONDS]
    wheels = ["left_wheel", "right_wheel"]
    at = [
        (
            t,
            k,
            ros.transform(t, "odom", "base_link", 0.1 * k, 0, TURN[k]),
            ros.transform(t, "base_link", "arm", 1, 0, 0),
        )
        for k, t in enumerate(times)
    ]
    return {
        "/odom": [(t + 2_000_000, ros.odometry(t, 0.1 * k, -k, yaw=TURN[k])) for k, t in enumerate(times)],
        "/joint_states": [
            (t + 2_000_000, ros.joints(t, wheels, [k, -k], [2.0 * k, 3.0 * k])) for k, t in enumerate(times)
        ],
        "/imu": [(t + 2_000_000, ros.imu(t, k)) for k, t in enumerate(times)],
        "/cmd_vel": [(t, ros.twist(k, 2 * k)) for k, t in enumerate(times)],
        "/volts": [(t, ros.numbers([k, 10 + k])) for k, t in enumerate(times)],
        "/height": [(t, ros.number(k / 4)) for k, t in enumerate(times)],
        "/tf": [(t + 2_000_000, ros.transforms(base, arm)) for t, _, base, arm in at],
        "/note": [(times[0], ros.text("go"))],
        "/silent": "std_msgs/msg/Float64",
    }


@pytest.fixture(scope="module", params=["bag", "db3", "mcap", "folder"])
def bag(request, tmp_path_factory):
    """The same messages in each container."""
    place = tmp_path_factory.mktemp("bags") / ("run.bag" if request.param == "bag" else "run")
    ros = Ros(1 if request.param == "bag" else 2)
    file = ros.write(place, topics(ros), "sqlite3" if request.param == "db3" else "mcap")
    if request.param == "folder":
        return place
    if request.param == "bag":
        return file
    # A file without the metadata.yaml that stood beside it.
    return shutil.copy(file, tmp_path_factory.mktemp("alone") / file.name)


def test_every_container_gives_the_numbers_that_were_written(bag):
    recording = read_recording(bag)
    count = np.arange(20.0)
    for name, values, unit in (
        ("/odom.twist.twist.linear.x", 0.1 * count, "m/s"),
        ("/odom.twist.twist.angular.z", -count, "rad/s"),
        ("/odom.pose.pose.orientation.yaw", TURN, "rad"),
        ("/joint_states.velocity[right_wheel]", -count, "rad/s or m/s"),
        ("/joint_states.position[left_wheel]", 2 * count, "rad or m"),
        ("/imu.angular_velocity.z", count, "rad/s"),
        ("/cmd_vel.angular.z", 2 * count, "rad/s"),
        ("/volts.data[1]", 10 + count, ""),
        ("/height.data", count / 4, ""),
        ("/tf[odom->base_link].rotation.yaw", TURN, "rad"),
        ("/tf[base_link->arm].translation.x", np.ones(20), "m"),
    ):
        series = recording.series[name]
        np.testing.assert_allclose(series.values, values, atol=1e-12, err_msg=name)
        assert series.unit == unit, name
    stamps = np.array([ns(t) for t in SECONDS])
    odometry = recording.series["/odom.twist.twist.linear.x"]
    np.testing.assert_array_equal(odometry.stamped, stamps)
    np.testing.assert_array_equal(odometry.received, stamps + 2_000_000)
    assert odometry.frame == "odom -> base_link"
    assert recording.series["/volts.data[0]"].stamped is None
    assert recording.topics["/silent"].remark == "no messages" and "no numbers" in recording.topics["/note"].remark
    assert recording.topics["/odom"].messages == 20
    assert not any("covariance" in name for name in recording.series)


def test_only_the_topics_of_the_fields_are_read(bag):
    recording = read_recording(bag, ["/imu.angular_velocity.z"])
    assert {series.topic for series in recording.series.values()} == {"/imu"}
    assert recording.topics["/odom"].messages == 20
    with pytest.raises(LogError, match=r"has no topic '/imux' \(close: '/imu'\)"):
        read_recording(bag, ["/imux.angular_velocity.z"])


def test_a_message_type_of_ones_own_is_read_by_the_definition_in_the_bag(tmp_path):
    ros = Ros(2, extra=[("our_robot/msg/Motors", "float32[2] amperes\nbool braked\nint8[] codes\nstring name")])
    message = ros.make("our_robot/msg/Motors", amperes=np.array([1, 2], np.float32), braked=True, codes=[3], name="a")
    message.codes = np.array([3], np.int8)
    series = read_recording(ros.write(tmp_path / "run", {"/motors": [(ns(0), message)]})).series
    assert {name: float(one.values[0]) for name, one in series.items()} == {
        "/motors.amperes[0]": 1.0,
        "/motors.amperes[1]": 2.0,
        "/motors.braked": 1.0,
        "/motors.codes[0]": 3.0,
    }


def test_what_is_odd_in_messages_is_a_fault_of_the_field(tmp_path):
    ros = Ros()
    growing = [(ns(k), ros.numbers([0.0] * (2 + (k == 3)))) for k in range(5)]
    short = [(ns(k), ros.joints(ns(k), ["a", "b"], [1.0] if k == 2 else [1.0, 2.0])) for k in range(5)]
    two = [(ns(k), ros.joints(ns(k), ["a"] if k % 2 else ["b"], [float(k)])) for k in range(5)]
    series = read_recording(ros.write(tmp_path / "run", {"/volts": growing, "/short": short, "/two": two})).series
    assert "changes its length" in series["/volts.data[2]"].fault
    assert "names 2 joints and has 1 numbers in velocity" in series["/short.velocity[b]"].fault
    # Two programs may publish joints on one topic: each joint has its own samples.
    assert not series["/two.velocity[a]"].fault
    np.testing.assert_array_equal(series["/two.velocity[a]"].values, [1, 3])


def test_a_type_that_is_no_name_is_never_made_a_class(tmp_path):
    """rosbags writes a program with the types' names in it; what stands in a file must not be run."""
    import sqlite3

    ros = Ros()
    file = ros.write(tmp_path / "run", {"/a": [(ns(0), ros.number(1.0))]}, "sqlite3")
    evil = "std_msgs/msg/Float64:\n    raise SystemExit(7)\nclass x"
    with sqlite3.connect(file) as base:
        base.execute("UPDATE topics SET type = ?", (evil,))
        base.execute("UPDATE message_definitions SET topic_type = ?", (evil,))
    base.close()
    with pytest.raises(LogError, match="which is no message type"):
        read_recording(file)


def test_bags_of_humble_hold_no_definitions(tmp_path):
    """Standard messages are read all the same; a type of one's own is named, and the others are read beside it."""
    import sqlite3

    ros = Ros(2, extra=[("our_robot/msg/Motors", "float32 amperes")])
    motors = ros.make("our_robot/msg/Motors", amperes=1.0)
    file = ros.write(
        tmp_path / "run", {"/motors": [(ns(0), motors)], "/odom": [(ns(0), ros.odometry(ns(0), 1, 2))]}, "sqlite3"
    )
    with sqlite3.connect(file) as base:
        base.execute("DROP TABLE message_definitions")
        base.execute("UPDATE schema SET schema_version = 3")
        base.execute("ALTER TABLE topics DROP COLUMN type_description_hash")
    base.close()
    recording = read_recording(file)
    assert recording.series["/odom.twist.twist.angular.z"].values == [2.0]
    assert "holds no definition" in recording.topics["/motors"].remark
    with pytest.raises(LogError, match="'/motors' .* has a type of which the bag holds no definition"):
        found(read_recording(file, ["/motors.amperes"]), "/motors.amperes", "u", file)


def test_without_rosbags_the_remedy_is_the_install(tmp_path, monkeypatch):
    ros = Ros()
    file = ros.write(tmp_path / "run", {"/a": [(ns(0), ros.number(1.0))]})
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(LogError, match=r"pip install jaxid-robots\[bags\]"):
        read_recording(file)


@pytest.mark.parametrize("ending", ["mcap", "bag", "db3", "wpilog", "mat"])
def test_names_that_promise_what_the_bytes_are_not(tmp_path, ending):
    path = tmp_path / f"run.{ending}"
    path.write_bytes(b"")
    with pytest.raises(LogError, match="is empty"):
        read_recording(path)
    path.write_bytes(b"t,u,v\n0,1,2\n")
    with pytest.raises(LogError, match="although its name says so|cannot be read as a MATLAB file"):
        read_recording(path)


def test_a_bag_of_another_name_says_which_it_needs(tmp_path):
    ros = Ros()
    file = ros.write(tmp_path / "run", {"/a": [(ns(0), ros.number(1.0))]})
    with pytest.raises(LogError, match="let its name end in .mcap"):
        read_recording(file.rename(tmp_path / "run.dat"))


def test_a_recorder_that_was_stopped_hard(tmp_path):
    """What is whole of an MCAP file is read: all of it without its end, no more than the chunks that are whole."""
    ros = Ros()
    times = [ns(0.01 * k) for k in range(2000)]  # 1.4 MB, in chunks of 1 MB
    file = ros.write(tmp_path / "run", {"/odom": [(t, ros.odometry(t, k, -k)) for k, t in enumerate(times)]})
    data, whole = file.read_bytes(), read_recording(file)
    speed = "/odom.twist.twist.linear.x"
    assert not whole.notes and len(whole.series[speed]) == 2000
    for left, all_of_it in ((len(data) - 100, True), (len(data) - 3, True), (len(data) * 9 // 10, False)):
        file.write_bytes(data[:left])
        found = read_recording(file)
        ((check, said),) = found.notes
        assert check == "truncated" and "last whole chunk" in said
        values = found.series[speed].values
        assert (len(values) == 2000) is all_of_it and len(values) > 1000
        np.testing.assert_array_equal(values, whole.series[speed].values[: len(values)])
        np.testing.assert_array_equal(found.series[speed].received, whole.series[speed].received[: len(values)])
    file.write_bytes(data[: len(data) // 2])
    with pytest.raises(
        LogError, match="run.mcap breaks off before its first chunk of messages is whole; record it again"
    ):
        read_recording(file)
