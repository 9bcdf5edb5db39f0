"""Small tables of results, for a terminal and for a notebook, where drawing libraries have no place."""

import html
import textwrap
from collections.abc import Sequence

_WIDTH = 100


def text_table(rows: Sequence[Sequence[str]], before: Sequence[str] = (), after: Sequence[str] = ()) -> str:
    """Aligned columns, the first to the left; the first row is the header. Paragraphs `before` and `after` are wrapped."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))] if rows else []
    lines = []
    for row in rows:
        first, *others = (
            cell.ljust(w) if k == 0 else cell.rjust(w) for k, (cell, w) in enumerate(zip(row, widths, strict=True))
        )
        lines.append("  ".join([first, *others]).rstrip())
    top = [line for text in before for line in textwrap.wrap(text, _WIDTH)]
    bottom = [line for text in after for line in textwrap.wrap(text, _WIDTH)]
    return "\n".join([*top, *lines, *bottom])


def html_table(rows: Sequence[Sequence[str]], before: Sequence[str] = (), after: Sequence[str] = ()) -> str:
    """The same as HTML, in the page's own colours; the first paragraph in bold."""
    top = "".join(
        f"<p>{'<b>' if not k else ''}{html.escape(text)}{'</b>' if not k else ''}</p>" for k, text in enumerate(before)
    )
    bottom = "".join(f"<p>{html.escape(text)}</p>" for text in after)
    cells = [
        "".join(
            f'<{tag} style="text-align:{"right" if k else "left"};padding:.15em .8em">{html.escape(cell)}</{tag}>'
            for k, cell in enumerate(row)
        )
        for tag, row in zip(["th"] + ["td"] * (len(rows) - 1), rows, strict=False)
    ]
    body = "".join(f"<tr>{row}</tr>" for row in cells)
    return f'<div>{top}<table style="border-collapse:collapse">{body}</table>{bottom}</div>'
