"""Positions: the turns of a sensor that begins anew at each of them."""

import numpy as np
import pytest

from jaxid import LogError, LogWarning, Pioneer, read_logs
from jaxid.logs.rates import whole_way

TIME = 0.02 * np.arange(200)
ANGLE = 3.0 + 4.0 * TIME**2


@pytest.mark.parametrize("period", [2 * np.pi, 360.0])
def test_turns_are_counted(period):
    angle = ANGLE * period / (2 * np.pi)
    whole, text = whole_way(TIME, angle % period, "phi2", "enc")
    np.testing.assert_allclose(whole, angle)
    assert not text


def test_positions_that_were_never_wrapped_stay_as_they_are():
    assert whole_way(TIME, ANGLE, "phi2", "enc") == (pytest.approx(ANGLE), "")


def test_turns_in_a_gap_are_nobodys():
    seen = np.where((TIME > 2.0) & (TIME < 2.6), np.nan, ANGLE % (2 * np.pi))
    whole, text = whole_way(TIME, seen, "phi2", "enc")
    assert np.isnan(whole).sum() == np.isnan(seen).sum()
    assert "gap of 0.6" in text and "cut the log there" in text


def test_angles_of_a_table_are_read_as_a_whole_way(tmp_path):
    rows = zip(TIME, ANGLE % (2 * np.pi), -ANGLE % (2 * np.pi), strict=True)
    text = "t,V2,V3,right,left\n" + "".join(f"{t},5,-5,{a},{b}\n" for t, a, b in rows)
    (tmp_path / "run.csv").write_text(text)
    log = read_logs(tmp_path / "run.csv", "pioneer", mapping={"phi2": "right", "phi3": "left"})[0]
    np.testing.assert_allclose(np.diff(log.output("phi2")), np.diff(ANGLE))
    np.testing.assert_allclose(np.diff(log.output("phi3")), -np.diff(ANGLE))
    lines = text.splitlines(keepends=True)
    (tmp_path / "gap.csv").write_text("".join([*lines[:100], *lines[140:]]))
    with pytest.warns(LogWarning, match="nobody counted"):
        read_logs(tmp_path / "gap.csv", Pioneer(), mapping={"phi2": "right", "phi3": "left"})
    with pytest.raises(LogError, match="eta1"):
        read_logs(tmp_path / "run.csv", "pioneer", mapping={"phi2": "right"})


def test_angles_that_a_mapping_names_count_beside_speeds(tmp_path):
    rows = "".join(f"{t},5,-5,0.1,0.2,{a},{-a}\n" for t, a in zip(TIME, ANGLE, strict=True))
    (tmp_path / "run.csv").write_text("t,V2,V3,eta1,eta2,right,left\n" + rows)
    log = read_logs(tmp_path / "run.csv", "pioneer", mapping={"phi2": "right", "phi3": "left"})[0]
    assert log.measured == ("eta1", "eta2", "phi2", "phi3")
