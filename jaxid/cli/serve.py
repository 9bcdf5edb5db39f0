"""`jaxid serve`: a page in the browser that follows a folder of logs, until it is stopped."""

import signal
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from ..live.board import Board
from ..live.folder import LogFolder
from ..live.server import Server
from ..live.work import Task, Work
from .arguments import UnusableInput, load_robot
from .cache import keep_compiled_programs
from .console import say, show
from .fit import identifiable
from .folder import try_folder

_PATIENCE = 5.0
"""Seconds that a stage of the work gets to end."""


def run_serve(
    spec: str, folder: Path, held_out: Sequence[str], model: Path | None, mapping: Path | None, port: int
) -> None:
    """Serve the page of `folder` (made if missing) on the loopback address until Ctrl-C. Raises `UnusableInput` for a port
    that is taken."""
    keep_compiled_programs()
    identifiable(spec, model, (), mapping)  # a mistake in it is told before the page is opened
    try_folder(folder)
    logs, board = LogFolder(folder.resolve()), Board()
    given = [f"{flag}={path}" for flag, path in (("--model", model), ("--map", mapping)) if path is not None]
    command = ["jaxid", "explain", spec, *given]
    task = Task(logs, lambda paths: identifiable(spec, model, paths, mapping), mapping, held_out, command)
    try:
        server = Server(logs, board, f"jaxid serve: {load_robot(spec).name}", port)
    except OSError as error:
        raise UnusableInput(f"Port {port} cannot be used ({error.strerror}); give another --port.") from None
    work = Work(task, board)
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with suppress(KeyboardInterrupt):
            work.start()
            say(f"Open {server.address}; logs go into {logs.path}, held out are {' '.join(held_out)}. Ctrl-C ends it.")
            show(server.address)
            server.serve_forever(poll_interval=0.2)
    finally:
        signal.signal(signal.SIGTERM, before)
        say("stopping")
        work.stop()
        server.close()
        if work.ident is not None:
            work.join(_PATIENCE)
