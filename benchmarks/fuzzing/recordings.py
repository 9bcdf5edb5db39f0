"""Recordings that break off, or whose bytes are not what they were: bags of ROS 1 and ROS 2, data logs, MATLAB files.

A good one of each format, of an axis, is written by a library that is not ours; half of the breakages end it early.
"""

from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import jaxid
from jaxid.logs import Log
from jaxid.logs.look import look

from .corpus import Case
from .judge import Outcome, Verdict, judged, one_sentence, same_numbers
from .mutations import drawn, edited, edits

FORMATS = ("bag", "mcap", "db3", "wpilog", "mat")
_TIMES = np.round(np.arange(120) * 0.02, 6)
_SPEED = np.round(np.sin(_TIMES) + 0.01 * np.random.default_rng(1).normal(size=120), 4)
_FIELDS = {"u": "/volts.data[0]", "v": "/odom.twist.twist.linear.x"}


@cache
def good_recording(kind: str) -> tuple[bytes, dict[str, str] | None, Log, Counter[tuple[str, str | None]]]:
    """A good recording: its bytes, the mapping that it needs, the log that it is, and what is said of it anyway."""
    from tests.recordings import Ros, ns, write_mat, write_wpilog  # the writers of rosbags, wpiutil and SciPy

    with TemporaryDirectory() as folder:
        place = Path(folder)
        mapping = None if kind in ("wpilog", "mat") else _FIELDS
        if kind == "wpilog":
            columns = {"u": np.arange(120.0) % 5, "v": _SPEED}
            rows = {n: [(t + 1, float(x)) for t, x in zip(_TIMES, own, strict=True)] for n, own in columns.items()}
            path = write_wpilog(place / "run.wpilog", rows)
        elif kind == "mat":
            path = write_mat(place / "run.mat", {"t": _TIMES, "u": np.arange(120.0) % 5, "v": _SPEED})
        else:
            ros = Ros(1 if kind == "bag" else 2)
            topics = {
                "/volts": [(ns(t), ros.numbers([k % 5])) for k, t in enumerate(_TIMES)],
                "/odom": [(ns(t), ros.odometry(ns(t), v, 0.0)) for t, v in zip(_TIMES, _SPEED, strict=True)],
            }
            name = "run.bag" if kind == "bag" else "run"
            path = ros.write(place / name, topics, "mcap" if kind == "mcap" else "sqlite3")
        logs = jaxid.read_logs(path, "axis", mapping=mapping)
        return path.read_bytes(), mapping, logs[0], Counter((f.check, f.column) for f in logs.preflight())


def judge_recording(path: Path, kind: str) -> Verdict:
    """Look at, read, look over and batch a broken recording.

    Its numbers are eight bytes each, of which another one is a number as good; where the format has no check sum over them,
    as all but MCAP's chunks, nobody could see that. What is there must still be a log of as many samples or fewer.
    """
    _, mapping, whole, usual = good_recording(kind)

    def work() -> Verdict:
        look(path)
        logs = jaxid.read_logs(path, "axis", mapping=mapping)
        findings = logs.preflight()
        logs.batch()
        new = Counter((f.check, f.column) for f in findings) - usual
        said = "; ".join(f"{check} {column or ''}".strip() for check, column in new)
        if any(not one_sentence(f.message, path.name) for f in findings):
            return Verdict(Outcome.SENTENCE, said)
        log = logs[0]
        if same_numbers(log, whole):
            return Verdict(Outcome.SAME, said)
        if new:
            return Verdict(Outcome.TOLD, said)
        if kind != "mcap" and len(log) <= len(whole):
            return Verdict(Outcome.UNSEEN)
        return Verdict(Outcome.SILENT, f"{len(log)} samples instead of {len(whole)}, or other numbers")

    return judged(work, path.name)


def broken_recordings(count: int, number: int) -> Iterator[Case]:
    """`count` recordings, as many of each format: cut at even distances, and with random bytes."""
    each = max(count // len(FORMATS) // 2, 1)
    for f, kind in enumerate(FORMATS):
        data = good_recording(kind)[0]
        for length in np.linspace(0, len(data) - 1, each).astype(int):
            yield _case(kind, "cut", data[:length])
        for changes in drawn(edits(len(data)), each, number + f):
            yield _case(kind, "random bytes", edited(data, changes))


def _case(kind: str, name: str, data: bytes) -> Case:
    def judge(folder: Path) -> Verdict:
        path = folder / f"run.{kind}"
        path.write_bytes(data)
        return judge_recording(path, kind)

    return Case(
        "recording that breaks off" if name == "cut" else "random bytes of a recording", f"{name}: {kind}", kind, judge
    )
