"""jaxid/logs/formats/several.py: one run in several tables, each with its own rows, by one clock."""

import numpy as np
import pandas as pd
import pytest

from jaxid import LogError, read_logs
from jaxid.logs.look import look

START = 1_764_410_000.25
T = 0.005 * np.arange(400)
SLOW, CHANGES = T[::4], np.array([0.0, 0.5, 1.0, 1.5])
VOLTS = np.array([2.0, -1.0, 0.0, 3.0])


@pytest.fixture
def run(tmp_path):
    """Commands when they change, odometry at 50 Hz in milliseconds since 1970, a gyro at 200 Hz in seconds of that clock."""

    def table(name, time, **columns):
        pd.DataFrame({"stamp": time, **columns}).to_csv(tmp_path / name, index=False)

    table("commands.csv", START + CHANGES, u_right=VOLTS, u_left=-VOLTS)
    table("odometry.csv", np.round(1e3 * (START + SLOW)).astype(np.int64), v=np.sin(SLOW), charge=12.0)
    table("imu.csv", START + T, w=np.cos(T), charge=3.3)
    return f"{tmp_path}/odometry.csv+imu.csv+commands.csv"


def test_every_table_keeps_its_rows(run):
    (log,) = read_logs(run, "differential")
    assert log.name == "odometry.csv+imu.csv+commands.csv"
    there = np.isfinite(log.output("v"))
    np.testing.assert_allclose(log.time[there], SLOW, atol=1e-3)
    np.testing.assert_allclose(log.output("v")[there], np.sin(SLOW))
    np.testing.assert_allclose(np.nanmax(np.abs(log.output("w") - np.cos(log.time))), 0.0, atol=1e-3)
    held = VOLTS[np.searchsorted(CHANGES, log.time + 1e-3, side="right") - 1]
    np.testing.assert_array_equal(log.input("u_left"), -held)


def test_a_column_of_several_is_called_by_its_table_and_the_mapping_may_name_the_times(run):
    assert {"odometry.charge", "imu.charge", "w"} <= set(look_at(run).recording.series)
    (log,) = read_logs(f"{run}[0.2:1]", "differential", mapping={"t": "stamp", "w": {"column": "w", "scale": -1.0}})
    assert log.time[-1] < 1.0 and np.nanmax(log.output("w")) < 0.0


def look_at(run):
    from jaxid.logs.files import files_of

    return look(files_of(run)[0])


def test_tables_that_are_not_of_one_run_are_refused(run, tmp_path):
    pd.DataFrame({"stamp": T, "w": np.cos(T)}).to_csv(tmp_path / "imu.csv", index=False)
    with pytest.raises(LogError, match="times of these tables have nothing in common.*by one clock"):
        read_logs(run, "differential")
    with pytest.raises(LogError, match=r"gyro.csv does not exist \(close: 'imu.csv'\)|gyro.csv does not exist"):
        read_logs(f"{tmp_path}/odometry.csv+gyro.csv", "differential")
    with pytest.raises(LogError, match="is no table"):
        read_logs(f"{tmp_path}/odometry.csv+*.csv", "differential")
    dates = pd.Timestamp("2025-11-29") + pd.to_timedelta(T, unit="s")
    pd.DataFrame({"stamp": dates, "w": np.cos(T)}).to_csv(tmp_path / "imu.csv", index=False)
    with pytest.raises(LogError, match="imu.csv has dates for times"):
        read_logs(run, "differential")


def test_a_command_that_is_given_once_holds(run, tmp_path):
    pd.DataFrame({"stamp": [START], "u_right": [2.0], "u_left": [1.0]}).to_csv(tmp_path / "commands.csv", index=False)
    (log,) = read_logs(run, "differential")
    assert np.all(log.input("u_right") == 2.0) and log.time[-1] > 1.9


def test_a_pattern_in_a_folder_whose_name_has_a_plus_is_that_pattern(tmp_path):
    (tmp_path / "c++").mkdir()
    for name in ("a", "b"):
        pd.DataFrame({"t": T, "u": 1.0, "v": np.sin(T)}).to_csv(tmp_path / "c++" / f"{name}.csv", index=False)
    assert read_logs(f"{tmp_path}/c++/*.csv", "axis").names == ("a.csv", "b.csv")
    with pytest.raises(LogError, match="c.csv does not exist"):
        read_logs(f"{tmp_path}/c++/c.csv", "axis")


def test_a_file_whose_name_has_a_plus_is_that_file(tmp_path):
    pd.DataFrame({"t": T, "u": 1.0, "v": np.sin(T)}).to_csv(tmp_path / "a+b.csv", index=False)
    (log,) = read_logs(tmp_path / "a+b.csv", "axis")
    assert log.name == "a+b.csv" and len(log) == len(T)
