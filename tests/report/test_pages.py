"""Every report: what is true of all pages, and, where Chromium is, what a reader sees of them."""

import re
from pathlib import Path

import numpy as np
import pytest

import jaxid
from jaxid.cli.fleet import run_fleet
from jaxid.logs import noise_scale
from jaxid.report import document
from jaxid.report.change_page import change_page
from jaxid.report.chart import Chart, Panel, Trace
from jaxid.report.comparing import on_fitted
from jaxid.report.comparison_page import comparison_page, fits_page
from jaxid.report.design_page import design_page
from jaxid.report.document import Charted, Page, Section, Tabled, Text, rendered, said, units
from jaxid.report.explanation_page import page_of
from jaxid.report.tables import Cell, Table
from tests.live import webdriver
from tests.report import browser
from tests.report.pages import check, contrast

CSS = (Path(document.__file__).parent / "page.css").read_text()


@pytest.fixture(scope="module")
def compared(explained, hidden_drag):
    """The baseline and the final model of an explanation, compared on its held-out logs."""
    return jaxid.compare(explained.baseline, explained.final, held_out=explained.held_out)


@pytest.fixture(scope="module")
def designed():
    options = {"limit": 4.0, "seconds": 4.0, "interval": 0.02, "radius": 1.0, "rounds": 1, "noise": {"v": 0.01}}
    return jaxid.design_experiment(jaxid.Axis(), **options)


@pytest.fixture(scope="module")
def changed(axis_log):
    """Two sets of logs of an axis, the second with half as much mass again."""
    inputs, fits, sets = np.repeat([3.0, -2.0, 4.0, 0.5, -4.0], 40), [], []
    for mass in (1.0, 1.5):
        logs = jaxid.LogSet(
            [axis_log(f"{mass} {k}", np.roll(inputs, 40 * k), 0.01, k, position=False, M=mass) for k in (0, 1)]
        )
        sets.append(logs)
        fits.append(jaxid.output_error(jaxid.Axis(), logs, start=jaxid.integral_least_squares(jaxid.Axis(), logs)))
    return jaxid.explain_change(*fits, *sets)


def test_a_change_has_its_size_and_what_would_have_shown(changed):
    page = change_page(changed)
    assert changed.verdict in ("named", "ambiguous") and page.verdict.startswith("Named")
    text = rendered(page)
    for name, own in changed.change.differences.items():
        assert name in text and f"{100 * own.share:+.1f} %" in text
    assert "dry_friction" not in text and "dry_friction" not in str(changed), "names of the code"
    assert "0.5" in text and "noticed from" in text and "one model for both sets" in text


@pytest.fixture(scope="module")
def of_fleet(axis_log, tmp_path_factory):
    """The page that a fleet of three axes, one of them much heavier, leaves."""
    folder = tmp_path_factory.mktemp("fleet")
    inputs = np.repeat([3.0, -2.0, 4.0, 0.5, -4.0], 40)
    for k, mass in enumerate((1.0, 1.1, 3.0)):
        (folder / "robots" / f"cart_{k}").mkdir(parents=True)
        axis_log(f"{k}", inputs, 0.01, k, position=False, M=mass).to_csv(folder / "robots" / f"cart_{k}" / "run.csv")
    run_fleet("axis", folder / "robots", None, None, folder / "out", {})
    return (folder / "out" / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def pages(explained, compared, designed, changed, of_fleet):
    """Every kind of page, by name."""
    logs = explained.held_out
    noise = noise_scale(logs)
    seen = on_fitted({"output_error": explained.baseline}, logs, noise)
    found = {
        "fit": comparison_page(compared, "fit"),
        "fit without held-out logs": fits_page([explained.baseline], logs, seen, noise),
        "compare": comparison_page(compared),
        "explain": page_of(explained),
        "design": design_page(designed, ("experiment.csv",)),
        "change": change_page(changed),
    }
    return {name: rendered(page) for name, page in found.items()} | {"fleet": of_fleet}


KINDS = ["fit", "fit without held-out logs", "compare", "explain", "design", "change", "fleet"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_is_one_file_that_anybody_can_read(pages, kind):
    page = pages[kind]
    assert page.startswith("<!doctype html>") and page.rstrip().endswith("</html>")
    read = check(page)
    assert len(read.headings) >= 3 and len(page) < 2_000_000
    assert ">nan<" not in page and "None" not in re.sub(r"<(style|script)>.*?</\1>", "", page, flags=re.S)
    assert '<html lang="en">' in page and 'name="viewport"' in page


def test_parameters_have_their_meaning_and_unit(pages, explained):
    for kind in ("fit", "compare", "explain", "design"):
        assert explained.model.parameters["Fv"].meaning in pages[kind], kind
        assert "N s/m" in pages[kind]


def test_p_values_are_words(pages):
    assert "a pattern is left" in pages["fit"] or "no pattern left" in pages["fit"]
    assert " ok<" not in pages["fit"] and " no<" not in pages["fit"]


def scheme(dark: bool) -> dict[str, str]:
    """The colours of a scheme by name."""
    blocks = re.findall(r"\.jaxid-page \{\n(.*?)\n\s*\}", CSS, re.S)
    named = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})\b", blocks[0]))
    return named | (dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})\b", blocks[1])) if dark else {})


@pytest.mark.parametrize("dark", [False, True])
def test_colours_can_be_told_from_the_paper(dark):
    """WCAG 2: text 4.5, what is drawn 3."""
    own = scheme(dark)
    assert (contrast(own["paper"], "#ffffff") < 1.1) is not dark
    for name in ("ink", "dim", "good", "open", "bad", "focus"):
        assert contrast(own[name], own["paper"]) >= 4.5 and contrast(own[name], own["card"]) >= 4.5, name
    for name in ("good", "open", "bad"):
        assert contrast(own[name], own[f"{name}-paper"]) >= 4.5, name
    for name in ("c0", "c1", "c2", "c3", "c4", "c5", "before", "after", "measured", "input"):
        assert contrast(own[name], own["paper"]) >= 3.0, name


def test_units_are_printed_as_powers():
    assert units("kg m^2 and N s^-1, x^12, e^(-x)") == "kg m² and N s⁻¹, x^12, e^(-x)"


def test_what_one_types_looks_like_it_and_stays_escaped():
    assert said("`jaxid fit <a>` of 3 m^2 & more") == "<code>jaxid fit &lt;a&gt;</code> of 3 m² &amp; more"
    assert said("a ` alone") == "a ` alone"


def test_what_users_name_is_escaped():
    odd = "<b>x</b> & </script>"
    table = Table(odd, (odd, "value"), ((Cell(odd, detail=odd), Cell("1")),), (odd,))
    trace = Trace(np.arange(3.0), np.arange(3.0), "c0", odd)
    chart = Charted(Chart((Panel(odd, (trace,)),), alt=f"{odd} of fifteen letters", caption=odd))
    section = Section(odd, (Tabled(table), chart, Text(odd)))
    page = rendered(Page(odd, odd, odd, "bad", odd, (), (section,), (Text(odd),)))
    assert "<b>x" not in page and page.count("</script>") == 1
    check(page)


# -- in a browser ------------------------------------------------------------------------------------------------------
in_a_browser = pytest.mark.skipif(browser.CHROMIUM is None, reason="there is no Chromium; apt-get install chromium")
LOOK = """async (window_, page, wait) => {
  page.querySelectorAll("details").forEach(d => { d.open = true; });
  const root = page.documentElement, box = e => e.getBoundingClientRect(), seen = {};
  for (const width of [390, 1280]) {
    window_.frameElement.style.width = `${width}px`;
    await wait(300);
    const outside = [...page.querySelectorAll("h1, h2, h3, p, li, figure, table.stack, .bars > div > *, .tick")]
      .filter(e => box(e).width && box(e).right > root.clientWidth + 1 && !e.closest(".scroll"))
      .map(e => e.className || e.tagName);
    const small = [...page.querySelectorAll("button")].filter(b => box(b).width && (box(b).width < 24 || box(b).height < 24));
    seen[width] = { complaints: window_.complaints, outside, small: small.length, width: window_.innerWidth,
      paper: window_.getComputedStyle(page.querySelector(".jaxid-page")).backgroundColor,
      overflow: root.scrollWidth - root.clientWidth,
      resources: window_.performance.getEntriesByType("resource").map(r => r.name),
      charts: page.querySelectorAll(".chart").length, ready: page.querySelectorAll(".chart[data-ready]").length };
  }
  return seen;
}"""


@in_a_browser
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("dark", [False, True])
def test_pages_fit_telephones_and_wide_screens_light_and_dark(pages, kind, dark):
    widths = browser.asked(pages[kind], 390, dark, LOOK)
    assert list(widths) == ["390", "1280"]
    for width, seen in widths.items():
        assert seen["complaints"] == [] and seen["resources"] == [], width
        assert seen["width"] == int(width) and seen["overflow"] <= 0 and seen["outside"] == [] and seen["small"] == 0
        assert seen["charts"] == seen["ready"] and (seen["charts"] > 0 or kind in ("change", "fleet"))
        assert seen["paper"] == ("rgb(13, 17, 23)" if dark else "rgb(255, 255, 255)")


ZOOM = """async (window_, page, wait) => {
  const chart = page.querySelector(".chart"), plot = chart.querySelector(".plot"), found = {};
  const view = () => [Number(chart.dataset.from), Number(chart.dataset.to)];
  const labels = () => [...chart.querySelectorAll(".axis .tick")].map(t => t.textContent);
  const heights = () => [...chart.querySelectorAll(".plot svg")].map(s => Number(s.getAttribute("viewBox").split(" ")[3]));
  const board = chart.querySelector(".panels");
  const press = key => board.dispatchEvent(new window_.KeyboardEvent("keydown", { key, bubbles: true }));
  const point = (kind, x) => plot.dispatchEvent(new window_.PointerEvent(kind, { pointerId: 1, clientX: x, bubbles: true }));
  plot.setPointerCapture = () => {};
  found.whole = view(); found.labels = labels(); found.tall = heights();
  chart.querySelector("button[data-do=in]").click(); found.clicked = view(); found.closer = labels();
  press("+"); found.pressed = view(); found.fitted = heights();
  press("ArrowRight"); found.right = view();
  const box = plot.getBoundingClientRect();
  point("pointerdown", box.left + 100); point("pointermove", box.left + 100 + box.width / 4); point("pointerup", 0);
  found.dragged = view();
  plot.dispatchEvent(new window_.WheelEvent("wheel", { deltaY: 500, bubbles: true, cancelable: true }));
  found.scrolled = view();
  plot.dispatchEvent(new window_.WheelEvent("wheel",
    { deltaY: -500, ctrlKey: true, clientX: box.left + box.width / 2, bubbles: true, cancelable: true }));
  found.wheeled = view();
  press("0"); found.again = view(); found.labelled = labels();
  found.complaints = window_.complaints;
  return found;
}"""


@in_a_browser
def test_charts_zoom_and_pan_by_buttons_keys_and_pointer():
    t = np.linspace(2.0, 10.0, 801)
    y = np.where(t < 5.0, 100.0, np.sin(t))  # a zoom to where it is small must show the small
    panels = (
        Panel("speed [m/s]", (Trace(t, y, "measured", "measured", "dots"), Trace(t, y, "c0", "line")), follows=True),
        Panel("residual [m/s]", (Trace(t, 0 * t, "c0", "", "step"),), -1.0, 1.0, level=0.5, small=True),
    )
    chart = Charted(Chart(panels, alt="A speed that falls from 100 to between -1 and 1 m/s"))
    page = rendered(Page("t", "k", "Sound", "good", "h", (), (Section("S", (chart,)),), (Text("n"),)))
    seen = browser.asked(page, 900, False, ZOOM)
    assert seen["complaints"] == []
    assert seen["whole"] == pytest.approx([2.0, 10.0]) and seen["labels"] == ["2", "4", "6", "8", "10"]
    assert seen["clicked"] == pytest.approx([4.0, 8.0]) and seen["closer"][0] == "4" and len(seen["closer"]) >= 4
    assert seen["pressed"] == pytest.approx([5.0, 7.0])
    assert seen["right"] == pytest.approx([5.8, 7.8])
    assert seen["dragged"] == pytest.approx([5.3, 7.3])
    assert seen["scrolled"] == seen["dragged"]  # the wheel alone scrolls the page
    middle = sum(seen["wheeled"]) / 2
    assert seen["wheeled"][1] - seen["wheeled"][0] == pytest.approx(2.0 * np.exp(-0.75))
    assert middle == pytest.approx(6.3, abs=0.01)
    # From 5 to 7 s it lies between -1 and 0.66, and the panel's height follows; that of the residual stays.
    assert seen["fitted"][0] < 0.03 * seen["tall"][0] and seen["fitted"][1] == seen["tall"][1]
    assert seen["again"] == pytest.approx([2.0, 10.0]) and seen["labelled"] == seen["labels"]


@pytest.mark.skipif(webdriver.DRIVER is None, reason="there is no Chromium with its driver")
def test_pages_fit_the_paper_and_are_printed_light(pages, tmp_path):
    """A4 between margins of 12 mm is 703 px wide."""
    with webdriver.browser(tmp_path / "profile") as window:
        window.screen(703, 1000, dark=True)
        dark = [{"name": "prefers-color-scheme", "value": "dark"}]
        window.ask(
            "/goog/cdp/execute",
            {"cmd": "Emulation.setEmulatedMedia", "params": {"media": "print", "features": dark}},
        )
        for kind, page in pages.items():
            (tmp_path / "page.html").write_text(page, encoding="utf-8")
            window.open((tmp_path / "page.html").as_uri())
            window.run(
                "dispatchEvent(new Event('beforeprint')); document.documentElement.style.scrollbarWidth = 'none'"
            )
            seen = window.run(
                "return { over: document.documentElement.scrollWidth - innerWidth,"
                "closed: document.querySelectorAll('details:not([open])').length,"
                "paper: getComputedStyle(document.querySelector('.jaxid-page')).backgroundColor }"
            )
            assert seen == {"over": 0, "closed": 0, "paper": "rgb(255, 255, 255)"}, kind
