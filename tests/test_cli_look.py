"""`jaxid look`: what stands in a file, what is odd in it, and a mapping that reads it."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jaxid import read_logs
from jaxid.logs.look import look
from tests.recordings import Ros, ns, write_mat

DEMO = Path(__file__).parents[1] / "jaxid/demo_logs"
TIMES = np.round(np.arange(200) * 0.02, 6)


@pytest.fixture
def bag(tmp_path):
    """A differential drive: a voltage for each side, wheels 2 ms late with a gap, odometry, a gyro that freezes."""
    pytest.importorskip("rosbags", reason="bags are written and read by rosbags")
    ros, rng = Ros(), np.random.default_rng(3)
    wheels = ["wheel_left_joint", "wheel_right_joint"]
    noise = rng.normal(size=(200, 4))
    topics = {
        "/left/voltage": [(ns(t), ros.number(k % 9)) for k, t in enumerate(TIMES)],
        "/right/voltage": [(ns(t), ros.number(k % 7)) for k, t in enumerate(TIMES)],
        "/joint_states": [
            (ns(t) + 2_000_000, ros.joints(ns(t), wheels, noise[k, :2]))
            for k, t in enumerate(TIMES)
            if not 60 <= k < 80
        ],
        "/odom": [(ns(t), ros.odometry(ns(t), *noise[k, 2:])) for k, t in enumerate(TIMES)],
        "/gyro": [(ns(t), ros.imu(ns(t), 0.1 if k > 150 else noise[k, 0])) for k, t in enumerate(TIMES)],
        "/said": [(ns(0), ros.text("go"))],
        "/silent": "std_msgs/msg/Float64",
    }
    return ros.write(tmp_path / "run", topics)


def test_streams_are_told_by_rate_gaps_and_delay(bag):
    streams = {stream.topic.name: stream for stream in look(bag).streams}
    wheels = streams["/joint_states"]
    assert (wheels.topic.messages, wheels.fields, wheels.gaps) == (180, 2, 1)
    np.testing.assert_allclose(
        [wheels.interval, wheels.longest, wheels.late, wheels.latest], [0.02, 0.42, 0.002, 0.002]
    )
    assert wheels.jitter < 1e-6 and np.isnan(streams["/left/voltage"].late)
    doubts = look(bag).doubts
    assert list(doubts) == ["/gyro.angular_velocity.z"]
    assert "stays the same for 49 messages" in doubts["/gyro.angular_velocity.z"]


def test_a_look_prints_and_proposes_a_mapping_that_reads_the_bag(jaxid, bag, tmp_path):
    out = tmp_path / "run_map.toml"
    status, said, remarks = jaxid("look", bag, "--robot", "differential", "--write", out)
    assert status == 0 and str(out) in remarks
    for words in (
        "/joint_states",
        "50 Hz",
        "(longest",
        "/silent: no messages",
        "/said: no numbers",
        "Constant:",
    ):
        assert words in said, words
    proposed = {name: entry["field"] for name, entry in tomllib.loads(out.read_text()).items()}
    assert proposed == {
        "u_right": "/right/voltage.data",
        "u_left": "/left/voltage.data",
        "v": "/odom.twist.twist.linear.x",
        "w": "/odom.twist.twist.angular.z",
    }
    assert len(read_logs(bag, "differential", mapping=out)[0]) == 200
    # A mapping that somebody has edited is not lost.
    status, _, remarks = jaxid("look", bag, "--robot", "differential", "--write", out)
    assert status == 1 and "--overwrite" in remarks
    assert jaxid("look", bag, "--robot", "differential", "--write", out, "--overwrite")[0] == 0


def test_sides_are_told_apart_by_the_names_of_topics_and_joints(jaxid, bag, tmp_path):
    """Of a robot that measures its wheels: their joints, not the body's speed."""
    from jaxid.logs import DIFFERENTIAL_WHEELS
    from jaxid.logs.propose import propose

    words = {"v_right": "right wheel's speed", "v_left": "left wheel's speed"}
    found = {one.channel: one.field for one in propose(look(bag), DIFFERENTIAL_WHEELS, words)}
    assert found["v_right"] == "/joint_states.velocity[wheel_right_joint]"
    assert found["v_left"] == "/joint_states.velocity[wheel_left_joint]"


@pytest.mark.parametrize(
    ("names", "fields"),
    [
        (("v_right", "v_left", "v", "w"), ("v_right", "v_left", "v", "w")),
        (("cmd_vr", "cmd_vl", "v_meas", "yaw_rate"), ("cmd_vr", "cmd_vl", "v_meas", "yaw_rate")),
        (("vr_ref", "vl_ref", "odom_v", "odom_w"), ("vr_ref", "vl_ref", "odom_v", "odom_w")),
        (("ul", "ur", "v", "w"), ("ur", "ul", "v", "w")),
        # A voltage is no speed, and two wheels' speeds are no commands where the body's are to be made of them.
        (("duty_r", "duty_l", "battery_v", "w"), ("duty_r", "duty_l", "", "w")),
        (("vr", "vl", "yaw_rate", "temperature"), ("", "", "", "yaw_rate")),
    ],
)
def test_sides_by_one_letter_and_channels_by_their_own_names(tmp_path, names, fields):
    """In a table without units: commands that are called speeds, and a voltage that ends like one."""
    from jaxid.logs import DIFFERENTIAL
    from jaxid.logs.propose import propose

    values = np.random.default_rng(1).normal(size=(50, 4)).cumsum(axis=0)
    path = tmp_path / "run.csv"
    rows = np.column_stack([0.02 * np.arange(50), values])
    np.savetxt(path, rows, delimiter=",", header="t," + ",".join(names), comments="")
    words = {"u_right": "right side's command", "u_left": "left side's command", "v": "forward speed", "w": "yaw rate"}
    found = {one.channel: one.field for one in propose(look(path), DIFFERENTIAL, words)}
    assert found == dict(zip(("u_right", "u_left", "v", "w"), fields, strict=True))


@pytest.fixture
def stranger(tmp_path):
    """Duties of both sides, a battery, encoders' joints, a gyro in degrees upside down; at rest for a second before."""
    pytest.importorskip("rosbags", reason="bags are written and read by rosbags")
    ros, rng = Ros(), np.random.default_rng(5)
    times = np.round(np.arange(600) * 0.02, 6)
    duty = np.where(times[:, None] < 1, 0.0, np.repeat(rng.choice([-150.0, 60.0, 150.0], (24, 2)), 25, axis=0))
    # What wheels of a first-order robot do: 0.2 s to reach 0.01 m/s per step of duty.
    rims = np.zeros_like(duty)
    for k in range(1, len(times)):
        rims[k] = rims[k - 1] + 0.1 * (0.01 * duty[k - 1] - rims[k - 1])
    speed, rate = rims.mean(axis=1), (rims[:, 0] - rims[:, 1]) / 0.4
    names = ["base_wheel_r", "base_wheel_l"]
    battery = ("my_msgs/msg/Battery", "float32 voltage")
    dps = ("my_msgs/msg/Rate", "float64 yaw_deg_per_s")
    ros = Ros(extra=(battery, dps))
    topics = {
        "/pwm/right": [(ns(t), ros.number(duty[k, 0])) for k, t in enumerate(times)],
        "/pwm/left": [(ns(t), ros.number(duty[k, 1])) for k, t in enumerate(times)],
        "/battery": [(ns(t), ros.make(battery[0], voltage=12.0 - 0.1 * t)) for t in times[::50]],
        "/joint_states": [(ns(t), ros.joints(ns(t), names, rims[k] / 0.05)) for k, t in enumerate(times)],
        "/speed_mm_s": [(ns(t), ros.number(1000 * speed[k] + rng.normal())) for k, t in enumerate(times)],
        "/gyro": [
            (ns(t), ros.make(dps[0], yaw_deg_per_s=-np.degrees(rate[k]) + rng.normal())) for k, t in enumerate(times)
        ],
    }
    return ros.write(tmp_path / "stranger", topics)


def test_units_are_proposed_and_what_nobody_can_know_is_asked_for(jaxid, stranger, tmp_path):
    out = tmp_path / "map.toml"
    status, said, _ = jaxid("look", stranger, "--robot", "pioneer", "--write", out)
    assert status == 0
    proposed = tomllib.loads(out.read_text())
    assert proposed["V2"]["field"] == "/pwm/right.data" and proposed["V2"]["scale"] == "?"  # and not the battery
    assert proposed["eta1"] == {"field": "/speed_mm_s.data", "scale": 0.001, "offset": 0.0}
    assert proposed["eta2"]["scale"] == pytest.approx(np.pi / 180)
    assert "V2, V3: a duty; give the V that one unit of it stands for." in said
    status, _, remarks = jaxid("fit", "pioneer", "--fit", stranger, "--map", out, "--out", tmp_path / "out")
    assert status == 1 and "'V2' has scale = '?'; give a number" in remarks


def test_a_sign_is_found_in_the_look_already(jaxid, stranger):
    status, said, _ = jaxid("look", stranger, "--robot", "differential")
    assert status == 0 and "With these proposals pre-flight finds" in said
    assert "output 'w' has the opposite sign or inputs 'u_right' and 'u_left' are swapped" in " ".join(said.split())


def test_a_robot_at_rest_has_no_frozen_sensor(stranger):
    assert {*look(stranger).doubts} == {"/battery.voltage"}, "which falls indeed"


def test_two_wheels_are_no_body_but_can_be_one(jaxid, tmp_path):
    """Without odometry nothing is guessed: the lines that make the body's speeds of the wheels' wait for the radius."""
    ros, rng = Ros(), np.random.default_rng(2)
    names = ["left_wheel_joint", "right_wheel_joint"]
    topics = {
        "/cmd": [(ns(t), ros.numbers(rng.normal(size=2))) for t in TIMES],
        "/joint_states": [(ns(t), ros.joints(ns(t), names, rng.normal(size=2))) for t in TIMES],
    }
    out = tmp_path / "map.toml"
    status, said, _ = jaxid("look", ros.write(tmp_path / "run", topics), "--robot", "pioneer", "--write", out)
    assert status == 0 and "by its place in the array alone" in said
    text = out.read_text()
    assert set(tomllib.loads(text)) == {"V2", "V3"}
    line = next(line for line in text.splitlines() if line.startswith("# eta2 = {"))
    entry = line[2:].replace("-R / (2 b)", "-0.25").replace("R / (2 b)", "0.25")
    fields = {"/joint_states.velocity[right_wheel_joint]": 0.25, "/joint_states.velocity[left_wheel_joint]": -0.25}
    assert tomllib.loads(entry)["eta2"]["fields"] == fields


def test_a_wheel_whose_name_holds_another_unit_than_the_others_is_no_body_either(jaxid, tmp_path):
    rng, out = np.random.default_rng(3), tmp_path / "map.toml"
    names = ["t", "u_right [V]", "u_left [V]", "v_right [m/s]", "v_left [mm/s]"]
    frame = pd.DataFrame(np.column_stack([TIMES, rng.normal(size=(len(TIMES), 4))]), columns=names)
    frame.to_csv(tmp_path / "run.csv", index=False)
    jaxid("look", tmp_path / "run.csv", "--robot", "differential", "--write", out)
    proposed = tomllib.loads(re.sub(r'"\?"', "0", out.read_text()))
    assert {"v_right [m/s]", "v_left [mm/s]"}.isdisjoint(
        {one["field"] for one in proposed.values() if one.get("field")} - {"u_right [V]", "u_left [V]"}
    )


def test_tables_and_matlab_files_are_looked_at_alike(jaxid, tmp_path):
    status, said, _ = jaxid("look", DEMO / "omni/fit_steps.csv", "--robot", "omni")
    assert status == 0 and "50 Hz" in said and "sideways speed" in said
    path = write_mat(tmp_path / "run.mat", {"clock": TIMES, "V2": TIMES % 3, "eta1": np.sin(TIMES)})
    status, said, remarks = jaxid("look", path)
    assert status == 1 and "no vectors with a time" in remarks
    (tmp_path / "map.toml").write_text('t = "clock"\n')
    status, said, _ = jaxid("look", path, "--map", tmp_path / "map.toml")
    assert status == 0 and "eta1" in said and "50 Hz" in said


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nothing.mcap"], "does not exist"),
        (["empty.mcap"], "is empty"),
        (["words.csv"], "no column of times .*close: 'T'"),
        (["words.csv", "--write", "map.toml"], "--write needs the robot"),
        (["*.csv"], "matches 2 files"),
    ],
)
def test_what_cannot_be_looked_at_is_one_line(jaxid, tmp_path, monkeypatch, arguments, says):
    monkeypatch.chdir(tmp_path)
    Path("empty.mcap").touch()
    Path("words.csv").write_text("T,a\n0,1\n0,0\n")  # nothing in it runs on as times do
    Path("other.csv").write_text("t,a\n0,1\n1,2\n")
    status, said, remarks = jaxid("look", *arguments)
    assert (status, said) == (1, "") and len(remarks.splitlines()) == 1
    assert re.search(says, remarks), remarks


@pytest.mark.parametrize(
    ("right", "left"), [("rw_joint", "lw_joint"), ("drive_right", "drive_left"), ("motor_b", "motor_a")]
)
def test_positions_of_wheels_stand_in_for_speeds_that_nobody_recorded(jaxid, tmp_path, right, left):
    pytest.importorskip("rosbags", reason="bags are written and read by rosbags")
    ros, angle = Ros(), 0.1 * np.cumsum(np.repeat([1.0, -0.5, 2.0, 0.5], 50))
    bag = ros.write(
        tmp_path / "run",
        {
            "/volts": [(ns(t), ros.numbers([float(k // 50), -1.0])) for k, t in enumerate(TIMES)],
            "/joint_states": [
                (ns(t), ros.joints(ns(t), [left, right], (), [2.0 * angle[k], angle[k]])) for k, t in enumerate(TIMES)
            ],
        },
    )
    out = tmp_path / "run_map.toml"
    status, said, _ = jaxid("look", bag, "--robot", "pioneer", "--write", out)
    assert status == 0
    if right == "motor_b":  # of no side that a name could tell: the lines wait for the fields
        assert '# phi2 = { field = "?", scale = 1.0 }   # [rad]' in out.read_text()
        return
    mapping = tomllib.loads(out.read_text())
    assert mapping["phi2"]["field"] == f"/joint_states.position[{right}]"
    assert mapping["phi3"]["field"] == f"/joint_states.position[{left}]"
    assert "eta1" not in mapping and "phi2 and phi3 stand in for it" in out.read_text()
    log = read_logs(bag, "pioneer", mapping=out)[0]
    np.testing.assert_allclose(log.output("phi2"), angle)
    assert log.measured == ("phi2", "phi3")


def test_wheels_are_told_apart_by_number_and_counts_wait_for_their_size(jaxid, tmp_path):
    columns = {"t": TIMES} | {f"u{k}": np.full(200, float(k)) for k in (1, 2, 3, 4)}
    columns |= {f"enc{k}": np.round(100.0 * k * TIMES) for k in (1, 2, 3, 4)}
    path = tmp_path / "omni.csv"
    rows = zip(*columns.values(), strict=True)
    path.write_text(",".join(columns) + "\n" + "".join(",".join(map(str, row)) + "\n" for row in rows))
    out = tmp_path / "map.toml"
    assert jaxid("look", path, "--robot", "omni", "--write", out)[0] == 0
    mapping = tomllib.loads(out.read_text())
    assert [mapping[f"phi{k}"]["field"] for k in (1, 2, 3, 4)] == ["enc1", "enc2", "enc3", "enc4"]
    assert mapping["phi1"]["scale"] == "?" and "2 pi / counts per turn" in out.read_text()


def test_a_strangers_table_is_proposed_so_that_it_reads(jaxid, tmp_path):
    """Semicolons and decimal commas, milliseconds since 1970, millivolts, millimetres, degrees, sides in German."""
    speed = np.convolve(np.repeat([0.0, 0.4, -0.2, 0.5], 50), np.ones(20) / 20)[:200]
    lines = ["Zeitstempel [ms];Spannung rechts (mV);Spannung links (mV);Geschwindigkeit [mm/s];Drehrate [deg/s]"]
    for k, t in enumerate(TIMES):
        volts = 1000 * [0, 5, -3, 6][k // 50]
        row = (1_700_000_000_000 + round(1000 * t), volts, volts - 500 * (k // 100), 1000 * speed[k], 30 * speed[k])
        lines.append(";".join(f"{x:.1f}".replace(".", ",") if x % 1 else str(round(x)) for x in row))
    (tmp_path / "lauf.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    out = tmp_path / "map.toml"
    status, said, _ = jaxid("look", tmp_path / "lauf.csv", "--robot", "pioneer", "--write", out)
    assert status == 0 and "With these proposals pre-flight finds" in said
    log = read_logs(tmp_path / "lauf.csv", "pioneer", mapping=out)[0]
    np.testing.assert_allclose(log.time, TIMES, atol=1e-6)
    np.testing.assert_allclose(log.input("V2")[[60, 120]], [5.0, -3.0])
    np.testing.assert_allclose(log.output("eta1"), speed, atol=1e-4)
    np.testing.assert_allclose(log.output("eta2"), np.radians(30 * speed), atol=1e-3)


def test_a_commanded_twist_is_no_side_and_no_measurement(jaxid, tmp_path):
    """Big-endian, as some boards write: the lines that make two sides of a twist wait for the track."""
    pytest.importorskip("rosbags", reason="bags are written and read by rosbags")

    class BigEndian(Ros):
        def _bytes(self, message):
            return self.store.serialize_cdr(message, message.__msgtype__, little_endian=False)

    ros, names = BigEndian(), ["caster_joint", "wheel_left_joint", "wheel_right_joint"]
    way = np.cumsum(np.repeat([0.05, -0.02, 0.1, 0.03], 50))
    bag = ros.write(
        tmp_path / "run",
        {
            "/cmd_vel": [(ns(TIMES[k]), ros.twist([2.0, -1.0, 3.0, 1.0][k // 50], 0.1 * k)) for k in range(0, 200, 50)],
            "/joint_states": [
                (ns(t), ros.joints(ns(t), names, (), [0.0, way[k], 1.5 * way[k]])) for k, t in enumerate(TIMES)
            ],
        },
    )
    out = tmp_path / "map.toml"
    assert jaxid("look", bag, "--robot", "differential", "--write", out)[0] == 0
    text = out.read_text()
    assert '# u_right = { fields = { "/cmd_vel.linear.x" = 1.0, "/cmd_vel.angular.z" = b } }' in text
    assert '# u_left = { fields = { "/cmd_vel.linear.x" = 1.0, "/cmd_vel.angular.z" = -b } }' in text
    mapping = tomllib.loads(text)
    assert set(mapping) == {"way_right", "way_left"} and mapping["way_left"]["scale"] == "?"
    edited = {name: {**entry, "scale": 0.08} for name, entry in mapping.items()} | {
        f"u_{side}": {"fields": {"/cmd_vel.linear.x": 1.0, "/cmd_vel.angular.z": sign * 0.2}}
        for side, sign in (("right", 1.0), ("left", -1.0))
    }
    log = read_logs(bag, "differential", mapping=edited)[0]
    np.testing.assert_allclose(log.output("way_right"), 0.08 * 1.5 * way)
    np.testing.assert_allclose(log.input("u_right")[[0, 60]], [2.0, 0.0])
    np.testing.assert_allclose(log.input("u_left")[[0, 60]], [2.0, -2.0])


def test_a_place_or_heading_is_no_speed(jaxid, tmp_path):
    """Millimetres and degrees without a time say what they are beside a word for a place."""
    way = np.cumsum(np.sin(TIMES))
    path = write_mat(tmp_path / "axis.mat", {"log": {"time": TIMES, "F_cmd": np.sign(np.sin(9 * TIMES)), "x_mm": way}})
    out = tmp_path / "axis.toml"
    jaxid("look", path, "--robot", "axis", "--write", out)
    found = tomllib.loads(out.read_text())
    assert "v" not in found and found["q"]["field"] == "log.x_mm" and found["q"]["scale"] == 0.001

    rows = zip(
        TIMES, np.sign(np.sin(5 * TIMES)), np.sign(np.cos(7 * TIMES)), np.sin(TIMES), 90 * np.sin(TIMES), strict=True
    )
    text = "t,uR,uL,v,heading_deg\n" + "".join(",".join(f"{x:.4f}" for x in row) + "\n" for row in rows)
    (tmp_path / "run.csv").write_text(text)
    out = tmp_path / "run.toml"
    _, said, _ = jaxid("look", tmp_path / "run.csv", "--robot", "differential", "--write", out)
    found = tomllib.loads(out.read_text())
    assert "w" not in found and found["u_right"]["field"] == "uR" and found["u_left"]["field"] == "uL"
    assert 'w = { field = "heading_deg", scale = 0.017453292519943295, derivative = true }' in said.replace("\n", " ")


def test_a_column_that_is_called_what_the_channel_is_needs_no_unit(jaxid, tmp_path):
    text = "time,effort,speed\n" + "".join(f"{t:.3f},{np.sign(np.sin(5 * t))},{np.sin(t):.4f}\n" for t in TIMES)
    (tmp_path / "run.csv").write_text(text)
    out = tmp_path / "map.toml"
    jaxid("look", tmp_path / "run.csv", "--robot", "axis", "--write", out)
    found = tomllib.loads(out.read_text())
    assert found["v"]["field"] == "speed"


def written(folder, header, *columns):
    """A table of that header, its times first."""
    path = folder / "run.csv"
    rows = "".join(",".join(f"{x:.6f}" for x in row) + "\n" for row in zip(TIMES, *columns, strict=True))
    path.write_text(f"{header}\n{rows}", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("columns", "of_a_metre", "words"),
    [
        ("angle_rad", 1 / 0.08, "m per rad, which is the wheel's radius"),
        ("angle_deg", 180 / np.pi / 0.08, "m per deg, the wheel's radius times 0.0174532925"),
        ("rpm", 30 / np.pi / 0.08, "radius [m], times 0.104719755, since they are in rpm"),
        ("speed_mm_s", 1000.0, "times 0.001, since they are in mm/s"),
    ],
)
def test_a_radius_is_asked_for_in_the_unit_that_wheels_were_recorded_in(jaxid, tmp_path, columns, of_a_metre, words):
    """Put in as asked, R = 0.08 m and b = 0.25 m give back how the rims rolled. Rims' speeds need no radius."""
    right, left = np.cumsum(np.sin(TIMES)), np.cumsum(np.cos(3 * TIMES))
    numbers = np.sign(left), np.sign(right), of_a_metre * left, of_a_metre * right
    path = written(tmp_path, f"t,left_cmd,right_cmd,left_wheel_{columns},right_wheel_{columns}", *numbers)
    out = tmp_path / "map.toml"
    assert jaxid("look", path, "--robot", "differential", "--write", out)[0] == 0
    text = out.read_text()
    assert words in text
    times = float((re.findall(r"times ([0-9.]+)", text) or [1.0])[0])
    if columns.startswith("angle"):
        mapping = tomllib.loads(text.replace('"?"', repr(0.08 * times)))
        outputs = {"way_right": right, "way_left": left}
    else:
        weights = {"R / 2": 0.04, "R / (2 b)": 0.16, "1 / 2": 0.5, "1 / (2 b)": 2.0}
        lines = "\n".join(re.findall(r"^# ([vw] = \{ fields.*)$", text, re.MULTILINE))
        for letters, number in weights.items():
            lines = lines.replace(letters, repr(number * times))
        mapping = tomllib.loads(f"{text}\n{lines}")
        outputs = {"v": (right + left) / 2, "w": (right - left) / 0.5}
    log = read_logs(path, "differential", mapping=mapping)[0]
    for name, values in outputs.items():
        np.testing.assert_allclose(log.output(name), values, atol=1e-5)


def test_what_was_wanted_of_two_wheels_was_not_measured(jaxid, tmp_path):
    path = written(tmp_path, "t,uL,uR,target_rpm_left,target_rpm_right", *np.sin(np.outer([2, 3, 4, 5], TIMES)))
    _, said, _ = jaxid("look", path, "--robot", "differential")
    assert "fields" not in said


def test_sides_speeds_and_degrees_are_known_by_more_names(jaxid, tmp_path):
    """An adjective of a side, a side's voltage by its unit alone, a sign for degrees, and a speed of nothing in particular."""
    numbers = np.sin(np.outer([2, 3, 4, 5], TIMES))
    for header in (
        "t,linker_motor_mV,rechter_motor_mV,speed,Gierrate [°/s]",
        "t,Spannung links [V],Spannung rechts [V],velocity,Yaw [º/s]",
    ):
        path, out = written(tmp_path, header, *numbers), tmp_path / "map.toml"
        assert jaxid("look", path, "--robot", "differential", "--write", out, "--overwrite")[0] == 0
        found = tomllib.loads(out.read_text())
        fields = [found[name]["field"] for name in ("u_left", "u_right", "v", "w")]
        assert fields == header.split(",")[1:]
        assert found["w"]["scale"] == pytest.approx(np.pi / 180)


OF_A_STRANGER = """
from jaxid import Channels, Custom, Parameter, ParameterTable

inputs, outputs = ("u1", "u2", "u3"), ("vx", "w")
rover = Custom(
    dynamics=lambda s, u, p: {"vx": u["u1"] + u["u2"] - p["B"] * s["vx"], "w": u["u3"] - p["B"] * s["w"]},
    state_names=outputs,
    own_channels=Channels(inputs=inputs, outputs=outputs, units={"vx": "m/s", "w": "rad/s"}),
    table=ParameterTable({"B": Parameter(1.0, "1/s", free=True)}),
    velocities=outputs,
    turning="w",
)
"""


def test_a_robot_whose_sides_nobody_told_is_looked_at(jaxid, tmp_path, monkeypatch):
    """A robot of one's own may say which speed is its turning and not with what signs its inputs act."""
    (tmp_path / "of_a_stranger.py").write_text(OF_A_STRANGER)
    table = np.column_stack([TIMES, np.random.default_rng(5).normal(size=(len(TIMES), 5))])
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header="t,u1,u2,u3,vx,w", comments="")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    out = tmp_path / "run_map.toml"
    status, said, _ = jaxid("look", "run.csv", "--robot", "of_a_stranger:rover", "--write", out)
    assert status == 0 and "side's command" not in said
    assert {"u1", "u2", "u3", "vx", "w"} <= tomllib.loads(out.read_text()).keys()


def test_commands_in_millivolts_become_volts_and_are_said_to_count_as_forces(jaxid, tmp_path):
    commands = 1000 * np.sign(np.sin(5 * TIMES)), 1000 * np.sign(np.cos(7 * TIMES))
    speeds = 100 * np.sin(TIMES), np.sin(TIMES)
    path = written(tmp_path, "t,right_mV,left_mV,speed_mm_s,gyro_dps", *commands, *speeds)
    out = tmp_path / "map.toml"
    _, said, _ = jaxid("look", path, "--robot", "differential", "--write", out)
    found = tomllib.loads(out.read_text())
    assert {name: found[f"u_{name}"]["field"] for name in ("right", "left")} == {"right": "right_mV", "left": "left_mV"}
    assert found["u_right"]["scale"] == 0.001 and "says mv, which makes it V" in out.read_text()
    assert "u_right, u_left: taken for forces in N" in said
    _, said, _ = jaxid("look", path, "--robot", "pioneer")
    assert "taken for forces" not in said


def test_a_channel_called_by_its_own_name_with_its_unit_is_found_though_it_is_of_a_side(tmp_path):
    from jaxid import Channels
    from jaxid.logs.propose import propose

    path = tmp_path / "run.csv"
    noise = np.random.default_rng(0).normal(size=(50, 3))
    table = pd.DataFrame(noise, columns=["vr_km_h", "vl_km_h", "gyro_dps"])
    table.assign(t=np.arange(50) * 0.02, ur_mV=np.sin(np.arange(50))).to_csv(path, index=False)
    units = {"ur": "V", "ul": "V", "vr": "m/s", "vl": "m/s", "gyro": "rad/s"}
    own = Channels(inputs=("ur", "ul"), outputs=("vr", "vl", "gyro"), units=units)
    found = {one.channel: one for one in propose(look(path), own, {})}
    fields = {"ur": "ur_mV", "ul": "", "vr": "vr_km_h", "vl": "vl_km_h", "gyro": "gyro_dps"}
    assert {name: one.field for name, one in found.items()} == fields
    assert found["vr"].scale == pytest.approx(1 / 3.6) and found["ur"].scale == pytest.approx(1e-3)
    # The speed v of a body is not v_right's, nor that of a side which is not its own.
    body = Channels(inputs=("ur", "ul"), outputs=("v", "w"), units={**units, "v": "m/s", "w": "rad/s"})
    assert not {one.field for one in propose(look(path), body, {})} & {"vr_km_h", "vl_km_h"}


def test_columns_called_as_channels_are_these_whatever_wheel_they_seem_to_be_of(tmp_path):
    """Two sides' speeds, of a robot whose channels have the same names and whose words say no side."""
    from jaxid import Channels
    from jaxid.logs.propose import propose

    path = tmp_path / "run.csv"
    names = ("cl", "cr", "wl", "wr")
    table = pd.DataFrame(np.random.default_rng(0).normal(size=(50, 4)), columns=names)
    table.assign(t=np.arange(50) * 0.02).to_csv(path, index=False)
    own = Channels(inputs=names[:2], outputs=names[2:], units=dict.fromkeys(names, "rad/s"))
    assert {one.channel: one.field for one in propose(look(path), own, {})} == {name: name for name in names}
