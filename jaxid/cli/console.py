"""What people read: results on stdout, everything else (progress, warnings, errors) on stderr."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Column

# One console for all remarks: what is printed while a spinner turns must go through the spinner's own.
_REMARKS = Console(stderr=True, highlight=False)
_COUNT = re.compile(r"\b(\d+) of (\d+)\b")
_SELDOM = 5.0
"""Seconds between lines of one count."""


def show(text: str) -> None:
    """A result on stdout, as it is."""
    typer.echo(text)


def say(message: str, style: str | None = None) -> None:
    """One line on stderr, never wrapped."""
    _REMARKS.print(message.replace("\n", " "), style=style, markup=False, soft_wrap=True)


def complain(message: str) -> None:
    """Why there is no result, in one line."""
    say(f"jaxid: {message}", style="bold red")


@contextmanager
def spinner(title: str) -> Iterator[Callable[[str], None]]:
    """On a terminal, a line that turns with the seconds so far while something lasts, and goes when it ends. Yields a function
    that changes what it says."""
    shown = TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=True, overflow="ellipsis"))
    turning = Progress(
        SpinnerColumn(), shown, TimeElapsedColumn(), console=_REMARKS, transient=True, disable=not _REMARKS.is_terminal
    )
    with turning:
        task = turning.add_task(title, total=None)
        yield lambda description: turning.update(task, description=description)


@contextmanager
def step(title: str) -> Iterator[Callable[[str], None]]:
    """One stage of the work: a spinner with what is being done, and a line with its seconds at the end.

    Yields a function that reports a sentence from inside the stage, which stays as a line of its own; of counts such as
    "3 of 60 rounds" in quick succession only some do.
    """
    began, last = perf_counter(), -_SELDOM
    with spinner(title) as turn:

        def report(message: str) -> None:
            nonlocal last
            turn(f"{title}: {message}")
            now, count = perf_counter() - began, _COUNT.search(message)
            if now - last < _SELDOM and count and count[1] != count[2]:
                return
            last = now
            say(f"  {message} ({now:.1f} s)", style="dim")

        yield report
    say(f"{title}: {perf_counter() - began:.1f} s")
