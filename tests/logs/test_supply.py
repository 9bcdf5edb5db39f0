"""jaxid/logs/supply.py: a battery that falls is said, wherever the file has its voltage."""

import numpy as np
import pytest

from jaxid import read_logs
from jaxid.logs.look import look
from jaxid.logs.supply import is_supply, said_fall
from tests.recordings import Ros, ns, write_mat, write_wpilog

TIMES = np.round(np.arange(200) * 0.02, 6)
COMMAND = np.repeat([1.0, -1.0, 0.5, -0.5], 50)
SPEED = np.round(np.convolve(COMMAND, np.exp(-np.arange(40) / 10), "full")[:200] / 10, 5)
FALLING, STEADY = 12.6 - 0.6 * TIMES, np.full(200, 12.4)


@pytest.mark.parametrize("name", ["battery_v", "vbat", "Battery voltage [mV]", "/supply.voltage", "/battery_mV.data"])
def test_a_supply_is_known_by_its_name_and_unit(name):
    assert is_supply(name) and is_supply("/battery.voltage", "V")


@pytest.mark.parametrize("name", ["battery_percent", "battery_temperature", "left_volts", "/odom.twist.linear.x"])
def test_what_is_no_supplys_voltage(name):
    assert not is_supply(name)


def test_moments_under_load_are_no_fall():
    sagging = 12.6 - 2.0 * (np.arange(200) % 20 > 8)
    assert said_fall(sagging) == "" and said_fall(STEADY) == "" and said_fall(FALLING[::-1]) == ""
    assert said_fall(FALLING[:5]) == "" and said_fall(np.full(200, np.nan)) == ""
    assert said_fall(FALLING).startswith("falls from 12.52 to 10.")


def written(kind, folder, battery):
    """A log of an axis with that battery beside it, and its mapping."""
    if kind == "csv":
        rows = "\n".join(",".join(map(str, row)) for row in zip(TIMES, COMMAND, SPEED, battery, strict=True))
        (folder / "run.csv").write_text(f"t,u,v,battery_v\n{rows}\n")
        return folder / "run.csv", None
    if kind == "mat":
        return write_mat(folder / "run.mat", {"t": TIMES, "u": COMMAND, "v": SPEED, "battery_v": battery}), None
    if kind == "wpilog":
        columns = {"u": COMMAND, "v": SPEED, "/power/battery_v": battery}
        entries = {
            name: [(t + 1, float(x)) for t, x in zip(TIMES, values, strict=True)] for name, values in columns.items()
        }
        pytest.importorskip("wpiutil", reason="data logs are written by robotpy-wpiutil")
        return write_wpilog(folder / "run.wpilog", entries), None
    pytest.importorskip("rosbags", reason="bags are written by rosbags")
    own = ("my_msgs/msg/Battery", "float32 voltage")
    ros = Ros(extra=(own,))
    topics = {
        "/u": [(ns(t), ros.number(x)) for t, x in zip(TIMES, COMMAND, strict=True)],
        "/v": [(ns(t), ros.number(x)) for t, x in zip(TIMES, SPEED, strict=True)],
        "/battery": [(ns(t), ros.make(own[0], voltage=x)) for t, x in zip(TIMES[::10], battery[::10], strict=True)],
    }
    return ros.write(folder / "run", topics), {"u": "/u.data", "v": "/v.data"}


@pytest.mark.parametrize("kind", ["csv", "mat", "wpilog", "mcap"])
def test_pre_flight_says_that_the_battery_falls(kind, tmp_path):
    path, mapping = written(kind, tmp_path, FALLING)
    with pytest.warns(match="falls from 12.5"):
        (log,) = read_logs(path, "axis", mapping=mapping)
    (found,) = [one for one in log.findings if one.check == "falling_supply"]
    assert found.severity == "warning" and "battery" in found.message and found.message.endswith("shorter stretches.")
    assert any("falls from 12.5" in doubt for doubt in look(path).doubts.values())


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_a_steady_battery_is_not_spoken_of(kind, tmp_path):
    path, mapping = written(kind, tmp_path, STEADY)
    (log,) = read_logs(path, "axis", mapping=mapping)
    assert "falling_supply" not in {one.check for one in log.findings}


def test_a_battery_that_cannot_be_read_stops_nothing(tmp_path, monkeypatch):
    path, mapping = written("mcap", tmp_path, FALLING)
    from jaxid.logs.formats import ros

    plain = ros.parts

    def parts(topic, kind, message):
        if topic == "/battery":
            raise ValueError("nothing that anybody knows")
        return plain(topic, kind, message)

    monkeypatch.setattr(ros, "parts", parts)
    (log,) = read_logs(path, "axis", mapping=mapping)
    assert len(log) == 200 and "falling_supply" not in {one.check for one in log.findings}
