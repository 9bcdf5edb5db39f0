"""Positions: the turns of a sensor that begins anew at each of them."""

import numpy as np
import pytest
import scipy.io

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


@pytest.mark.parametrize(("bits", "low"), [(8, 0), (12, 0), (12, -2048), (16, -32768), (32, -(2**31))])
def test_counters_begin_anew_at_a_power_of_two(bits, low):
    size = 2**bits
    counts = np.floor(size * (0.3 + 0.9 * TIME**2 - 0.4 * TIME))
    whole, _ = whole_way(TIME, (counts - low) % size + low, "way_right", "enc")
    np.testing.assert_array_equal(np.diff(whole), np.diff(counts))


@pytest.mark.parametrize(
    "counts",
    [np.r_[np.arange(180), 200, 30, 40], np.r_[0, 3, 400, 402, 2, 4], np.r_[np.arange(0, 480, 2), np.zeros(60)]],
)
def test_counts_that_jump_otherwise_stay_as_they_are(counts):
    """A spike, a counter read too rarely, and one that was set to zero where it stood."""
    counts = counts.astype(float)
    np.testing.assert_array_equal(whole_way(0.02 * np.arange(len(counts)), counts, "q", "enc")[0], counts)


@pytest.mark.parametrize("kind", ["csv", "mat"])
@pytest.mark.parametrize(("turn", "low", "scale"), [(65536, -32768, 2e-5), (4096, 0, 3e-4), (360, -180, np.pi / 180)])
def test_the_speed_of_a_position_has_no_jump_at_a_turn(tmp_path, kind, turn, low, scale):
    """The scale of the mapping is no reason to lose a turn: it is the sensor's own unit that begins anew."""
    steps = turn * (0.3 + 0.5 * TIME - 0.06 * TIME**2)
    shown = (steps - low) % turn + low
    shown, steps = (shown, steps) if turn == 360 else (np.floor(shown), np.floor(steps))
    if kind == "csv":
        rows = zip(TIME, shown, strict=True)
        (tmp_path / "run.csv").write_text("t,u,enc\n" + "".join(f"{t:.3f},1,{float(a)!r}\n" for t, a in rows))
    else:
        scipy.io.savemat(tmp_path / "run.mat", {"t": TIME, "u": np.ones(len(TIME)), "enc": shown})
    with pytest.warns(LogWarning, match="differentiated"):
        log = read_logs(
            tmp_path / f"run.{kind}", "axis", mapping={"v": {"column": "enc", "scale": scale, "derivative": True}}
        )[0]
    speed = log.output("v")[np.isfinite(log.output("v"))]
    np.testing.assert_allclose(speed, scale * (steps[2:] - steps[:-2]) / 0.04, rtol=1e-6)


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
