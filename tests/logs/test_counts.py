"""Speeds that are differences of counts, against the counts that made them."""

import numpy as np
import pandas as pd
import pytest

from jaxid import Axis, DifferentialDrive, LogError, read_logs
from jaxid.logs.counts import added_up, count_of


@pytest.mark.parametrize(("count", "rows", "spread"), [(0.00436, 80, 1.5), (1.0, 1000, 3.0), (0.02, 1000, 60.0)])
@pytest.mark.parametrize("off", [0.0, 0.1])
def test_the_count_is_found_whatever_was_rounded_beside_it(count, rows, spread, off):
    random = np.random.default_rng(rows)
    numbers = np.round(random.normal(scale=spread, size=rows))
    found = count_of(count * (numbers + random.uniform(-off, off, rows)))
    assert found == pytest.approx(count, rel=0.03 if off else 1e-9)


def test_what_is_no_count_has_none():
    random = np.random.default_rng(0)
    for k in range(100):
        sine = np.sin(np.arange(1000) * random.uniform(0.001, 0.1))
        for values in (random.normal(size=60 + k), sine, sine + 0.01 * random.normal(size=1000), np.cumsum(sine)):
            assert count_of(values) == 0.0


def test_rounded_digits_and_stamps_that_scatter_do_not_add_up():
    random = np.random.default_rng(1)
    counts = np.cumsum(np.round(random.normal(scale=4.0, size=2000)))
    time = 0.01 * np.arange(2000)
    digits = np.round(np.diff(counts, prepend=0.0) * 0.003 / 0.01, 2)
    way, step = added_up(digits, time)
    assert step == pytest.approx(0.003, rel=1e-3)
    np.testing.assert_allclose(way / step, counts - counts[0], atol=0.01)
    # The stamps may be those of arrival, while the program divided by its own interval.
    way, step = added_up(digits, time + random.uniform(0.0, 0.002, 2000))
    np.testing.assert_allclose(way / step, counts - counts[0], atol=0.01)


def _written(path, rows=200, **changes):
    random = np.random.default_rng(2)
    right, left = (np.round(np.cumsum(random.uniform(0.0, 6.0, rows))) * 0.001 for _ in range(2))
    speed = [np.append(0.0, np.diff(way)) / 0.02 for way in (right, left)]
    columns = {"t": 0.02 * np.arange(rows), "u": random.normal(size=rows), "u_right": random.normal(size=rows)}
    columns |= {"u_left": random.normal(size=rows), "v": (speed[0] + speed[1]) / 2, "w": (speed[0] - speed[1]) / 0.4}
    frame = pd.DataFrame(columns).drop(index=changes.get("lost", []))
    for row, column in changes.get("empty", ()):
        frame.loc[row, column] = np.nan
    frame.to_csv(path, index=False)
    return right - right[0], left - left[0]


SIDES = {
    "way_right": {"fields": {"v": 1.0, "w": 0.2}, "integral": True},
    "way_left": {"fields": {"v": 1.0, "w": -0.2}, "integral": True},
}


def test_a_mapping_adds_speeds_up_in_the_place_of_the_speeds(tmp_path):
    right, left = _written(tmp_path / "run.csv")
    log = read_logs(tmp_path / "run.csv", DifferentialDrive(), mapping=SIDES)[0]
    assert log.measured == ("way_right", "way_left")
    np.testing.assert_allclose(log.output("way_right"), right, atol=1e-9)
    np.testing.assert_allclose(log.output("way_left"), left, atol=1e-9)
    assert [f.check for f in log.findings] == ["added_up", "added_up"] and "steps of 0.001" in str(log.findings[0])


def test_of_one_speed_a_table_and_a_recording_say_the_same(tmp_path):
    scipy_io = pytest.importorskip("scipy.io")
    _written(tmp_path / "run.csv")
    frame = pd.read_csv(tmp_path / "run.csv")
    scipy_io.savemat(tmp_path / "run.mat", {name: frame[name].to_numpy() for name in ("t", "u", "v")})
    mapping = {"q": {"column": "v", "integral": True}}
    table, recording = (read_logs(tmp_path / f"run.{kind}", Axis(), mapping=mapping)[0] for kind in ("csv", "mat"))
    assert table.measured == recording.measured == ("q",)
    np.testing.assert_allclose(table.output("q"), recording.output("q"), atol=1e-9)


@pytest.mark.parametrize(
    ("changes", "robot", "mapping", "says"),
    [
        ({"empty": [(7, "v")]}, Axis(), {"q": {"column": "v", "integral": True}}, "no reading in row 7"),
        ({"lost": [50]}, Axis(), {"q": {"column": "v", "integral": True}}, "rows are missing before 1.02 s"),
        ({}, Axis(), {"v": {"column": "w", "integral": True}}, r"only positions are one of a speed \(q\)"),
        ({}, Axis(), {"q": {"column": "v", "integral": True, "derivative": True}}, "only positions"),
        ({}, Axis(), {"q": {"column": "v", "integral": 1}}, "give true or false"),
    ],
)
def test_what_does_not_add_up_is_an_error_with_a_remedy(tmp_path, changes, robot, mapping, says):
    _written(tmp_path / "run.csv", **changes)
    with pytest.raises(LogError, match=says):
        read_logs(tmp_path / "run.csv", robot, mapping=mapping)
