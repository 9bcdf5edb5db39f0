"""A small table of numbers side by side: ours, the paper's, the difference. Reads well as text and in a notebook."""

import html
from dataclasses import dataclass

Cell = str | float | int | None


def _text(cell: Cell) -> str:
    if cell is None or cell != cell:
        return "-"
    return cell if isinstance(cell, str) else f"{0.0 if abs(cell) < 1e-12 else cell:.5g}"


@dataclass(frozen=True, repr=False)
class PaperTable:
    """Rows of cells under `columns`; `None` and NaN show as a dash. `notes` are sentences below the table."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()

    def column(self, name: str) -> tuple[Cell, ...]:
        """One column's cells; raises `ValueError` for an unknown name."""
        if name not in self.columns:
            raise ValueError(f"The table {self.title!r} has no column {name!r}; use one of {list(self.columns)}.")
        return tuple(row[self.columns.index(name)] for row in self.rows)

    def __repr__(self) -> str:
        table = [self.columns, *(tuple(_text(cell) for cell in row) for row in self.rows)]
        widths = [max(len(row[j]) for row in table) for j in range(len(self.columns))]
        lines = ["  ".join(c.ljust(w) for c, w in zip(row, widths, strict=True)).rstrip() for row in table]
        return "\n".join([self.title, *lines, *self.notes])

    def _repr_html_(self) -> str:
        head = "".join(f"<th>{html.escape(name)}</th>" for name in self.columns)
        body = "".join(
            "<tr>" + "".join(f"<td>{html.escape(_text(cell))}</td>" for cell in row) + "</tr>" for row in self.rows
        )
        notes = "".join(f"<p>{html.escape(note)}</p>" for note in self.notes)
        caption = f"<caption>{html.escape(self.title)}</caption>"
        return f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{notes}"
