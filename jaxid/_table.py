"""Small tables of results, for a terminal and for a notebook, where drawing libraries have no place."""

import html
import shutil
import sys
import textwrap
from collections.abc import Collection, Sequence

WIDTH = 100
"""Columns of text that goes to a file or another program."""
_NARROWEST = 60
"""Columns below which a terminal is left to wrap lines: tables would lose letters."""


def columns() -> int:
    """Columns that text may have: those of the terminal that it goes to, `WIDTH` where it goes elsewhere."""
    if not sys.stdout.isatty():
        return WIDTH
    return max(shutil.get_terminal_size((WIDTH, 24)).columns, _NARROWEST)


def _to_the_right(column: int, right: Collection[int] | None) -> bool:
    return column > 0 if right is None else column in right


def text_table(
    rows: Sequence[Sequence[str]],
    before: Sequence[str] = (),
    after: Sequence[str] = (),
    right: Collection[int] | None = None,
) -> str:
    """Aligned columns, those of `right` (all but the first, unless given) to the right; the first row is the header.
    Paragraphs `before` and `after` are wrapped."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))] if rows else []
    lines = []
    for row in rows:
        cells = (
            cell.rjust(w) if _to_the_right(k, right) else cell.ljust(w)
            for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        )
        lines.append("  ".join(cells).rstrip())
    top = [line for text in before if text for line in textwrap.wrap(text, columns())]
    bottom = [line for text in after for line in textwrap.wrap(text, columns())]
    return "\n".join([*top, *lines, *bottom])


def html_table(
    rows: Sequence[Sequence[str]],
    before: Sequence[str] = (),
    after: Sequence[str] = (),
    right: Collection[int] | None = None,
) -> str:
    """The same as HTML, in the page's own colours; the first paragraph in bold."""
    top = "".join(
        f"<p>{'<b>' if not k else ''}{html.escape(text)}{'</b>' if not k else ''}</p>"
        for k, text in enumerate(text for text in before if text)
    )
    bottom = "".join(f"<p>{html.escape(text)}</p>" for text in after if text)
    sides = ["right" if _to_the_right(k, right) else "left" for k in range(len(rows[0]))] if rows else []
    cells = [
        "".join(
            f'<{tag} style="text-align:{side};padding:.15em .8em">{html.escape(cell)}</{tag}>'
            for side, cell in zip(sides, row, strict=True)
        )
        for tag, row in zip(["th"] + ["td"] * (len(rows) - 1), rows, strict=False)
    ]
    body = "".join(f"<tr>{row}</tr>" for row in cells)
    return f'<div>{top}<table style="border-collapse:collapse">{body}</table>{bottom}</div>'
