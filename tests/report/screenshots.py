"""The pictures of pages that the README shows, taken in Chromium: `python -m tests.report.screenshots` takes them anew."""

import shutil
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import jaxid
from jaxid import demo
from jaxid.live.folder import LogFolder
from jaxid.live.work import Task, Work
from tests.live import webdriver
from tests.live.test_server import serving

PLACE = Path(__file__).parents[2] / "docs" / "pages"
SIZES = {"explained": (1000, 1130), "explained_telephone": (390, 844), "live": (1000, 900)}
"""Width and height of every picture."""


def explained(folder: Path) -> Path:
    """The report of the package's robot about which the data sheet does not say everything."""
    logs = jaxid.read_logs(demo.folder("unknown") / "*.csv", robot="pioneer")
    fitted, held_out = logs.split(held_out=["check_1.csv", "check_2.csv", "check_3.csv"])
    fit = jaxid.output_error(jaxid.Pioneer(), fitted, start=jaxid.integral_least_squares(jaxid.Pioneer(), fitted))
    jaxid.explain(fit, fitted, held_out).save(folder)
    return folder / "report.html"


@contextmanager
def live(folder: Path) -> Iterator[str]:
    """The address of a live view of the same logs."""
    folder.mkdir()
    for path in demo.folder("unknown").glob("*.csv"):
        shutil.copy(path, folder)
    with serving(folder, title="jaxid serve: pioneer") as server:
        task = Task(
            LogFolder(folder), lambda paths: jaxid.Pioneer(), None, ["check_*"], ["jaxid", "explain", "pioneer"]
        )
        work = Work(task, server.board)
        work.start()
        try:
            yield server.address
        finally:
            work.stop()
            work.join(30)


def take(place: Path) -> list[Path]:
    """Every picture as a PNG in `place`."""
    place.mkdir(exist_ok=True)
    warnings.simplefilter(
        "ignore", jaxid.LogWarning
    )  # of logs that are read one by one; the page has what they come to
    paths = {name: place / f"{name}.png" for name in SIZES}
    with tempfile.TemporaryDirectory() as own, webdriver.browser(Path(own) / "profile") as window:
        page = explained(Path(own) / "explained")
        for name, dark in (("explained", False), ("explained_telephone", True)):
            window.screen(*SIZES[name], dark)
            window.open(page.as_uri())
            _settled(window)
            window.picture(paths[name])
        with live(Path(own) / "logs") as address:
            window.screen(*SIZES["live"], False)
            window.open(address)
            window.until("return document.getElementById('explanation').dataset.state === 'done'", seconds=300)
            # Where the folder lies on this machine is nobody's business.
            window.run("document.querySelector('#drop code').textContent = 'logs/'; scrollTo(0, 0)")
            _settled(window)
            window.picture(paths["live"])
        assert window.complaints() == []
    return list(paths.values())


def _settled(window: webdriver.Browser) -> None:
    """Charts are drawn, and nothing beside the page, such as a bar to scroll by, is in the picture."""
    window.run("document.documentElement.style.scrollbarWidth = 'none'")
    window.until("return [...document.querySelectorAll('.chart')].every(own => own.dataset.ready)")


if __name__ == "__main__":
    if webdriver.DRIVER is None:
        sys.exit("there is no Chromium with its driver; apt-get install chromium chromium-driver")
    for written in take(PLACE):
        print(written.relative_to(Path.cwd()) if written.is_relative_to(Path.cwd()) else written)
