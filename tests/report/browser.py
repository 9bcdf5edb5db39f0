"""Chromium without a window, for the tests of pages: it opens a page in a frame of a given width and says what it sees."""

import html
import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
"""Where Chromium is; None where there is none."""
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--disable-dev-shm-usage",
)  # fmt: skip
_COLLECT = """<script>
window.complaints = [];
addEventListener("error", e => complaints.push(e.message));
for (const how of ["error", "warn"]) console[how] = (...said) => complaints.push(said.join(" "));
</script>"""
_HARNESS = """<!doctype html><body><iframe id="page" style="width:%dpx;height:3000px;border:0"></iframe><script>
const frame = document.getElementById("page");
frame.onload = async () => {
  const window_ = frame.contentWindow, page = frame.contentDocument, wait = ms => new Promise(done => setTimeout(done, ms));
  let found;
  try { found = await (%s)(window_, page, wait); } catch (error) { found = { failed: String(error) }; }
  const said = document.createElement("pre");
  said.id = "found";
  said.textContent = JSON.stringify(found);
  document.body.replaceChildren(said);
};
frame.srcdoc = %s;
</script></body>"""


def asked(page: str, width: int, dark: bool, question: str) -> dict:
    """What the JavaScript function `question` (of the window, the document and a function that waits) returns of a page that
    is shown `width` wide, light or dark."""
    assert CHROMIUM is not None
    page = page.replace("<head>", f"<head>{_COLLECT}", 1)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        text = json.dumps(page).replace("</", "<\\/").replace("<!--", "<\\!--")
        (place / "harness.html").write_text(_HARNESS % (width, question, text), encoding="utf-8")
        scheme = f"--blink-settings=preferredColorScheme={0 if dark else 1}"
        run = subprocess.run(
            [
                CHROMIUM,
                *FLAGS,
                f"--user-data-dir={place / 'profile'}",
                scheme,
                "--window-size=1400,3000",
                "--virtual-time-budget=4000",
                "--dump-dom",
                f"file://{place / 'harness.html'}",
            ],  # fmt: skip
            capture_output=True,
            text=True,
            timeout=90,
        )
    said = re.search(r'<pre id="found">(.*?)</pre>', run.stdout, re.S)
    assert said, run.stdout[-500:] + run.stderr[-500:]
    return json.loads(html.unescape(said[1]))
