"""The work behind a live view: logs are read as they come, and what depends on them is worked out again, and nothing else."""

import shlex
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from ..checks.among import among
from ..estimate.linear.integral_least_squares import integral_least_squares
from ..estimate.output_error.output_error import output_error
from ..estimate.result import Fit
from ..explanation.explain import explain, without_windows
from ..logs import Finding, Log, LogError, LogSet, noise_scale, read_logs
from ..parameters import ParameterError
from ..report import compare
from ..report.comparing import on_fitted
from ..robots import Robot
from . import parts
from .board import Board, State
from .folder import LogFolder, Signature

_PAUSE = 0.4
"""Seconds between two looks at the folder; a file that changes meanwhile is still being written."""


class _Restart(BaseException):
    """The logs have changed while something was worked out from them. No `Exception`: nothing is to catch it."""


@dataclass(frozen=True)
class ReadLog:
    """One file: the log, or why it cannot be read; what pre-flight finds; whether it is held out."""

    name: str
    log: Log | None
    error: str
    findings: tuple[Finding, ...]
    held_out: bool

    @property
    def usable(self) -> bool:
        """Whether an estimate from it means anything."""
        return self.log is not None and not any(finding.severity == "error" for finding in self.findings)


def together(read: Sequence[ReadLog]) -> list[ReadLog]:
    """The logs without the dead sensors that the others show to be none, as a set of logs has it."""
    logs = [own.log for own in read if own.log is not None]
    left = set(among(logs, [own.findings for own in read if own.log is not None]))
    return [replace(own, findings=tuple(found for found in own.findings if found in left)) for own in read]


@dataclass(frozen=True)
class Task:
    """What to work out: the `folder`; the robot, as logs with these paths measure it; `mapping` of columns; patterns of the
    names of logs that are `held_out`; the `command` that explains the same, but for the logs."""

    folder: LogFolder
    robot: Callable[[list[str]], Robot]
    mapping: Path | None
    held_out: Sequence[str]
    command: Sequence[str] = ()


class Work(threading.Thread):
    """Follows the folder until it is stopped; what it finds goes onto the board."""

    def __init__(self, task: Task, board: Board):
        super().__init__(daemon=True, name="jaxid live")
        self._task, self._board = task, board
        self._stopped = threading.Event()
        self._seen: dict[str, Signature] = {}
        self._settled: dict[str, Signature] = {}
        self._looked = 0.0
        self._files: dict[str, tuple[Any, ReadLog]] = {}
        self._fitted: tuple[Any, tuple[Fit, ...]] = (None, ())

    def stop(self) -> None:
        """End the work at its next report."""
        self._stopped.set()

    def run(self) -> None:
        done: dict[str, Signature] | None = None
        while not self._stopped.is_set():
            self._look()
            if self._settled != done:
                done = dict(self._settled)
                try:
                    self._work_out()
                except _Restart:
                    done = None
            else:
                self._stopped.wait(_PAUSE)

    # -- the folder ----------------------------------------------------------------------------------------------------
    def _look(self) -> None:
        """The files as they are; those that were the same a moment ago count."""
        if time.monotonic() - self._looked < _PAUSE:
            return
        try:
            now = self._task.folder.files()
        except OSError as error:
            self._board.tell("logs", "failed", f"The folder cannot be read ({error.strerror}).")
            now = {}
        changed = {name for name in now if self._seen.get(name) != now[name]}
        kept = {name: own for name, own in self._settled.items() if name in now}
        self._settled = kept | {name: own for name, own in now.items() if name not in changed}
        self._seen, self._looked = now, time.monotonic()

    def _others(self) -> tuple[str, ...]:
        try:
            return self._task.folder.others()
        except OSError:
            return ()

    def _say(self, part: str) -> Callable[[str], None]:
        """A function that shows what is being done, and ends it where the logs have changed or nobody wants it any more."""
        before = dict(self._settled)

        def report(message: str) -> None:
            self._look()
            if self._stopped.is_set() or self._settled != before:
                raise _Restart
            self._board.tell(part, "running", message)

        return report

    def _read(self, name: str, signature: Signature, robot: Robot) -> ReadLog:
        kept, key = self._files.get(name), (signature, robot.channels)
        if kept is not None and kept[0] == key:
            return kept[1]
        held_out = any(fnmatch(name, pattern) for pattern in self._task.held_out)
        try:
            logs = read_logs([str(self._task.folder.path / name)], robot, mapping=self._task.mapping)
        except LogError as error:
            found = ReadLog(name, None, str(error), (), held_out)
        else:
            found = ReadLog(name, logs[0], "", tuple(logs.preflight()), held_out)
        self._files[name] = key, found
        return found

    # -- the steps -----------------------------------------------------------------------------------------------------
    def _work_out(self) -> None:
        files = dict(sorted(self._settled.items()))
        say = self._say("logs")
        for name in ("fit", "gap", "explanation"):
            self._board.tell(name, "waiting", "Waiting for what comes before it.")
        robot: Robot | None = None
        read: list[ReadLog] = []
        try:
            robot = self._task.robot([str(self._task.folder.path / name) for name in files])
            for name, signature in files.items():
                say(f"reading {name}")
                read.append(self._read(name, signature, robot))
        except (LogError, ParameterError, ValueError) as error:
            self._board.tell("logs", "failed", str(error))
        read = together(read)
        good = [own for own in read if own.usable and own.log is not None]
        fit, held_out = ([own.log for own in good if own.held_out is role and own.log] for role in (False, True))
        if robot is not None:
            words = f"{len(fit)} to fit, {len(held_out)} held out" if read else "none yet"
            bad = len(read) - len(good)
            words += f", {bad} left out" if bad else ""
            self._board.tell("logs", "done" if read else "waiting", words, parts.logs_html(read, self._others()))
        steps = {"fit": self._fit, "gap": self._gap, "explanation": self._explanation}
        going = robot is not None
        for name, step in steps.items():
            state, words, html, report = "waiting", "", "", ""
            if going:
                state, words, html, report = self._one(name, step, robot, fit, held_out)
                going = state == "done"
            self._board.keep_report(name, report)
            self._board.tell(name, state, words, html)

    def _one(
        self, name: str, step: Any, robot: Any, fit: list[Log], held_out: list[Log]
    ) -> tuple[State, str, str, str]:
        """What a step comes to: its state, what is said of it, its part of the page, its whole report."""
        missing = "Waiting for logs to fit." if not fit else ""
        if fit and not held_out and name != "fit":
            patterns = " or ".join(self._task.held_out)
            missing = f"No log is held out: name some {patterns}, and they will judge the model."
        if missing:
            return "waiting", missing, "", ""
        say = self._say(name)
        say("starting")
        try:
            page = step(robot, LogSet(fit), LogSet(held_out) if held_out else None, say)
        except (LogError, ParameterError) as error:
            return "failed", str(error), "", ""
        except Exception as error:
            traceback.print_exc()  # on the terminal, for the report that somebody may write
            return (
                "failed",
                f"This is a bug of jaxid's ({type(error).__name__}: {error}); the terminal has more.",
                "",
                "",
            )
        return "done", "", parts.report_html(name, page), parts.whole_report(page)

    def _estimates(self, robot: Robot, fit: LogSet, say: Callable[[str], None]) -> tuple[Fit, ...]:
        key = robot, tuple((log.name, log.sha256) for log in fit)
        if self._fitted[0] != key:
            fits: list[Fit] = []
            say("integral least squares")
            try:
                fits.append(integral_least_squares(robot, fit))
            except (ParameterError, LogError) as error:
                say(f"integral least squares is left out: {error}")
            say("output error")
            fits.append(output_error(robot, fit, start=fits[-1] if fits else None, report=say))
            self._fitted = key, tuple(fits)
        return self._fitted[1]

    def _fit(self, robot: Robot, fit: LogSet, held_out: LogSet | None, say: Callable[[str], None]) -> Any:
        from ..report.comparison_page import fits_page  # and matplotlib with it, once there is something to draw

        fits = self._estimates(robot, fit, say)
        say("simulating the fitted logs")
        noise = noise_scale(fit)
        return fits_page(fits, fit, on_fitted({own.method: own for own in fits}, fit, noise), noise)

    def _gap(self, robot: Robot, fit: LogSet, held_out: LogSet, say: Callable[[str], None]) -> Any:
        from ..report.comparison_page import comparison_page

        fits = self._estimates(robot, fit, say)
        say("predicting the held-out logs")
        return comparison_page(compare(*fits, held_out=held_out, fit=fit), "fit")

    def _explanation(self, robot: Robot, fit: LogSet, held_out: LogSet, say: Callable[[str], None]) -> Any:
        from ..report.document import Code, Text
        from ..report.explanation_page import page_of

        baseline = without_windows(self._estimates(robot, fit, say)[-1], fit, say)
        page = page_of(explain(baseline, fit, held_out, report=say))
        paths = [[str(self._task.folder.path / log.name) for log in logs] for logs in (fit, held_out)]
        command = [*self._task.command, "--fit", *paths[0], "--held-out", *paths[1], "--out", "results"]
        keep = "The page keeps nothing. This writes the report, the model, and an experiment to drive where one is proposed:"
        return replace(page, next=(Text(keep), Code(shlex.join(command)), *page.next))
