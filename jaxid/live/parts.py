"""The parts of a live page as HTML, from the same blocks as the reports."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from .board import PARTS

if TYPE_CHECKING:
    from ..report.document import Page
    from .work import ReadLog

TITLES = {
    "logs": ("Logs", "What the folder holds, and what is doubtful in it."),
    "fit": ("Fit", "The robot's parameters, by integral least squares and output error."),
    "gap": ("Gap", "How far the fitted model is from logs that it has not seen."),
    "explanation": ("What is missing", "The effect that would close the gap, by name."),
}


def logs_html(read: "Sequence[ReadLog]", others: Sequence[str] = ()) -> str:
    """The logs, each with its role and findings, and what else lies in the folder."""
    return _template("logs").render(read=read, others=others)


def report_html(name: str, page: "Page") -> str:
    """A report as the part `name` of the live page. That of the gap leaves out what the fit has told."""
    gap = name == "gap"
    sections = page.sections[1:] if gap else page.sections
    return _template("report").render(name=name, page=page, lead=() if gap else page.lead, sections=sections)


def whole_report(page: "Page") -> str:
    """The report as a page of its own."""
    from ..report.document import rendered

    return rendered(page)


def live_page(title: str, folder: str, largest: int, endings: Sequence[str]) -> str:
    """The page that the parts come into."""
    parts = [(name, *TITLES[name]) for name in PARTS]
    return _template("page").render(title=title, folder=folder, largest=largest, endings=",".join(endings), parts=parts)


def _template(name: str):
    from ..report.document import templates  # and matplotlib with it

    return templates().get_template(f"live/{name}.html.jinja")
