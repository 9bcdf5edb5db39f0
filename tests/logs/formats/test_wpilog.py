"""jaxid/logs/formats/wpilog.py and structs.py: data logs of WPILib's own writer."""

import struct
import sys

import numpy as np
import pytest

from jaxid.logs import LogError
from jaxid.logs.formats import read_recording
from jaxid.logs.formats.structs import StructError, struct_of
from tests.recordings import write_wpilog

pytest.importorskip("wpiutil", reason="data logs are written and read by robotpy-wpiutil")


def entries():
    times = np.round(np.arange(40) * 0.02 + 1.0, 6)
    return times, {
        "/drive/left/voltage": [(t, float(k)) for k, t in enumerate(times)],
        "/drive/encoders": [(t + 0.001, [0.5 * k, -0.5 * k]) for k, t in enumerate(times)],
        "/drive/ticks": [(t, 7 * k) for k, t in enumerate(times)],
        "/enabled": [(times[0], False), (times[9], True)],
        "sysid-test-state": [(times[0], "quasistatic-forward")],
    }


def test_entries_come_back_with_their_times(tmp_path):
    times, written = entries()
    recording = read_recording(write_wpilog(tmp_path / "run.wpilog", written))
    series = recording.series
    assert list(series) == [
        "/drive/left/voltage",
        "/drive/encoders[0]",
        "/drive/encoders[1]",
        "/drive/ticks",
        "/enabled",
    ]
    np.testing.assert_array_equal(series["/drive/encoders[1]"].values, -0.5 * np.arange(40))
    np.testing.assert_array_equal(series["/drive/left/voltage"].received, np.round(times * 1e9))
    np.testing.assert_array_equal(series["/enabled"].values, [0, 1])
    assert recording.topics["sysid-test-state"].remark == "no numbers" and not recording.notes


def test_a_log_that_breaks_off_is_read_up_to_there(tmp_path):
    path = write_wpilog(tmp_path / "run.wpilog", entries()[1])
    whole = read_recording(path).series["/drive/left/voltage"]
    path.write_bytes(path.read_bytes()[:-5])
    recording = read_recording(path)
    ((check, text),) = recording.notes
    assert check == "truncated" and "breaks off" in text
    np.testing.assert_array_equal(recording.series["/drive/left/voltage"].values, whole.values)


def test_structs_are_decoded_by_the_schemas_in_the_log(tmp_path):
    from wpiutil import DataLogWriter
    from wpiutil.log import RawLogEntry

    writer = DataLogWriter(str(tmp_path / "run.wpilog"))
    writer.addSchema("struct:Pose2d", "structschema", "Translation2d translation;Rotation2d rotation", 1)
    writer.addSchema("struct:Translation2d", "structschema", "double x; double y;", 1)
    writer.addSchema("struct:Rotation2d", "structschema", "double value", 1)
    pose = RawLogEntry(writer, "/pose", "", "struct:Pose2d", 1)
    odd = RawLogEntry(writer, "/odd", "", "struct:Nowhere", 1)
    for k in range(3):
        pose.append(struct.pack("<3d", k, 2 * k, 3 * k), 1000 * (k + 1))
        odd.append(b"1234", 1000 * (k + 1))
    writer.stop()
    recording = read_recording(tmp_path / "run.wpilog")
    assert list(recording.series) == ["/pose.translation.x", "/pose.translation.y", "/pose.rotation.value"]
    np.testing.assert_array_equal(recording.series["/pose.rotation.value"].values, [0, 3, 6])
    assert "no schema of struct 'Nowhere'" in recording.topics["/odd"].remark


@pytest.mark.parametrize("schema", ["double", "double x:3", "Other y", "Own y"])
def test_schemas_that_are_none(schema):
    with pytest.raises(StructError):
        struct_of("Own", {"Own": schema})


def test_without_the_library_the_remedy_is_the_install(tmp_path, monkeypatch):
    path = write_wpilog(tmp_path / "run.wpilog", entries()[1])
    monkeypatch.setitem(sys.modules, "wpiutil.log", None)
    with pytest.raises(LogError, match=r"pip install jaxid-robots\[wpilog\]"):
        read_recording(path)


def sysid(path, seconds=3.0):
    """Two tests as WPILib's SysIdRoutineLog records them: nothing is recorded between them."""
    from wpiutil import DataLogWriter
    from wpiutil.log import DoubleLogEntry, StringLogEntry

    writer = DataLogWriter(str(path))
    names = {"voltage": "Volt", "velocity": "Rotation per Second", "position": "Rotation"}
    made = {name: DoubleLogEntry(writer, f"{name}-front-drive", unit, 1) for name, unit in names.items()}
    state = StringLogEntry(writer, "sysid-test-state-drive", "", 1)
    for begin, said, volts in ((5.0, "dynamic-forward", 6.0), (5.0 + 2.0 + seconds, "dynamic-reverse", -6.0)):
        for k in range(100):
            micros = round(1e6 * (begin + 0.02 * k))
            state.append(said, micros)
            for name, value in (("voltage", volts), ("velocity", 0.01 * volts * k), ("position", 0.001 * k * k)):
                made[name].append(value, micros)
        state.append("none", round(1e6 * (begin + 2.0)))
    writer.flush()
    writer.stop()
    return path


def test_sysids_units_are_read_and_proposed(tmp_path):
    import jaxid
    from jaxid.logs import AXIS
    from jaxid.logs.look import look
    from jaxid.logs.propose import propose, proposed_mapping

    path = sysid(tmp_path / "run.wpilog")
    seen = look(path)
    velocity = seen.recording.series["velocity-front-drive"]
    assert (velocity.unit, velocity.said) == ("rad/s", "Rotation per Second")
    mapping = proposed_mapping(seen, propose(seen, AXIS, {}), AXIS)
    assert mapping is not None
    assert {name: entry["field"] for name, entry in mapping.items()} == {
        "u": "voltage-front-drive",
        "v": "velocity-front-drive",
        "q": "position-front-drive",
    }
    log = jaxid.read_logs(path, "axis", mapping=mapping)[0]
    np.testing.assert_allclose(log.output("v")[:100], 2 * np.pi * 0.06 * np.arange(100))


def test_voltages_that_stayed_away_between_two_tests_are_said(tmp_path):
    import jaxid

    mapping = {name: f"{field}-front-drive" for name, field in (("u", "voltage"), ("v", "velocity"), ("q", "position"))}
    path = sysid(tmp_path / "run.wpilog")
    whole = jaxid.read_logs(path, "axis", mapping=mapping)[0]
    said = [finding for finding in whole.findings if finding.check == "silent_command"]
    assert [finding.severity for finding in said] == ["warning"]
    assert "which comes every 0.02 s, came for 3.02 s from t = 1.98 s on, and 6 was held" in said[0].message
    for stretch in ("[0:2]", "[5:]"):
        part = jaxid.read_logs(f"{path}{stretch}", "axis", mapping=mapping)
        assert len(part[0]) == 100 and not [f for f in part.preflight() if f.check in ("silent_command", "time_gap")]
