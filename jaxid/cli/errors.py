"""Errors of the command line: input that cannot be used is one line; anything else is a bug and keeps its traceback."""

import errno
import warnings
from collections.abc import Callable
from functools import wraps
from typing import Any

import typer

from .arguments import UnusableInput
from .console import complain, spinner

_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)
"""Reasons why the results cannot be printed; other errors without a file are bugs."""


def one_line_errors(command: Callable[..., None]) -> Callable[..., None]:
    """Input that cannot be used is one line on stderr and exit status 1; anything else is a bug and keeps its traceback."""

    @wraps(command)
    def run(*args: Any, **options: Any) -> None:
        with spinner("Starting"):
            from ..logs import LogError, LogWarning
            from ..model_file import ModelFileError  # and JAX with it, which takes seconds
            from ..parameters import ParameterError

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", LogWarning)  # `findings` prints what they say, a line each
                command(*args, **options)
        except (LogError, ParameterError, ModelFileError, UnusableInput) as error:
            complain(str(error))
            raise typer.Exit(1) from None
        except BrokenPipeError:
            raise
        except OSError as error:
            if error.filename is None and error.errno not in _DISK:
                raise
            place = error.filename or "Standard output"
            complain(f"{place} cannot be used ({error.strerror}); check the path, its permissions and the disk.")
            raise typer.Exit(1) from None

    return run
