"""What jaxid made of a broken input, as one of a few outcomes; the benchmark counts them and the tests assert them."""

import contextlib
import io
import signal
import tomllib
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import jaxid
from jaxid.cli import main
from jaxid.logs import Log, LogError, LogSet
from jaxid.model_file import ModelFileError, read_model
from jaxid.parameters import ParameterError
from jaxid.robots import Robot

from .good import Good
from .plain_reader import plain_values, visible

SECONDS = 60
"""Longest that a case may take (compiling included; a million rows have more)."""


class Outcome(StrEnum):
    """What came of a broken input."""

    SAME = "same numbers"
    TOLD = "finding"
    REFUSED = "error"
    UNSEEN = "change that nobody could see"
    """A random change that leaves a plausible file which says the other numbers: no case, and not counted."""
    SILENT = "wrong in silence"
    LOST = "harmless and refused"
    SENTENCE = "bad error message"
    TRACEBACK = "traceback"
    NUMPY = "warning of a library"
    HANG = "hang"
    HALF = "half a file"


RIGHT = frozenset({Outcome.SAME, Outcome.TOLD, Outcome.REFUSED})


@dataclass(frozen=True)
class Verdict:
    """An outcome and what was said."""

    outcome: Outcome
    said: str = ""

    @property
    def right(self) -> bool:
        """Whether it is an outcome that a broken input may have."""
        return self.outcome in RIGHT


class Hang(Exception):
    """A case took too long."""


@contextlib.contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise `Hang` in the main thread after so many seconds."""

    def stop(*_: Any) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def one_sentence(said: str, *places: str) -> bool:
    """Whether an error is one line that names one of the places and has a remedy after a semicolon or colon."""
    return (
        any(place in said for place in places)
        and said.isprintable()
        and len(said) <= 1000
        and any(mark in said for mark in ";:")
    )


def judged(work: Callable[[], Verdict], *places: str, seconds: float = SECONDS) -> Verdict:
    """The verdict of `work`, or the one that its exception deserves; an error's sentence must name one of `places`."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            with time_limit(seconds):
                verdict = work()
        except (LogError, ModelFileError, ParameterError) as error:
            said = str(error)
            verdict = Verdict(Outcome.REFUSED if one_sentence(said, *places) else Outcome.SENTENCE, said)
        except Hang:
            return Verdict(Outcome.HANG)
        except OSError as error:
            if error.filename is None:
                return Verdict(Outcome.TRACEBACK, traceback.format_exc())
            verdict = Verdict(Outcome.REFUSED, str(error))
        except Exception:
            return Verdict(Outcome.TRACEBACK, traceback.format_exc())
    leaked = [w for w in caught if issubclass(w.category, RuntimeWarning)]
    if leaked:
        where = f"{leaked[0].filename}:{leaked[0].lineno}"
        return Verdict(Outcome.NUMPY, f"{leaked[0].message} at {where} ({verdict.outcome}: {verdict.said})")
    return verdict


@cache
def reference(good: Good) -> tuple[Log, Counter[tuple[str, str | None]]]:
    """The good log as it reads, and what pre-flight says about it anyway."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "good.csv"
        path.write_text(good.text, encoding="utf-8")
        logs = jaxid.read_logs(path, good.robot)
    return logs[0], Counter((f.check, f.column) for f in logs.preflight())


def same_numbers(one: Log, other: Log) -> bool:
    """Whether two logs hold exactly the same times, inputs and outputs."""
    return (
        np.array_equal(one.time, other.time)
        and np.array_equal(one.inputs, other.inputs)
        and np.array_equal(one.outputs, other.outputs, equal_nan=True)
    )


def _sound_fit(logs: LogSet, robot: str) -> bool:
    """Whether integral least squares gives finite numbers for all that it calls identified, or refuses in a sentence."""
    try:
        fit = jaxid.integral_least_squares(ROBOTS[robot](), logs)
    except (LogError, ParameterError) as error:
        return one_sentence(str(error), "")
    found = [estimate for estimate in fit.parameters.values() if estimate.status == "identified"]
    return all(np.isfinite([estimate.value, estimate.std_error]).all() for estimate in found)


_MODEL_KEYS = ("value", "free", "lower", "upper", "prior")
ROBOTS: dict[str, type[Robot]] = {"pioneer": jaxid.Pioneer, "omni": jaxid.Omni, "axis": jaxid.Axis}


def judge_log(
    path: Path,
    good: Good,
    *,
    harmless: bool = False,
    by_chance: bool = False,
    fit: bool = False,
    mapping: Path | None = None,
    seconds: float = SECONDS,
) -> Verdict:
    """Read, look over, batch (and with `fit` identify from) a broken file of a good log.

    A `harmless` one must read as the same numbers. One that is broken `by_chance` may say other numbers, if they are
    literally what stands there and no careful reader of the file could doubt them.
    """
    whole, usual = reference(good)

    def work() -> Verdict:
        logs = jaxid.read_logs(path, good.robot, mapping=mapping)
        findings = logs.preflight()
        logs.batch()
        new = Counter((f.check, f.column) for f in findings) - usual
        said = "; ".join(f"{check} {column or ''}".strip() for check, column in new)
        if any(not one_sentence(f.message, path.name) for f in findings):
            return Verdict(Outcome.SENTENCE, said)
        if fit and not _sound_fit(logs, good.robot):
            return Verdict(Outcome.SILENT, "an identified parameter is not finite")
        if same_numbers(logs[0], whole):
            return Verdict(Outcome.SAME, said)
        if harmless:
            return Verdict(Outcome.LOST, f"other numbers; {said}")
        if new:
            return Verdict(Outcome.TOLD, said)
        if by_chance and _literal(path, good, logs[0]) and not visible(good, logs[0]):
            return Verdict(Outcome.UNSEEN)
        return Verdict(Outcome.SILENT, _apart(logs[0], whole))

    places = (path.name,) if mapping is None else (path.name, mapping.name, "The mapping")
    verdict = judged(work, *places, seconds=seconds)
    return Verdict(Outcome.LOST, verdict.said) if harmless and verdict.outcome is Outcome.REFUSED else verdict


def _apart(one: Log, other: Log) -> str:
    """Where two logs differ first."""
    if len(one) != len(other):
        return f"{len(one)} rows for {len(other)}"
    pairs = {
        "time": (one.time, other.time),
        "inputs": (one.inputs, other.inputs),
        "outputs": (one.outputs, other.outputs),
    }
    for name, (a, b) in pairs.items():
        where = np.argwhere(~((a == b) | (np.isnan(a) & np.isnan(b))))
        if len(where):
            place = tuple(int(k) for k in where[0])
            return f"{name} {place}: {a[place]} for {b[place]} ({len(where)} such)"
    return ""


def _literal(path: Path, good: Good, log: Log) -> bool:
    """Whether a plain reader finds the log's numbers in the file (Parquet and gzip: nobody else can say)."""
    data = path.read_bytes()
    if data[:4] == b"PAR1" or data[:2] == b"\x1f\x8b":
        return True
    plain = plain_values(data, ("t", *log.channels.inputs, *log.channels.measured))
    read = np.concatenate([log.time[:, None], log.inputs, log.outputs], axis=1)
    return plain is not None and np.array_equal(plain, read, equal_nan=True)


def judge_model(path: Path, robot: Robot, *, odd: bool = False, by_chance: bool = False) -> Verdict:
    """Read a model file of `robot` that is broken, or only `odd` (then it must leave the robot as it is).

    One that is broken `by_chance` may give other numbers, if they are those that stand in the file.
    """

    def work() -> Verdict:
        found = read_model(path, robot)
        alike = found.parameters == robot.parameters and found.effects == robot.effects
        said = repr(found.parameters)
        if odd or alike:
            return Verdict(Outcome.SAME if alike else Outcome.LOST, said)
        return Verdict(Outcome.UNSEEN if by_chance and _as_written(path, found) else Outcome.SILENT, said)

    verdict = judged(work, path.name)
    return Verdict(Outcome.LOST, verdict.said) if odd and verdict.outcome is Outcome.REFUSED else verdict


def _as_written(path: Path, found: Robot) -> bool:
    """Whether each parameter of the robot is what the file says, as far as it says something."""
    entries = tomllib.loads(path.read_text(encoding="utf-8-sig")).get("parameters", {})
    for name, entry in entries.items():
        entry = entry if isinstance(entry, dict) else {"value": entry}
        said = {key: tuple(v) if isinstance(v, list) else v for key, v in entry.items() if key in _MODEL_KEYS}
        if any(getattr(found.parameters[name], key) != value for key, value in said.items()):
            return False
    return True


def judge_command(arguments: list[str], place: str, results: tuple[Path, ...] = (), seconds: float = 60) -> Verdict:
    """Run a command line in this process: a result, whole, or exit status 1 or 2 and a line that says why."""
    before = {path: path.read_bytes() if path.is_file() else None for path in results}
    out, err = io.StringIO(), io.StringIO()

    def work() -> Verdict:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                main(arguments)
            except SystemExit as end:
                status = end.code or 0
        said = err.getvalue()
        if status not in (0, 1, 2) or "Traceback" in said:
            return Verdict(Outcome.TRACEBACK, said)
        if status == 0:
            return Verdict(Outcome.TOLD if "warning:" in said or "error:" in said else Outcome.SAME, said)
        if any((path.read_bytes() if path.is_file() else None) != content for path, content in before.items()):
            return Verdict(Outcome.HALF, said)
        lines = [line for line in said.splitlines() if line.startswith("jaxid: ")]
        clear = status == 2 or (len(lines) == 1 and one_sentence(lines[0], place))
        return Verdict(Outcome.REFUSED if clear else Outcome.SENTENCE, said)

    return judged(work, place, seconds=seconds)
