"""Broken recordings: one sentence, or the samples up to where they break off and a finding; never a traceback."""

import gc
import shutil

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from benchmarks.fuzzing.mutations import edited, edits
from jaxid import LogError, read_logs
from jaxid.logs.look import look
from tests.recordings import Ros, ns, write_mat, write_wpilog

pytest.importorskip("rosbags", reason="bags are written by rosbags")
pytest.importorskip("wpiutil", reason="data logs are written by robotpy-wpiutil")

TIMES = np.round(np.arange(120) * 0.02, 6)
SPEED = np.round(np.sin(TIMES) + 0.01 * np.random.default_rng(1).normal(size=120), 4)
FIELDS = {"u": "/volts.data[0]", "v": "/odom.twist.twist.linear.x"}
FORMATS = ("bag", "mcap", "db3", "wpilog", "mat")
SETTINGS = hypothesis.settings(
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=25,
    suppress_health_check=[hypothesis.HealthCheck.function_scoped_fixture],
)


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """`sound(format)`: the bytes of a good recording of an axis, the mapping for it, and the log that it is."""
    place, made = tmp_path_factory.mktemp("sound"), {}

    def write(kind):
        if kind == "wpilog":
            entries = {"u": [(t + 1, float(k % 5)) for k, t in enumerate(TIMES)]}
            entries["v"] = [(t + 1, float(v)) for t, v in zip(TIMES, SPEED, strict=True)]
            return write_wpilog(place / "run.wpilog", entries), None
        if kind == "mat":
            return write_mat(place / "run.mat", {"t": TIMES, "u": np.arange(120.0) % 5, "v": SPEED}), None
        ros = Ros(1 if kind == "bag" else 2)
        topics = {
            "/volts": [(ns(t), ros.numbers([k % 5])) for k, t in enumerate(TIMES)],
            "/odom": [(ns(t), ros.odometry(ns(t), v, 0.0)) for t, v in zip(TIMES, SPEED, strict=True)],
        }
        file = ros.write(
            place / ("run.bag" if kind == "bag" else kind), topics, "mcap" if kind == "mcap" else "sqlite3"
        )
        return file, FIELDS

    def get(kind):
        if kind not in made:
            file, mapping = write(kind)
            made[kind] = file.read_bytes(), mapping, read_logs(file, "axis", mapping=mapping)[0]
        return made[kind]

    return get


def outcome(path, mapping):
    """The log or the sentence that a file ends in; a look at it ends in one, too."""
    try:
        look(path)
    except LogError as error:
        judge_sentence(error, path)
    try:
        return read_logs(path, "axis", mapping=mapping)[0]
    except LogError as error:
        judge_sentence(error, path)
        return None


def judge_sentence(error, path):
    said = str(error)
    assert said.startswith(str(path)) and said.endswith(".") and "\n" not in said and len(said) < 900, said


def ends_of_records(data):
    """Where the records of a data log end, by the bytes that say how long each is (WPILib's description of the format)."""
    place, ends = 12 + int.from_bytes(data[8:12], "little"), set()
    while place < len(data):
        widths = [(data[place] & 3) + 1, (data[place] >> 2 & 3) + 1, (data[place] >> 4 & 7) + 1]
        at = place + 1 + widths[0]
        size = int.from_bytes(data[at : at + widths[1]], "little")
        place = at + widths[1] + widths[2] + size
        ends.add(place)
    return ends


@pytest.mark.parametrize("kind", FORMATS)
def test_files_that_break_off(tmp_path, sound, kind):
    data, mapping, whole = sound(kind)
    path = tmp_path / f"run.{kind}"
    lengths = np.unique(np.concatenate([np.arange(0, 24, 6), np.linspace(24, len(data) - 1, 18).astype(int)]))
    for length in lengths:
        path.write_bytes(data[:length])
        log = outcome(path, mapping)
        if log is None:
            continue
        if len(log) == len(
            whole
        ):  # an SQLite file without its last page, which nothing stood on; MCAP without its index
            np.testing.assert_array_equal(log.outputs, whole.outputs)
            continue
        # Of this one chunk of MCAP all is left or nothing. One that ends between two records is a shorter data log.
        cut = "truncated" in {finding.check for finding in log.findings}
        assert kind == "wpilog" and (cut or length in ends_of_records(data))
        np.testing.assert_array_equal(log.output("v"), whole.output("v")[: len(log)])
    assert len(whole) == 120 and not [finding for finding in whole.findings if finding.severity != "note"]


@pytest.mark.parametrize("kind", FORMATS)
@SETTINGS
@hypothesis.given(data=st.data())
@pytest.mark.filterwarnings("ignore")  # SciPy warns of damaged names; what counts is the sentence
def test_bytes_that_are_not_what_they_were(tmp_path, sound, kind, data):
    good, mapping, whole = sound(kind)
    path = tmp_path / f"run.{kind}"
    path.write_bytes(edited(good, data.draw(edits(len(good)))))
    log = outcome(path, mapping)
    # A number within a message may be another one, which nobody could see; its samples are still those of a log.
    assert log is None or 2 <= len(log) <= 3 * len(whole)


def test_a_damaged_folder(tmp_path, sound):
    data, mapping, whole = sound("mcap")
    ros = Ros()
    topics = {
        "/volts": [(ns(t), ros.numbers([k % 5])) for k, t in enumerate(TIMES)],
        "/odom": [(ns(t), ros.odometry(ns(t), v, 0.0)) for t, v in zip(TIMES, SPEED, strict=True)],
    }
    file = ros.write(tmp_path / "run", topics)
    metadata = file.parent / "metadata.yaml"
    text = metadata.read_text()
    for broken in ("", "a: [", text[:200], text.replace("mcap", "nothing"), "rosbag2_bagfile_information: 3"):
        metadata.write_text(broken)
        assert outcome(file.parent, mapping) is None
    metadata.write_text(text)
    file.unlink()
    assert outcome(file.parent, mapping) is None
    shutil.rmtree(file.parent)
    with pytest.raises(LogError, match="does not exist"):
        read_logs(file.parent, "axis", mapping=mapping)


def test_what_a_broken_file_opened_is_closed_again(tmp_path, sound):
    data, mapping, _ = sound("db3")
    path = tmp_path / "run.db3"
    path.write_bytes(data[: len(data) // 2])
    assert outcome(path, mapping) is None
    gc.collect()  # a file or base left open would warn here, and warnings are errors
    path.unlink()
