"""The live view as a whole: logs come and go, and what depends on them is worked out again; as a reader sees it in Chromium."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from jaxid import Axis
from jaxid.live.board import Board
from jaxid.live.folder import LogFolder
from jaxid.live.work import Task, Work
from tests.live import webdriver
from tests.live.test_server import serving

TRUTH = {"M": 1.0, "Fv": 2.0, "Fc": 0.5}


@pytest.fixture(scope="module")
def texts(axis_log, tmp_path_factory):
    """Short logs of an axis that lacks nothing, as CSV by name, and one that is none."""
    folder = tmp_path_factory.mktemp("texts")
    found = {"bad.csv": "t,u,v\n0,1,0\n0.1,<b>one</b>,0\n"}
    for k, name in enumerate(("fit_1.csv", "fit_2.csv", "check_1.csv")):
        inputs = np.roll(np.repeat([3.0, -2.0, 4.0, 0.5, -4.0], 40), 40 * k)
        axis_log(name, inputs, 0.01, k, position=False, **TRUTH).to_csv(folder / name)
        found[name] = (folder / name).read_text()
    return found


def following(folder, board):
    work = Work(Task(LogFolder(folder), lambda paths: Axis(), None, ["check_*"], ["jaxid", "explain", "axis"]), board)
    work.start()
    return work


def until(board, name, state, seconds=60.0, words=""):
    """The parts, once that of this name is in this state, and says `words` if there are any."""
    end, version = time.monotonic() + seconds, -1
    while time.monotonic() < end:
        seen = board.seen(version, 1.0)
        version = seen["version"] if seen else version
        if seen and seen["parts"][name]["state"] == state and words in seen["parts"][name]["words"]:
            return seen["parts"]
    raise AssertionError(f"{name} is not {state} within {seconds:g} s: {board.seen(-1, 0)}")


def test_logs_are_followed_step_by_step(texts, tmp_path):
    board = Board()
    (tmp_path / "bad.csv").write_text(texts["bad.csv"])
    (tmp_path / "notes.md").write_text("nothing")
    work = following(tmp_path, board)
    try:
        parts = until(board, "logs", "done")
        assert parts["logs"]["words"] == "0 to fit, 0 held out, 1 left out"
        assert "bad.csv" in board.html("logs") and "line 3" in board.html("logs")
        assert "<b>one" not in board.html("logs") and "notes.md" in board.html("logs")
        until(board, "fit", "waiting", words="Waiting for logs to fit.")

        for name in ("fit_1.csv", "fit_2.csv"):
            (tmp_path / name).write_text(texts[name])
        parts = until(board, "fit", "done")
        assert "Sound" in board.html("fit") and "mass" in board.html("fit") and "Sound" in board.report("fit")
        # It waits from the start, for what comes before it; it says what for once that is there.
        until(board, "gap", "waiting", words="No log is held out: name some check_*, and they will judge the model.")

        (tmp_path / "check_1.csv").write_text(texts["check_1.csv"])
        parts = until(board, "explanation", "done")
        assert parts["fit"]["number"] == 1, "the fitted logs are the same, and so is their fit"
        assert "held out" in board.html("logs") and "check_1.csv" in board.html("gap")
        assert "Nothing missing" in board.html("explanation")
        assert f"jaxid explain axis --fit {tmp_path / 'fit_1.csv'}" in board.html("explanation")

        (tmp_path / "fit_2.csv").unlink()
        until(board, "fit", "running")
        parts = until(board, "explanation", "done")
        assert parts["fit"]["number"] == 2 and "fit_2.csv" not in board.html("logs")
    finally:
        work.stop()
        work.join(20)
    assert not work.is_alive()


in_a_browser = pytest.mark.skipif(
    webdriver.DRIVER is None, reason="there is no Chromium with its driver; apt-get install chromium chromium-driver"
)
DROP = """const held = new DataTransfer();
for (const [name, text] of arguments[0]) held.items.add(new File([text], name));
const told = { dataTransfer: held, bubbles: true, cancelable: true };
document.getElementById("drop").dispatchEvent(new DragEvent("drop", told));"""
LOOK = """const box = e => e.getBoundingClientRect(), root = document.documentElement;
return { overflow: root.scrollWidth - root.clientWidth, width: innerWidth,
  paper: getComputedStyle(document.querySelector("main")).backgroundColor,
  outside: [...document.querySelectorAll("h1, h2, h3, p, li, figure, .bars > div > *, .tick")]
    .filter(e => box(e).width && box(e).right > root.clientWidth + 1 && !e.closest(".scroll"))
    .map(e => e.outerHTML.slice(0, 80)),
  resources: performance.getEntriesByType("resource").map(r => r.name),
  charts: document.querySelectorAll(".chart").length, ready: document.querySelectorAll(".chart[data-ready]").length };"""
DONE = "return document.getElementById(arguments[0]).dataset.state === 'done'"


@in_a_browser
def test_a_reader_drops_logs_and_sees_what_they_say(texts, tmp_path):
    logs = tmp_path / "logs"
    logs.mkdir()
    with serving(logs, 10_000_000) as server, webdriver.browser(tmp_path / "profile") as window:
        work = following(logs, server.board)
        try:
            window.screen(1280, 900, dark=True)
            window.open(server.address)
            window.until("return document.getElementById('link').textContent === 'following the folder'")
            window.run(DROP, [[name, texts[name]] for name in ("bad.csv", "fit_1.csv", "fit_2.csv")])
            names = "return [...document.querySelectorAll('.log strong')].map(e => e.textContent).join()"
            window.until(f"{names} === 'bad.csv,fit_1.csv,fit_2.csv'")
            assert "line 3" in str(window.run("return document.querySelector('.log .bad.finding').textContent"))
            window.until(DONE, "fit")
            window.run(DROP, [["check_1.csv", texts["check_1.csv"]]])
            window.until(DONE, "explanation")
            for width, dark in ((1280, True), (390, False)):
                window.screen(width, 900, dark)
                window.run("document.querySelectorAll('details').forEach(d => { d.open = true; })")
                seen = window.run(LOOK)
                assert seen["width"] == width and seen["overflow"] <= 0 and seen["outside"] == []
                assert seen["paper"] == ("rgb(13, 17, 23)" if dark else "rgb(255, 255, 255)")
                assert seen["charts"] == seen["ready"] > 0
                assert all(name.startswith((server.address, "data:")) for name in seen["resources"])
            assert window.complaints() == []

            window.run(DROP, [["../x.csv", "t"], ["fit_1.csv", "t"]])
            window.until("return document.querySelectorAll('#refused li').length === 2")
            said = str(window.run("return document.getElementById('refused').textContent"))
            assert "'../x.csv' is no plain file name" in said and "fit_1.csv is there already" in said
            assert sorted(path.name for path in tmp_path.iterdir()) == ["logs", "profile"]

            window.open(f"{server.address}report/explanation")
            assert window.run("return document.querySelectorAll('.chart[data-ready]').length") > 0, "its script may run"
        finally:
            work.stop()
            work.join(20)


def test_the_command_says_where_and_stops_at_ctrl_c(tmp_path):
    # A shell that runs the tests in the background has them ignore Ctrl-C, which a process inherits.
    as_in_front = (
        "import runpy, signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "runpy.run_module('jaxid', run_name='__main__')"
    )
    command = [sys.executable, "-c", as_in_front, "serve", "axis", str(tmp_path / "new"), "--port", "0"]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ})
    try:
        assert run.stdout is not None
        address = run.stdout.readline()
        assert address.startswith("http://127.0.0.1:")
        run.send_signal(signal.SIGINT)
        _, said = run.communicate(timeout=20)
    finally:
        run.kill()
    assert run.returncode == 0 and "Ctrl-C ends it" in said and "Traceback" not in said
    assert list((tmp_path / "new").iterdir()) == []
