"""What people read: results on stdout, everything else (progress, warnings, errors) on stderr."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter

import typer
from rich.console import Console

# One console for all remarks: what is printed while a spinner turns must go through the spinner's own.
_REMARKS = Console(stderr=True, highlight=False)


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
def step(title: str) -> Iterator[Callable[[str], None]]:
    """One stage of the work: a spinner while it lasts (on a terminal) and a line with its seconds at the end.

    Yields a function that reports a sentence from inside the stage.
    """
    began = perf_counter()

    def report(message: str) -> None:
        say(f"  {message} ({perf_counter() - began:.1f} s)", style="dim")

    with _REMARKS.status(f"{title} ..."):
        yield report
    say(f"{title}: {perf_counter() - began:.1f} s")
