"""Broken logs: same numbers, a finding, or one sentence; never a traceback, a hang, or other numbers in silence."""

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from benchmarks.fuzzing.corpus import BREAKAGES
from benchmarks.fuzzing.dialects import frame, parquet
from benchmarks.fuzzing.good import good_logs
from benchmarks.fuzzing.judge import Outcome, judge_log, reference
from benchmarks.fuzzing.mutations import cells, edited, edits, with_cells
from jaxid import LogError, read_logs

GOODS = {good.robot: good for good in reversed(good_logs())}
SHORT = {robot: good.short(300) for robot, good in GOODS.items()}
SETTINGS = hypothesis.settings(
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=60,
    suppress_health_check=[hypothesis.HealthCheck.function_scoped_fixture],
)


def test_the_good_logs_are_good():
    """Nothing is found in them, so that a finding comes from the breakage; and they hold what their text says."""
    for good in good_logs():
        log, findings = reference(good)
        assert not findings and len(log) == len(good.rows)
        np.testing.assert_array_equal(log.inputs, np.stack([good.column(n) for n in good.channels.inputs], axis=1))


def broken(folder, breakage, robot):
    """What is said of a robot's log broken so; None where this robot's log cannot show the fault."""
    data = breakage.bytes(GOODS[robot], (7, len(breakage.name)))
    if data is None:
        return None
    path = folder / breakage.file
    path.write_bytes(data)
    return judge_log(path, GOODS[robot], harmless=breakage.harmless)


@pytest.mark.parametrize("number", range(len(BREAKAGES)), ids=lambda k: f"{BREAKAGES[k].kind}: {BREAKAGES[k].name}")
def test_every_way_to_break_a_log_ends_well(tmp_path, number):
    """Each on one robot that can show it, another one for the next; the slow test has them all."""
    breakage, robots = BREAKAGES[number], list(GOODS)
    turned = robots[number % len(robots) :] + robots[: number % len(robots)]
    verdict = next((v for robot in turned if (v := broken(tmp_path, breakage, robot)) is not None), None)
    if verdict is None:
        pytest.skip("no good log has a column that can show it")
    assert verdict.right, f"{verdict.outcome}: {verdict.said}"


@pytest.mark.slow
def test_every_way_to_break_a_log_ends_well_on_every_robot(tmp_path):
    seen = {(b.name, robot): broken(tmp_path, b, robot) for b in BREAKAGES for robot in GOODS}
    wrong = {case: v.said for case, v in seen.items() if v is not None and not v.right}
    assert len(seen) > 400 and not wrong


ON_ONE = [pytest.param(robot, marks=[pytest.mark.slow] * (robot != "axis")) for robot in SHORT]


@pytest.mark.parametrize("robot", ON_ONE)
@SETTINGS
@hypothesis.given(data=st.data())
def test_random_bytes_end_well(tmp_path, robot, data):
    good = SHORT[robot]
    text = good.text.encode()
    path = tmp_path / "run.csv"
    path.write_bytes(edited(text, data.draw(edits(len(text)))))
    verdict = judge_log(path, good, by_chance=True)
    assert verdict.right or verdict.outcome is Outcome.UNSEEN, f"{verdict.outcome}: {verdict.said}"


@pytest.mark.parametrize("robot", ON_ONE)
@SETTINGS
@hypothesis.given(data=st.data())
def test_random_cells_end_well(tmp_path, robot, data):
    good = SHORT[robot]
    path = tmp_path / "run.csv"
    path.write_bytes(with_cells(good, data.draw(cells(len(good.rows), len(good.header)))))
    verdict = judge_log(path, good, by_chance=True)
    assert verdict.right or verdict.outcome is Outcome.UNSEEN, f"{verdict.outcome}: {verdict.said}"


@SETTINGS
@hypothesis.given(data=st.data())
def test_damaged_parquet_ends_well(tmp_path, data):
    good = SHORT["axis"]
    whole = parquet(frame(good))
    path = tmp_path / "run.parquet"
    path.write_bytes(edited(whole, data.draw(edits(len(whole)))))
    verdict = judge_log(path, good, by_chance=True)
    assert verdict.right or verdict.outcome is Outcome.UNSEEN, f"{verdict.outcome}: {verdict.said}"


AXIS = "t,u,v\n" + "".join(f"{0.02 * k:.2f},{1 + k % 7},{0.1 * k % 3:.3f}\n" for k in range(100))
FAULTS = {
    "quote": (AXIS.replace("1.00,", '"1.00,', 1).replace("1.50,", '"1.50,', 1), "line 52|no number"),
    "truth values": ("t,u,v\n" + "".join(f"{k},True,0.1\n" for k in range(9)), "'u' holds bool"),
    "NUL after a byte-order mark": (b"\xef\xbb\xbf" + AXIS.replace("0.7", "0.\x007").encode(), "not a text file"),
    "clock of 1e-300 s": ("t,u,v\n" + "".join(f"{k}e-300,{k},0.1\n" for k in range(9)), "sampling interval.*map t"),
    "clock of 1e300 s": ("t,u,v\n" + "".join(f"{k}e300,{k},0.1\n" for k in range(9)), "sampling interval.*map t"),
    "pose in words": (AXIS.replace("v\n", "v,x\n").replace("0\n", "0,home\n", 1), "'home'|fields"),
    "all absurd": ("t,u,v\n" + "".join(f"{k},{k},1e200\n" for k in range(9)), "'v' has no measured value"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_named(tmp_path, fault):
    content, says = FAULTS[fault]
    (tmp_path / "run.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(LogError, match=says):
        read_logs(tmp_path / "run.csv", "axis")


@pytest.mark.parametrize(
    ("check", "column", "name"),
    [
        ("unit", "eta2", "yaw rate in degrees"),
        ("unit", "V2", "voltage in mV"),
        ("time_unit", "t", "in milliseconds"),
        ("short_log", None, "in minutes"),
        ("skipped_row", "t", "a row lost"),
        ("short_log", None, "forty rows"),
        ("empty_column", "q", "NaN throughout"),
        ("unused_column", "{Q}", "an optional column in capitals and braces"),
        ("contradiction", "q", "position in mm"),
        ("infinite", "eta1", "1e15"),
        ("spike", "u", "10 or 1000 times the largest"),
    ],
)
def test_doubts_are_named(tmp_path, check, column, name):
    """The finding that is meant for the fault, for its column, among seeds that hit different columns."""
    breakage = next(b for b in BREAKAGES if b.name == name)
    path = tmp_path / breakage.file
    found = set()
    for good in (GOODS["pioneer"].short(1200), GOODS["axis"]):
        for seed in range(12):
            data = breakage.bytes(good, (seed,))
            if data is None:
                continue
            path.write_bytes(data)
            try:
                found |= {(f.check, f.column) for f in read_logs(path, good.robot).preflight()}
            except LogError:
                continue
            if (check, column) in found:
                return
    pytest.fail(f"found {found}")
