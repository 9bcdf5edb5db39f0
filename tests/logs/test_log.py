"""jaxid/logs/log.py."""

import numpy as np
import pandas as pd
import pytest

from jaxid.logs import AXIS, PIONEER, Log, LogError, LogSet, LogWarning, read_logs


def _log(name="a.csv", samples=50, channels=PIONEER):
    time = 0.02 * np.arange(samples)
    inputs = np.sin(np.outer(time, 1 + np.arange(len(channels.inputs))))
    outputs = np.cos(np.outer(time, 1 + np.arange(len(channels.outputs))))
    return Log.from_arrays(name, time, inputs, outputs, channels)


def test_arrays_are_read_only_copies():
    time = 0.1 * np.arange(5.0)
    log = Log.from_arrays("a", time, np.zeros((5, 2)), np.zeros((5, 2)), "pioneer")
    time[0] = 99
    assert log.time[0] == 0
    for array in (log.time, log.inputs, log.outputs, log.output("eta1")):
        with pytest.raises(ValueError):
            array[0] = 1


@pytest.mark.parametrize(("scale", "words"), [(1.0, "counts the rows"), (20.0, "unlikely for a robot")])
def test_times_that_are_hardly_seconds_are_warned_of(scale, words):
    """Rows counted, and milliseconds of 50 Hz as they come: a fit would be sound, every time wrong by a factor."""
    time = scale * np.arange(400.0)
    with pytest.warns(LogWarning, match=f"a.csv: column 't'.*{words}.*; give seconds"):
        Log.from_arrays("a.csv", time, np.ones((400, 1)), np.ones((400, 1)), AXIS)


def test_columns_by_name_and_absent_optional_channels():
    time = np.arange(4.0)
    log = Log.from_arrays("a", time, {"u": time}, {"q": 2 * time}, AXIS)
    assert np.isnan(log.output("v")).all() and log.measured == ("q",)
    np.testing.assert_array_equal(log.output("q"), [0, 2, 4, 6])
    assert log.sampling_interval == 1 and log.duration == 3


@pytest.mark.parametrize(
    ("time", "inputs", "outputs", "says"),
    [
        ([0.0], [[1, 1]], [[1, 1]], "at least two"),
        ([0, 0.1, 0.1], np.ones((3, 2)), np.ones((3, 2)), "repeats the previous time at sample 2"),
        ([0, 0.2, 0.1], np.ones((3, 2)), np.ones((3, 2)), "runs backwards at sample 2"),
        ([0, np.nan, 0.1], np.ones((3, 2)), np.ones((3, 2)), "sample 1"),
        ([0, 1, 2], [[1, 1], [1, np.nan], [1, 1]], np.ones((3, 2)), "'V3' is not a finite number at sample 1"),
        ([0, 1, 2], np.ones((3, 2)), [[1, 1], [1, 1], [np.inf, 1]], "'eta1' is infinite at sample 2"),
        ([0, 1, 2], np.ones((3, 2)), np.full((3, 2), np.nan), "'eta1' has no measured value"),
        ([0, 1, 2], np.ones((3, 3)), np.ones((3, 2)), "shape"),
        ([0, 1, 2], np.ones((2, 2)), np.ones((3, 2)), "shape"),
        ([0, 1, 2], {"V4": [1, 1, 1]}, np.ones((3, 2)), "'V4'"),
    ],
)
def test_unusable_logs_are_refused_with_the_place(time, inputs, outputs, says):
    with pytest.raises(LogError, match=says) as caught:
        Log.from_arrays("run.csv", time, inputs, outputs, PIONEER)
    assert "run.csv" in str(caught.value) and "\n" not in str(caught.value)


def test_window_keeps_start_leaves_out_stop_and_the_set_keeps_names_apart():
    log = _log(samples=100)
    part = log.window(0.5, 1.0)
    assert part.time[0] == 0.5 and part.time[-1] < 1.0 and len(part) == 25
    np.testing.assert_array_equal(part.inputs, log.inputs[25:50])
    assert LogSet([log, part]).names == ("a.csv", part.name)
    # Where it begins later, it may begin in motion, whatever its first sample shows.
    assert part.cut and not log.window(0.0, 1.0).cut and log.window(0.5).window(0.5, 1.0).cut
    with pytest.raises(LogError, match="from 0 to 1.98 s"):
        log.window(5, 6)


def test_csv_gives_the_same_numbers_back(tmp_path):
    random = np.random.default_rng(3)
    outputs = random.normal(size=(40, 2))
    outputs[7, 1] = np.nan
    extra = pd.DataFrame({"x": random.normal(size=40), "note": ["a", "b"] * 20})
    log = Log.from_arrays(
        "a", np.cumsum(random.uniform(0.01, 0.02, 40)), random.normal(size=(40, 2)), outputs, PIONEER, extra
    )
    log.to_csv(tmp_path / "back.csv")
    back = read_logs(tmp_path / "back.csv", "pioneer")[0]
    for mine, theirs in ((log.time, back.time), (log.inputs, back.inputs), (log.outputs, back.outputs)):
        np.testing.assert_array_equal(mine, theirs)
    np.testing.assert_array_equal(log.extra["x"], back.extra["x"])
    assert list(back.extra["note"]) == ["a", "b"] * 20


def test_set_is_indexed_by_number_slice_and_name_and_splits():
    logs = LogSet([_log("a.csv"), _log("b.csv"), _log("c.csv")])
    assert logs["b.csv"] is logs[1] and logs[-1].name == "c.csv" and logs[:2].names == ("a.csv", "b.csv")
    fit, held_out = logs.split(held_out=["c.csv", 0])
    assert fit.names == ("b.csv",) and held_out.names == ("a.csv", "c.csv")


@pytest.mark.parametrize(
    ("held_out", "says"),
    [(["d.csv"], r"'d.csv'.*a.csv.*b.csv"), ([5], "number 5"), ([], "no log to hold out"), ([0, 1], "no log to fit")],
)
def test_split_refuses_unknown_logs_and_empty_parts(held_out, says):
    with pytest.raises(LogError, match=says):
        LogSet([_log("a.csv"), _log("b.csv")]).split(held_out=held_out)


def test_set_refuses_equal_names_mixed_robots_and_nothing():
    with pytest.raises(LogError, match="'a.csv'"):
        LogSet([_log(), _log()])
    with pytest.raises(LogError, match="different"):
        LogSet([_log("a.csv"), _log("b.csv", channels=AXIS)])
    with pytest.raises(LogError, match="no logs"):
        LogSet([])


def test_table_lists_every_log_and_its_warnings():
    log = _log("<b>.csv", samples=100)
    text, page = repr(LogSet([log])), LogSet([log])._repr_html_()
    assert "<b>.csv" in text and "100" in text and "1.98" in text and "moving_start" in text
    assert "&lt;b&gt;.csv" in page and "<b>" not in page


def test_a_log_is_a_data_set_with_units():
    """Its numbers are those of the frame, and xarray finds a sample by its time."""
    pytest.importorskip("xarray", reason="to_xarray needs xarray (extra `xarray`)")
    time = np.arange(5) * 0.1
    log = Log.from_arrays("a.csv", time, {"u": time}, {"v": 2 * time}, AXIS, {"lamp": ["on"] * 5})
    found = log.to_xarray()
    assert found["u"].attrs == {"units": AXIS.units["u"]} and found["t"].attrs == {"units": "s"}
    assert float(found["v"].sel(t=0.3, method="nearest")) == pytest.approx(0.6) and "q" not in found
    assert list(found["lamp"].to_numpy()) == ["on"] * 5 and found.attrs["sha256"] == log.sha256
    assert found.to_dataframe().reset_index()[["t", "u", "v"]].equals(log.to_frame()[["t", "u", "v"]])
