"""Files that vanish, cannot be opened or written, disks that are full, and runs that are killed."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import jaxid
from jaxid import _atomic
from jaxid.model_file import read_model

from .good import Good
from .judge import Outcome, Verdict, judge_command, judge_log, judged, reference

NOBODY = 65534
_MODEL = "[parameters]\nM = 2.0\nFv = 3.0\nFc = 0.4\n"


@contextlib.contextmanager
def unprivileged() -> Iterator[None]:
    """Do without the rights of root, if they are there."""
    root = os.geteuid() == 0
    if root:
        os.seteuid(NOBODY)
    try:
        yield
    finally:
        if root:
            os.seteuid(0)


def reading(folder: Path, good: Good) -> Iterator[tuple[str, Verdict]]:
    """Paths that lead to no readable file. `folder` must be open to everyone."""
    reference(good)  # while temporary files can still be written
    path = folder / "run.csv"
    path.write_text(good.text)

    def paths() -> Iterator[Path]:
        yield path
        yield other
        path.unlink()  # every path was found by now, and none read

    other = folder / "other.csv"
    other.write_text(good.text)
    yield "vanishes before it is read", judged(lambda: _read(paths(), good), path.name)
    path.write_text(good.text)
    path.chmod(0)
    with unprivileged():
        yield "may not be read", judge_log(path, good)
    path.chmod(0o644)
    locked = folder / "locked"
    locked.mkdir()
    (locked / "run.csv").write_text(good.text)
    locked.chmod(0)
    with unprivileged():
        yield "in a folder that may not be entered", judge_log(locked / "run.csv", good)
        yield "pattern in such a folder", judged(lambda: _read(str(locked / "*.csv"), good), "*.csv")
    locked.chmod(0o755)
    (folder / "broken.csv").symlink_to(folder / "nowhere.csv")
    (folder / "loop.csv").symlink_to(folder / "loop.csv")
    os.mkfifo(folder / "pipe.csv")
    for kind, file in {
        "a folder": folder / "locked",
        "a link to nothing": folder / "broken.csv",
        "a link to itself": folder / "loop.csv",
        "a pipe": folder / "pipe.csv",
        "a device": Path("/dev/null"),
        "a name too long": folder / ("x" * 5000 + ".csv"),
        "a file as folder": path / "run.csv",
        "not there": folder / "rum.csv",
    }.items():
        yield kind, judge_log(file, good)
    yield "no pattern's match", judged(lambda: _read(str(folder / "*.parquet"), good), "*.parquet")
    for kind, file in {"not there": folder / "no.toml", "a folder": folder}.items():
        yield f"model {kind}", judged(lambda file=file: _model(file), file.name)
        yield f"mapping {kind}", judge_log(path, good, mapping=file)


def _read(paths: object, good: Good) -> Verdict:
    jaxid.read_logs(paths, good.robot)  # type: ignore[arg-type]
    return Verdict(Outcome.SILENT, "read")


def _model(path: Path) -> Verdict:
    read_model(path, jaxid.Axis())
    return Verdict(Outcome.SILENT, "read")


def _simulate(folder: Path, good: Good, out: Path) -> Verdict:
    log, model = folder / "drive.csv", folder / "model.toml"
    log.write_text(good.text)
    model.write_text(_MODEL)
    arguments = ["simulate", "axis", "--log", str(log), "--model", str(model), "--out", str(out)]
    return judge_command(arguments, out.name, (out,))


def writing(folder: Path, good: Good) -> Iterator[tuple[str, Verdict]]:
    """Results that cannot be written; what was there before must stay. `good` is an axis log."""
    file = folder / "a_file"
    file.write_text("old")
    fit = ["fit", "axis", "--fit", str(folder / "drive.csv"), "--out"]
    yield "a result that can be written", _simulate(folder, good, folder / "predicted.csv")
    yield "result into a folder that is not there", _simulate(folder, good, folder / "none" / "predicted.csv")
    yield "result is a folder", _simulate(folder, good, folder)
    yield "result's folder is a file", _simulate(folder, good, file / "predicted.csv")
    yield "results' folder is a file", judge_command([*fit, str(file)], file.name, (file,))
    yield "results' folder lies in a file", judge_command([*fit, str(file / "out")], file.name, (file,))
    closed = folder / "closed"
    closed.mkdir(mode=0o555)
    with unprivileged():
        yield "results' folder may not be written", judge_command([*fit, str(closed)], "closed")
        yield "results' folder may not be made", judge_command([*fit, str(closed / "out")], "closed")
    if Path("/dev/full").exists():
        with open("/dev/full", "w") as full, contextlib.suppress(OSError):
            yield "standard output is full", _print_to(full, folder, good)


def _print_to(full, folder: Path, good: Good) -> Verdict:
    """The demonstration of what `jaxid ... > /dev/full` does: a process of its own, whose stdout nobody replaces."""
    arguments = ["fit", "axis", "--fit", str(folder / "drive.csv"), "--out", str(folder / "out")]
    done = subprocess.run(
        [sys.executable, "-m", "jaxid.cli", *arguments], stdout=full, stderr=subprocess.PIPE, text=True, timeout=300
    )
    last = done.stderr.strip().splitlines()[-1]
    right = done.returncode == 1 and "Traceback" not in done.stderr and "Standard output" in last
    return Verdict(Outcome.REFUSED if right else Outcome.TRACEBACK, done.stderr)


@contextlib.contextmanager
def small_disk(folder: Path, size: str = "256k") -> Iterator[Path | None]:
    """A disk of a few pages mounted at `folder`; None where this process may not mount one."""
    folder.mkdir(exist_ok=True)
    mount = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)], capture_output=True)
    if mount.returncode:
        yield None
        return
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def full_disk(folder: Path, good: Good) -> Iterator[tuple[str, Verdict]]:
    """A disk that fills up while a result is written: an error with its name, and the old file stays."""
    with small_disk(folder / "disk") as disk:
        if disk is None:
            return
        old = disk / "predicted.csv"
        old.write_text("old")
        (disk / "filler").write_bytes(bytes(240 * 1024))
        yield "full while a prediction is written", _simulate(folder, good, old)

        def text() -> Verdict:
            _atomic.write_text(old, "x" * 500_000)
            return Verdict(Outcome.SILENT, "written")

        verdict = judged(text, old.name)
        left = [path.name for path in disk.iterdir() if path.name.endswith(".part")]
        whole = old.read_text() == "old" and not left
        yield "full while a text is written", verdict if whole else Verdict(Outcome.HALF, str(left))


_WRITER = """
import runpy, sys
write = runpy.run_path(sys.argv[1])["write_text"]
print("ready", flush=True)
while True:
    for letter in "ab":
        write(sys.argv[2], letter * 3_000_000)
"""


def killed(folder: Path, number: int) -> Verdict:
    """Kill a process that keeps writing one file, at a random moment: the file must be whole, or not there."""
    path = folder / f"killed_{number}.txt"
    with subprocess.Popen([sys.executable, "-c", _WRITER, _atomic.__file__, str(path)], stdout=subprocess.PIPE) as run:
        assert run.stdout is not None
        run.stdout.readline()
        time.sleep(random.Random(number).uniform(0.0, 0.05))
        run.send_signal(signal.SIGKILL)
        run.wait()
    text = path.read_text() if path.exists() else ""
    whole = text in ("", "a" * 3_000_000, "b" * 3_000_000)
    for left in folder.glob(f".{path.name}*"):
        left.unlink()
    return Verdict(Outcome.SAME if whole else Outcome.HALF, f"{len(text)} characters")
