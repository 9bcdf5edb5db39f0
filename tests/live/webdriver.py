"""Chromium, driven by the W3C's WebDriver protocol: for pages that live on a server, which a file in a frame is no test of."""

import base64
import json
import shutil
import socket
import subprocess
import time
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.error import URLError
from urllib.request import Request, urlopen

from tests.report.browser import CHROMIUM, FLAGS

DRIVER = shutil.which("chromedriver") if CHROMIUM else None
"""Where Chromium's driver is; None without Chromium or without it."""


class Browser:
    """One window. `run` gives what a function body of JavaScript returns."""

    def __init__(self, address: str, session: str):
        self._base = f"{address}/session/{session}"

    def ask(self, path: str, body: dict | None = None, method: str = "POST") -> object:
        return asked(f"{self._base}{path}", body, method)

    def open(self, url: str) -> None:
        self.ask("/url", {"url": url})

    def run(self, script: str, *arguments: object) -> object:
        return self.ask("/execute/sync", {"script": script, "args": list(arguments)})

    def until(self, script: str, *arguments: object, seconds: float = 30.0) -> object:
        """What the script returns as soon as that is true; AssertionError if it does not become so."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if found := self.run(script, *arguments):
                return found
            time.sleep(0.1)
        raise AssertionError(f"not within {seconds:g} s: {script}\n{self.run('return document.body.innerText')}")

    def screen(self, width: int, height: int, dark: bool) -> None:
        """A screen so wide and high, light or dark."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        scheme = {"features": [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]}
        for command, given in (("setDeviceMetricsOverride", metrics), ("setEmulatedMedia", scheme)):
            self.ask("/goog/cdp/execute", {"cmd": f"Emulation.{command}", "params": given})

    def complaints(self) -> list[str]:
        """What the console says, warnings and errors."""
        said = self.ask("/se/log", {"type": "browser"})
        assert isinstance(said, list)
        return [entry["message"] for entry in said if entry["level"] in ("WARNING", "SEVERE")]

    def picture(self, path: Path) -> None:
        """The window as a PNG file."""
        path.write_bytes(base64.b64decode(str(self.ask("/screenshot", method="GET"))))


def asked(url: str, body: dict | None, method: str) -> object:
    data = None if method != "POST" else json.dumps(body or {}).encode()
    with urlopen(Request(url, data, {"Content-Type": "application/json"}, method=method), timeout=30) as answer:
        return json.load(answer)["value"]


@contextmanager
def browser(folder: Path):
    """A window of Chromium, its profile in `folder`, closed at the end."""
    assert DRIVER is not None and CHROMIUM is not None
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    run = subprocess.Popen([DRIVER, f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    address = f"http://127.0.0.1:{port}"
    options = {"binary": CHROMIUM, "args": [*FLAGS, f"--user-data-dir={folder}"]}
    wanted = {"goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL"}}
    window = None
    try:
        for _ in range(100):
            with suppress(URLError):
                asked(f"{address}/status", None, "GET")
                break
            time.sleep(0.1)
        opened = asked(f"{address}/session", {"capabilities": {"alwaysMatch": wanted}}, "POST")
        assert isinstance(opened, dict)
        window = Browser(address, opened["sessionId"])
        yield window
    finally:
        with suppress(URLError, OSError):
            if window is not None:
                window.ask("", method="DELETE")
        run.terminate()
        run.wait(10)
