"""The column of times of strangers' tables: dates, milliseconds, counts since 1970."""

import numpy as np
import pandas as pd
import pytest

from jaxid import LogError, LogWarning, Pioneer, read_logs
from jaxid.logs.times import seconds_of_dates, time_column

TIME = 0.02 * np.arange(60)
START = 1_700_000_000
STAMPS = pd.to_datetime(START * 1_000_000_000 + np.round(TIME * 1e9).astype(np.int64), utc=True)


@pytest.mark.parametrize(
    "dates",
    [
        STAMPS,
        STAMPS.tz_localize(None),
        STAMPS.strftime("%Y-%m-%d %H:%M:%S.%f"),
        STAMPS.strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
        STAMPS - STAMPS[0],
        STAMPS.strftime("%H:%M:%S.%f"),
        (STAMPS + pd.Timedelta("1h46m39.5s")).strftime("%H:%M:%S.%f"),
    ],
    ids=["zone", "local", "text", "ISO", "durations", "time of day", "midnight"],
)
def test_dates_become_seconds_since_the_first(dates):
    np.testing.assert_allclose(seconds_of_dates(pd.Series(dates)), TIME, atol=1e-9)


@pytest.mark.parametrize("values", [["1.5", "2.5"], [1.0, 2.0], ["go", "stop"], [True, False]])
def test_what_is_no_date(values):
    assert seconds_of_dates(pd.Series(values)) is None


@pytest.mark.parametrize(
    ("name", "values", "scale"),
    [
        ("Zeitstempel [ms]", 1000 * TIME, 1e-3),
        ("time_us", 1e6 * TIME, 1e-6),
        ("time", TIME, 1.0),
        ("t", 1000 * TIME, 1.0),  # a column called t is in seconds
        ("timestamp", np.round(1e9 * (START + TIME)), 1e-9),
        ("stamp", np.round(1e3 * (START + TIME)), 1e-3),
        ("time (s)", TIME, 1.0),
        ("clock", 5.0 + TIME, 1.0),  # nothing but that it increases
    ],
)
def test_the_column_of_times_and_its_unit(name, values, scale):
    frame = pd.DataFrame({"speed": np.sin(7 * TIME), name: values, "note": "ok"})
    found = time_column(frame)
    assert found is not None and (found.column, found.scale) == (name, scale)


def test_a_table_without_times():
    assert time_column(pd.DataFrame({"speed": np.sin(7 * TIME), "note": "ok"})) is None


def table(time):
    return pd.DataFrame({"when": time, "V2": 5.0, "V3": 4.0, "eta1": np.tanh(TIME), "eta2": np.tanh(2 * TIME)})


def test_dates_of_a_table_are_read(tmp_path):
    table(STAMPS).to_parquet(tmp_path / "run.parquet")
    table(STAMPS).set_index("when").to_parquet(tmp_path / "index.parquet")
    table(STAMPS.strftime("%Y-%m-%d %H:%M:%S.%f")).to_csv(tmp_path / "run.csv", index=False)
    for file in ("run.parquet", "index.parquet", "run.csv"):
        log = read_logs(tmp_path / file, Pioneer(), mapping={"t": "when"})[0]
        np.testing.assert_allclose(log.time, TIME, atol=1e-9)
        assert any("holds dates" in finding.message for finding in log.findings)


def test_times_since_1970_begin_at_the_first_row(tmp_path):
    table(np.round(1e3 * (START + TIME)).astype(np.int64)).to_csv(tmp_path / "run.csv", index=False)
    log = read_logs(tmp_path / "run.csv", Pioneer(), mapping={"t": {"column": "when", "scale": 1e-3}})[0]
    np.testing.assert_allclose(log.time, TIME, atol=1e-6)
    assert any("counts from 1970" in finding.message for finding in log.findings)


def test_a_date_that_is_none_is_an_error(tmp_path):
    frame = table(STAMPS.strftime("%Y-%m-%d %H:%M:%S.%f"))
    frame.loc[7, "when"] = "yesterday"
    frame.to_csv(tmp_path / "run.csv", index=False)
    with pytest.raises(LogError, match="no time at sample 7"):
        read_logs(tmp_path / "run.csv", Pioneer(), mapping={"t": "when"})


def swapped(time, *pairs):
    order = np.arange(len(time))
    for k, j in pairs:
        order[[k, j]] = order[[j, k]]
    return order


@pytest.mark.parametrize("jitter", [0.0, 0.004])
def test_rows_that_came_late_are_put_at_their_place(tmp_path, jitter):
    time = np.round(TIME + np.random.default_rng(0).uniform(-jitter, jitter, len(TIME)), 5)
    whole = table(time)
    (tmp_path / "whole.csv").write_text(whole.to_csv(index=False))
    order = swapped(time, (10, 12), (30, 31), (50, 53))
    late = whole.iloc[np.insert(order, 20, order[19])]  # and one of them was written twice
    (tmp_path / "late.csv").write_text(late.to_csv(index=False))
    with pytest.warns(LogWarning, match=r"6 row\(s\) came after later ones"):
        found = read_logs(tmp_path / "late.csv", "pioneer", mapping={"t": "when"})[0]
    np.testing.assert_array_equal(found.time, time)
    np.testing.assert_array_equal(
        found.outputs, read_logs(tmp_path / "whole.csv", "pioneer", mapping={"t": "when"})[0].outputs
    )


@pytest.mark.parametrize("back", [0.03, 0.06, 0.5, 1.1])
def test_a_clock_that_was_set_back_is_no_late_row(tmp_path, back):
    time = np.where(np.arange(60) < 40, TIME, TIME - back)
    (tmp_path / "set_back.csv").write_text(table(time).to_csv(index=False))
    with pytest.raises(LogError, match="runs backwards at sample 40"):
        read_logs(tmp_path / "set_back.csv", "pioneer", mapping={"t": "when"})


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")])
def test_times_since_1970_in_another_unit_are_known_by_their_size(tmp_path, factor, unit):
    """No robot is logged in the year 57000; times of its own in milliseconds, which may be seconds, stay as they are."""
    table(np.round(factor * (START + TIME)).astype(np.int64)).to_csv(tmp_path / "run.csv", index=False)
    log = read_logs(tmp_path / "run.csv", Pioneer(), mapping={"t": "when"})[0]
    np.testing.assert_allclose(log.time, TIME, atol=2e-6 if factor > 1e3 else 1e-3)
    assert any(f"counts {unit} from 1970" in finding.message for finding in log.findings)
    table(1e3 * TIME).to_csv(tmp_path / "own.csv", index=False)
    np.testing.assert_allclose(read_logs(tmp_path / "own.csv", Pioneer(), mapping={"t": "when"})[0].time, 1e3 * TIME)


def test_nanoseconds_since_a_computer_was_started_are_no_milliseconds_since_1970(tmp_path):
    table(np.round(1e9 * (2000.0 + TIME)).astype(np.int64)).to_csv(tmp_path / "run.csv", index=False)
    with pytest.raises(LogError, match="no recorder does; map t with the scale that gives seconds"):
        read_logs(tmp_path / "run.csv", Pioneer(), mapping={"t": "when"})
