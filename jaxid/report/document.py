"""What a page says, as data: verdict, evidence, what to do next; in blocks that `page.html.jinja` renders for all reports."""

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import ClassVar, Literal

from jinja2 import Environment, FunctionLoader
from markupsafe import Markup, escape
from matplotlib import rc_context
from matplotlib.figure import Figure

from .._atomic import write_text
from .chart import Chart
from .tables import Table

Tone = Literal["good", "open", "bad"]
_REM = 16.0 * 72.0 / 96.0
"""Points in the page's unit of size."""


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str
    kind: ClassVar[str] = "text"


@dataclass(frozen=True)
class Code:
    """Lines to type."""

    text: str
    kind: ClassVar[str] = "code"


@dataclass(frozen=True)
class Listing:
    """Points of a list."""

    items: tuple[str, ...]
    kind: ClassVar[str] = "list"


@dataclass(frozen=True)
class Tabled:
    """A table."""

    table: Table
    kind: ClassVar[str] = "table"


@dataclass(frozen=True)
class Charted:
    """A chart that zooms."""

    chart: Chart
    kind: ClassVar[str] = "chart"


@dataclass(frozen=True)
class Bar:
    """One bar: `share` of the width [%], what it says beside it, and its colour ("before", "after", "alike" or plain)."""

    name: str
    share: float
    words: str
    colour: str = ""
    strong: bool = False


@dataclass(frozen=True)
class Bars:
    """Named bars of one scale, a dashed `line` at so many per cent of the width."""

    title: str
    rows: tuple[Bar, ...]
    note: str = ""
    line: float | None = None
    kind: ClassVar[str] = "bars"


@dataclass(frozen=True)
class Picture:
    """A drawing with what it shows in words; `least` and `most`: its width on the page [rem]: narrower screens scroll it."""

    svg: Markup
    alt: str
    caption: str = ""
    least: float = 20.0
    most: float = 60.0
    kind: ClassVar[str] = "picture"


@dataclass(frozen=True)
class More:
    """What is folded up until it is asked for."""

    title: str
    blocks: tuple["Block", ...]
    kind: ClassVar[str] = "more"


Block = Text | Code | Listing | Tabled | Charted | Bars | Picture | More


@dataclass(frozen=True)
class Section:
    """A part of the evidence."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Page:
    """A whole report: `title` of the window, `kind` (which command, of what), the `verdict` in a word and its `tone`, the
    `headline` that says it in a sentence, what belongs to it, the evidence, and what to do next."""

    title: str
    kind: str
    verdict: str
    tone: Tone
    headline: str
    lead: tuple[Block, ...]
    sections: tuple[Section, ...]
    next: tuple[Block, ...]


def units(text: str) -> str:
    """The text with its units as they are printed: "kg m^2" as "kg m²"; a unit in brackets stays on one line."""
    text = re.sub(r"\[[^\[\]]{1,20}\]", lambda unit: unit[0].replace(" ", "\N{NO-BREAK SPACE}"), text)
    return re.sub(
        r"\^(-?)([1-9])(?![\d.])", lambda power: ("⁻" if power[1] else "") + "¹²³⁴⁵⁶⁷⁸⁹"[int(power[2]) - 1], text
    )


def said(text: str) -> Markup:
    """A sentence as HTML: units as powers, and what stands between backticks as what one types."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(units(text)))))


@lru_cache(1)
def templates() -> Environment:
    """The templates of all pages, by their paths inside the package ("report/page.html.jinja"); what they show is escaped."""
    environment = Environment(
        loader=FunctionLoader(package_text), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"units": units, "said": said}
    return environment


def package_text(path: str) -> str:
    """A file of the package, such as "report/page.css"."""
    return files("jaxid").joinpath(path).read_text(encoding="utf-8")


def rendered(page: Page, whole: bool = True) -> str:
    """The page as one HTML file that needs nothing else, or, where it is not `whole`, as a part of a notebook's."""
    css, js = Markup(package_text("report/page.css")), Markup(package_text("report/page.js"))
    text = templates().get_template("report/page.html.jinja").render(page=page, whole=whole, css=css, js=js)
    return re.sub(r"\n\s*\n+", "\n", text).strip() + "\n"


def write_page(path: Path, page: Page) -> None:
    """Write the page, all of it or nothing. Raises `OSError`."""
    write_text(path, rendered(page))


def picture(figure: Figure, name: str, alt: str, caption: str = "", columns: int = 1, largest: float = 1.15) -> Picture:
    """A matplotlib figure in the page's colours, light or dark: its text is text, black is the ink and white the paper.

    `columns`: how many panels stand side by side: so wide it stays on a narrow screen, which then scrolls it. `largest`: its
    width on a wide screen, in that of the figure.
    """
    buffer = io.StringIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": f"jaxid {name}"}):
        figure.savefig(buffer, format="svg", transparent=True, metadata=nothing)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r' xmlns(:xlink)?="[^"]*"', "", text).replace("xlink:href", "href")
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    # Its style sheet would hold for the whole page.
    text = re.sub(r"<style[^>]*>.*?</style>", "", text, flags=re.S)
    text = text.replace("<svg ", '<svg stroke-linejoin="round" stroke-linecap="butt" ', 1)
    text = re.sub(r'(<svg[^>]*?) (?:height|width)="[^"]*"', r"\1", text)
    text = re.sub(r'(<svg[^>]*?) (?:height|width)="[^"]*"', r"\1", text, count=1)
    text = re.sub(r"#([0-9a-f]{6})\b", _themed, text)
    text = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font-size: \1; font-family: inherit; fill: currentColor", text)
    width = float(figure.get_figwidth()) * 72.0 / _REM
    return Picture(Markup(text), alt, caption, least=min(width, 19.0 * columns), most=largest * width)


def _themed(found: re.Match[str]) -> str:
    """A grey as the page's own: dark ones are ink, light ones paper or what bands are made of."""
    levels = [int(found[1][k : k + 2], 16) for k in (0, 2, 4)]
    if max(levels) - min(levels) > 8:
        return found[0]
    grey = levels[0]
    return (
        "currentColor"
        if grey < 100
        else "var(--measured)"
        if grey < 170
        else "var(--noise)"
        if grey < 250
        else "var(--paper)"
    )


def texts(sentences: Sequence[str]) -> tuple[Block, ...]:
    """A paragraph for each sentence that is not empty."""
    return tuple(Text(sentence) for sentence in sentences if sentence)
