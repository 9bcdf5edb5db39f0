"""jaxid/cli/console.py: what a stage says while it works, and how wide text is."""

import io
import os
import pty
import re
import shutil
import sys

import pytest
from rich.console import Console

from jaxid.cli import console
from jaxid.report import tables
from jaxid.report.tables import Cell, Table


@pytest.fixture
def clock(monkeypatch):
    """Seconds that pass as a test wants."""
    now = [0.0]
    monkeypatch.setattr(console, "perf_counter", lambda: now[0])
    return now


def test_a_stage_reports_what_it_does_and_how_long_it_took(capsys, clock):
    with console.step("Explanation") as report:
        clock[0] = 2.0
        report("looking [at] the gap")
        clock[0] = 3.5
    assert capsys.readouterr().err.splitlines() == ["  looking [at] the gap (2.0 s)", "Explanation: 3.5 s"]


def test_of_quick_counts_some_are_printed_and_the_last_always(capsys, clock):
    with console.step("Design") as report:
        for number in range(1, 61):
            clock[0] += 0.5
            report(f"{number} of 60 rounds")
    said = [int(n) for n in re.findall(r"^  (\d+) of", capsys.readouterr().err, flags=re.M)]
    assert said[0] == 1 and said[-1] == 60
    assert all(5.0 <= 0.5 * (b - a) <= 5.5 for a, b in zip(said[:-2], said[1:-1], strict=True))


def test_on_a_terminal_every_message_shows_beside_the_spinner(monkeypatch):
    file = io.StringIO()
    monkeypatch.setattr(console, "_REMARKS", Console(file=file, force_terminal=True, width=60, highlight=False))
    with console.step("Design") as report:
        report("1 of 3 rounds")
        report("2 of 3 rounds, log det [95.1]")
        import time

        time.sleep(0.25)
    shown = re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", file.getvalue())
    assert "Design: 2 of 3 rounds, log det [95.1]" in shown and "Design: 0." in shown


WIDE = Table("T", ("name", "words"), ((Cell("a"), Cell("many words " * 20)),), ("note " * 40,))


def longest(text):
    return max(map(len, text.splitlines()))


def test_text_is_as_wide_as_the_terminal_and_100_columns_elsewhere(monkeypatch):
    monkeypatch.setenv("COLUMNS", "140")
    assert 90 < longest(tables.to_text([WIDE])) <= 100  # captured: not a terminal
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    for columns in (140, 72):
        monkeypatch.setenv("COLUMNS", str(columns))
        assert columns - 15 < longest(tables.to_text([WIDE])) <= columns
    monkeypatch.setenv("COLUMNS", "20")
    assert tables.columns() == 60


def test_headings_are_broken_between_their_words_where_there_is_room_for_these():
    header = ("method", "normalised RMS", *(f"RMS speed_{k} [rad/s]" for k in range(5)))
    table = Table("T", header, ((Cell("output error"), *[Cell("0.99")] * 6),))
    lines = tables.to_text([table], width=80).splitlines()
    assert longest("\n".join(lines)) <= 80 and any("normalised" in line for line in lines)
    assert sum(line.count(f"speed_{k}") for line in lines for k in range(5)) == 5
    assert any("normalised RMS" in line for line in tables.to_text([table], width=200).splitlines())


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX's")
def test_a_table_with_more_columns_than_there_is_room_for_goes_on_below():
    """A number that is broken within a cell reads as another one."""
    names = [f"RMS n_{wheel} [rpm]" for wheel in ("fl", "fr", "rl", "rr")] * 4
    rows = tuple(
        (Cell(name), *(Cell(f"0.{k:02d}7") for k in range(len(names)))) for name in ("output error", "noise floor")
    )
    text = tables.to_text([Table("Prediction", ("method", *names), rows, ("below it all",))], width=100)
    assert all(len(line) <= 100 for line in text.splitlines())
    assert all(text.count(f"0.{k:02d}7") == 2 for k in range(len(names)))
    assert text.count("output error") == text.count("noise floor") == text.count("method") == 2
    assert text.count("Prediction") == 1 and text.endswith("below it all")
    # Words are folded as they were.
    words = Table("Found", ("effect", "what it is"), ((Cell("drag"), Cell("one word after another " * 8)),))
    assert tables.to_text([words], width=60).count("effect") == 1


def test_a_real_terminals_width_is_asked_for(monkeypatch):
    import fcntl
    import struct
    import termios

    monkeypatch.delenv("COLUMNS", raising=False)
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 87, 0, 0))
    with os.fdopen(theirs, "w") as terminal:
        monkeypatch.setattr(sys, "stdout", terminal)
        monkeypatch.setattr(sys, "__stdout__", terminal)
        assert shutil.get_terminal_size().columns == tables.columns() == 87
        monkeypatch.undo()
    os.close(ours)
