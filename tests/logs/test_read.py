"""jaxid/logs/read.py and table.py: every dialect a log may come in, and the ways in which a file may be broken."""

import gzip
import re
import warnings

import numpy as np
import pandas as pd
import pytest

from jaxid import DifferentialDrive
from jaxid.logs import Channels, LogError, LogWarning, read_logs

HEADER = "t,V2,V3,eta1,eta2"
ROWS = ["0.00,0,0,0,0", "0.02,6,6,0,0", "0.04,6,6,0.1,0.01", "0.06,6,-6.5,0.25,0.02", "0.08,1e-1,-6,0.3,0.1"]
GOOD = "\n".join([HEADER, *ROWS])
VALUES = np.array([[float(cell) for cell in row.split(",")] for row in ROWS])


def _write(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def _same(log, values=VALUES):
    np.testing.assert_array_equal(log.time, values[:, 0])
    np.testing.assert_array_equal(log.inputs, values[:, 1:3])
    np.testing.assert_array_equal(log.outputs, values[:, 3:])


@pytest.mark.parametrize(
    "content",
    [
        GOOD,
        GOOD + "\n",
        GOOD.replace("\n", "\r\n"),
        GOOD.replace("\n", "\n\n"),
        GOOD.replace(",", ";"),
        GOOD.replace(",", "\t"),
        GOOD.replace(",", "  "),
        GOOD.replace(",", ", "),
        GOOD.replace(",", ";").replace(".", ","),
        GOOD.replace(",", "\t").replace(".", ","),
        b"\xef\xbb\xbf" + GOOD.encode(),
        GOOD.encode("utf-16"),
        "# a comment, with a comma\n" + GOOD.replace("\n0.04", "\n# the battery was changed\n0.04"),
        "# " + GOOD,  # numpy.savetxt writes its header so
        GOOD.replace(HEADER, '"t","V2","V3","eta1","eta2"'),
        GOOD.replace("\n", ",\n") + ",",  # a delimiter after each line
        gzip.compress(GOOD.encode(), mtime=0),
        re.sub(r"(-?\d+)\.(\d+)", r'"\1,\2"', GOOD),  # decimal commas in quotes
    ],
)
def test_dialects_of_csv_give_the_same_log(tmp_path, content):
    log = read_logs(_write(tmp_path / "run.csv", content), "pioneer")["run.csv"]
    _same(log)
    assert not log.findings and not len(log.extra.columns)


def test_what_is_doubtful_warns_and_what_is_good_does_not(tmp_path, demo_logs):
    """Each finding that is more than a note, once, at the line that reads the log."""
    long = "\n".join(
        [HEADER, *(f"{0.02 * k:.2f},{k % 7},{-k % 5},{k % 11},{99 if k == 200 else k % 13}" for k in range(400))]
    )
    path = _write(tmp_path / "run.csv", long)
    with pytest.warns(LogWarning, match="'eta2', sample 200 .*spike") as said:
        logs = read_logs(path, "pioneer")
    assert [str(one.message) for one in said] == [str(f) for f in logs.preflight() if f.severity != "note"]
    assert {one.filename for one in said} == {__file__}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        demo_logs("pioneer", "check_*")


def test_a_degree_sign_of_another_encoding_does_no_harm(tmp_path):
    text = "\n".join([HEADER + ",temp °C", *(row + ",20" for row in ROWS)])
    log = read_logs(_write(tmp_path / "a.csv", text.encode("cp1252")), "pioneer")[0]
    _same(log)
    assert list(log.extra.columns) == ["temp °C"]


def test_parquet_keeps_nan_and_extra_columns(tmp_path):
    frame = pd.DataFrame(VALUES, columns=HEADER.split(",")).assign(note="x", theta=1.0)
    frame.loc[2, "eta1"] = np.nan
    frame.to_parquet(tmp_path / "run.parquet")
    log = read_logs(tmp_path / "run.parquet", "pioneer")[0]
    assert np.isnan(log.output("eta1")[2]) and list(log.extra.columns) == ["note", "theta"]
    assert [f.check for f in read_logs(tmp_path / "run.parquet", "pioneer").preflight() if f.column == "eta1"]


@pytest.mark.parametrize("robot", ["differential", DifferentialDrive()])
def test_one_wheels_speed_asks_for_the_others(tmp_path, robot):
    path = _write(tmp_path / "run.csv", b"t,u_right,u_left,v_right,v_lfet\n0,1,1,0,0\n0.1,1,1,0.1,0.1\n")
    with pytest.raises(LogError, match="no column 'v_left' .close: 'v_lfet'.*v_left = "):
        read_logs(path, robot)


def test_mapping_renames_scales_and_offsets_from_dict_and_toml(tmp_path):
    frame = pd.DataFrame(VALUES, columns=["ms", "right", "left", "mm", "rate"])
    frame["ms"], frame["mm"], frame["rate"], frame["eta1"] = frame.ms * 1000, frame.mm * 1000 + 5, -frame.rate, 7.0
    frame.to_csv(tmp_path / "run.csv", index=False)
    (tmp_path / "names.toml").write_text(
        'V2 = "right"\nV3 = "left"\nt = {column = "ms", scale = 0.001}\neta2 = {column = "rate", scale = -1}\n'
        'eta1 = {column = "mm", scale = 0.001, offset = -0.005}\n'
    )
    mapping = {
        "V2": "right",
        "V3": {"column": "left"},
        "t": {"column": "ms", "scale": 0.001},
        "eta2": {"column": "rate", "scale": -1},
        "eta1": {"column": "mm", "scale": 0.001, "offset": -0.005},
    }
    for given in (mapping, tmp_path / "names.toml"):
        log = read_logs(tmp_path / "run.csv", "pioneer", mapping=given)[0]
        np.testing.assert_allclose(np.c_[log.time, log.inputs, log.outputs], VALUES, atol=1e-15)
        assert list(log.extra["eta1 (file)"]) == [7.0] * 5  # passed over, kept


def test_a_file_without_time_gets_it_from_an_interval(tmp_path):
    path = _write(tmp_path / "a.csv", "u,v\n1,0\n1,0.5\n1,0.75\n")
    log = read_logs(path, "axis", mapping={"t": {"interval": 0.001}})[0]
    np.testing.assert_allclose(log.time, [0, 0.001, 0.002])


def test_axis_needs_speed_or_position(tmp_path):
    log = read_logs(_write(tmp_path / "q.csv", "t,u,q\n0,1,0\n1,1,0.5\n2,1,0.75\n"), "axis")[0]
    assert log.measured == ("q",)
    with pytest.raises(LogError, match="'v'"):
        read_logs(_write(tmp_path / "none.csv", "t,u,w\n0,1,0\n1,1,0.5\n"), "axis")


def test_robots_by_name_channels_and_attribute(tmp_path):
    class Robot:
        channels = Channels(("V2", "V3"), ("eta1",), ("eta2",))

    path = _write(tmp_path / "a.csv", GOOD)
    for robot in ("pioneer", Robot.channels, Robot()):
        _same(read_logs(path, robot)[0])
    for wrong, says in (("pionier", "close: 'pioneer'"), (3, "no channels")):
        with pytest.raises(LogError, match=says):
            read_logs(path, wrong)


def test_patterns_lists_and_equal_names(tmp_path):
    for folder in ("monday", "tuesday"):
        (tmp_path / folder).mkdir()
        _write(tmp_path / folder / "b.csv", GOOD)
    _write(tmp_path / "monday" / "a.csv", GOOD)
    assert read_logs(str(tmp_path / "monday" / "*.csv"), "pioneer").names == ("a.csv", "b.csv")
    assert read_logs(str(tmp_path / "**" / "*.csv"), "pioneer").names == ("a.csv", "monday/b.csv", "tuesday/b.csv")
    with pytest.raises(LogError, match="given twice"):
        read_logs([tmp_path / "monday" / "a.csv", tmp_path / "monday" / "*.csv"], "pioneer")


DOUBTFUL = {
    "repeated_row": "\n".join([HEADER, *ROWS[:3], ROWS[2], *ROWS[3:]]),
    "truncated_row": GOOD + "\n0.10,6,6",
    "held_input": GOOD + "\n0.10,,6,0.3,0.1\n0.12,6,6,0.3,0.1",
    "infinite": GOOD + "\n0.10,6,6,inf,0.1\n0.12,6,6,0.3,0.1",
}


@pytest.mark.parametrize("check", DOUBTFUL)
def test_doubtful_files_are_read_with_a_warning(tmp_path, check):
    logs = read_logs(_write(tmp_path / "run.csv", DOUBTFUL[check]), "pioneer")
    found = [finding for finding in logs.preflight() if finding.check == check]
    assert len(found) == 1 and found[0].severity == "warning" and "run.csv" in found[0].message
    assert found[0].sample is not None and found[0].sample < len(logs[0])
    _same(logs[0].window(stop=0.09))
    if check == "held_input":
        assert logs[0].input("V2")[5] == 0.1 and found[0].sample == 5


BROKEN = {
    "empty": ("", "is empty"),
    "blank": ("\n\n  \n", "is empty"),
    "only comments": ("# nothing\n# here\n", "is empty"),
    "header only": (HEADER + "\n", "no samples"),
    "one row": (HEADER + "\n" + ROWS[0], "two samples"),
    "binary": (bytes(range(256)) * 8, "not a text file"),
    "noise": (b"\x01\x02\x03\x04\x05\x06\x07\x08" * 50, "not a text file"),
    "damaged gzip": (gzip.compress(GOOD.encode() * 50, mtime=0)[:60], "gzip"),
    "damaged parquet": (b"PAR1" + b"junk" * 20, "Parquet"),
    "no header": ("\n".join(ROWS), "header"),
    "one column": ("t\n0\n1\n", "'V2'"),
    "prose": ("Dear reader,\nthis is no log.\n", r"line 2 \(sample 0\) has 1 fields"),
    "column twice": (GOOD.replace("V3", "V2"), "'V2' twice"),
    "column missing": (GOOD.replace("eta2", "eta_2"), r"'eta2'.*'eta_2'.*map"),
    "column in capitals": (GOOD.replace("eta1", "ETA1"), r"'eta1' \(close: 'ETA1'"),
    "units line": (
        GOOD.replace(HEADER, HEADER + "\ns,V,V,m/s,rad/s"),
        r"line 2 holds no number \(s, V, V, .*units",
    ),
    "word in a cell": (GOOD.replace("0.25", "fast"), r"'eta1' has 'fast' at sample 3 \(line 5\)"),
    "date as time": (GOOD.replace("0.02,6,6,0", "2024-01-01,6,6,0"), "'t' has '2024-01-01'"),
    "fields missing": (GOOD.replace("0.04,6,6,0.1,0.01", "0.04,6,6"), r"line 4 \(sample 2\) has 3 fields"),
    "fields too many": (GOOD.replace("0.1,0.01", "0.1,0.01,9"), r"line 4 \(sample 2\) has 6 fields"),
    "decimal comma in comma": (GOOD.replace("0.25", "0,25"), "6 fields"),
    "time missing": (GOOD.replace("0.04,6", ",6"), "no time at sample 2"),
    "time repeated": (GOOD.replace("0.04,", "0.02,"), "repeats the previous time at sample 2"),
    "units, decimal commas": (
        "t;u\n[s];[N]\n0,0;1\n0,1;2\n0,2;2\n",
        r"line 2 holds no number \(\[s\], \[N\]\).*start it with #",
    ),
    "thousands": (GOOD.replace("0.04,6", '0.04,"6,000"'), "'V2' has '6,000' at sample 2"),
    "time backwards": (GOOD.replace("0.06,", "0.01,"), "runs backwards at sample 3"),
    "time constant": (GOOD.replace("\n0.0", "\n1.0").replace("1.02", "1.00"), "repeats"),
    "time infinite": (GOOD.replace("0.08,", "inf,"), "no time at sample 4"),
    "input missing at start": (GOOD.replace("0.00,0,", "0.00,,"), "'V2'.*no value at sample 0"),
    "inputs missing": (GOOD.replace("0.04,6", "0.04,").replace("0.06,6", "0.06,"), "'V2'.*sample 2.*gap of 2"),
    "input infinite": (GOOD.replace("0.04,6", "0.04,inf").replace("0.06,6", "0.06,nan"), "'V2'.*sample 2.*gap of 2"),
    "output never measured": (HEADER + "\n0,1,1,,0\n1,1,1,,0\n2,1,1,,0\n", "'eta1' has no measured value"),
    "quote never closed": (GOOD.replace("0.1,0.01", '"0.1,0.01'), "sample 2|cannot be read"),
    "spreadsheet": (b"PK\x03\x04" + bytes(200), "not a text file"),
    "json": ('{"t": [0, 1], "V2": [1, 1]}', "no column|header|empty|samples"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_broken_files_get_one_sentence_with_file_place_and_remedy(tmp_path, case):
    content, says = BROKEN[case]
    with pytest.raises(LogError, match=says) as caught:
        read_logs(_write(tmp_path / "run.csv", content), "pioneer")
    message = str(caught.value)
    assert "run.csv" in message and "\n" not in message
    assert any(mark in message for mark in ";:")  # what is wrong, then what to do
    assert type(caught.value) is LogError


@pytest.mark.parametrize("seed", range(40))
def test_random_damage_gives_a_log_or_a_log_error(tmp_path, seed):
    """Bytes changed, cut out or doubled at random: whatever comes, no other exception."""
    random = np.random.default_rng(seed)
    data = bytearray((GOOD + "\n").encode() * (1 + seed % 2))
    for _ in range(1 + seed % 5):
        start, length = int(random.integers(len(data))), int(random.integers(1, 12))
        kind = random.integers(3)
        if kind == 0:
            data[start : start + length] = random.integers(0, 256, length, dtype=np.uint8).tobytes()
        elif kind == 1:
            del data[start : start + length]
        else:
            data[start:start] = data[start : start + length]
    path = _write(tmp_path / "run.csv", bytes(data))
    try:
        log = read_logs(path, "pioneer")[0]
    except LogError as error:
        assert "run.csv" in str(error)
    else:
        assert np.isfinite(log.inputs).all() and np.all(np.diff(log.time) > 0)


@pytest.mark.parametrize(
    ("mapping", "says"),
    [
        ({"etal": "eta1"}, "'etal'.*close:.*'eta1'"),
        ({"eta1": "speed"}, r"'speed' \(mapped to 'eta1'\).*correct the mapping"),
        ({"eta1": 3}, "'eta1' is 3"),
        ({"eta1": {"column": "eta1", "factor": 2}}, "'factor'"),
        ({"eta1": {"scale": "2"}}, "scale = '2'"),
        ({"eta1": {"scale": 0}}, "zero"),
        ({"t": {"interval": -1}}, "zero or less"),
        ({"eta1": {"interval": 1}}, "'interval'"),
        ("missing.toml", "cannot be opened"),
        ("bad.toml", "not TOML"),
    ],
)
def test_wrong_mappings_say_what_is_wrong(tmp_path, mapping, says):
    path = _write(tmp_path / "run.csv", GOOD)
    (tmp_path / "bad.toml").write_text("V2 = = 3")
    with pytest.raises(LogError, match=says):
        read_logs(path, "pioneer", mapping=tmp_path / mapping if isinstance(mapping, str) else mapping)


def test_paths_that_lead_nowhere(tmp_path):
    _write(tmp_path / "turns.csv", GOOD)
    cases = {
        tmp_path / "turn.csv": "does not exist.*close: 'turns.csv'",
        tmp_path / "*.parquet": "No file matches",
        tmp_path: "is a folder",
        tmp_path / "absent" / "a.csv": "does not exist",
    }
    for path, says in cases.items():
        with pytest.raises(LogError, match=says):
            read_logs(path, "pioneer")
    with pytest.raises(LogError, match="No logs were given"):
        read_logs([], "pioneer")


def test_a_robots_class_reads_the_logs_of_the_robot_as_it_comes_or_says_why_not(tmp_path):
    from jaxid import DifferentialDrive, Pioneer

    file = tmp_path / "run.csv"
    rows = "".join(f"{0.02 * k:.2f},{k % 3},{k % 5},{0.1 * k},{0.01 * k}\n" for k in range(20))
    file.write_text("t,V2,V3,eta1,eta2\n" + rows)
    assert read_logs(file, Pioneer)[0].channels == read_logs(file, Pioneer())[0].channels
    with pytest.raises(LogError, match=r"DifferentialDrive is a class; .* such as DifferentialDrive\(\)"):
        read_logs(file, DifferentialDrive)
