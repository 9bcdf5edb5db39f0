"""Measured logs, one module a set: how its files become jaxid logs, which robot they are of, and what comes out."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import ArrayLike

from jaxid import Fit
from jaxid.report.style import HOUSE

matplotlib.use("Agg")
matplotlib.rcParams.update(HOUSE)
PICTURE_WIDTH = 9.0  # inches; at 110 dpi what a page shows without scaling
DPI = 110


@dataclass(frozen=True)
class Row:
    """One line of the summary: a quantity, what was measured, what it is compared with, and whether that was reached.

    `reached` is None where there is nothing to reach.
    """

    quantity: str
    measured: str
    reference: str
    reached: bool | None


@dataclass(frozen=True)
class Section:
    """What a set contributes: its part of the page, its lines of the summary, and all figures for the JSON file."""

    title: str
    text: str
    rows: tuple[Row, ...]
    figures: dict[str, Any]


def table(header: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """A Markdown table; numbers with four significant digits."""

    def cell(value: Any) -> str:
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    lines = ["| " + " | ".join(header) + " |", "| " + " | ".join("---" for _ in header) + " |"]
    return "\n".join(lines + ["| " + " | ".join(map(cell, row)) + " |" for row in rows])


def errors_told(fits: Sequence[Fit]) -> str:
    """Which standard errors these fits report, in words."""
    robust = sum(fit.standard_errors == "robust" for fit in fits)
    return (
        f"Of {len(fits)} fits {robust} report standard errors that allow for coloured residuals, "
        f"{len(fits) - robust} those of white ones"
    )


def fit_percent(measured: ArrayLike, simulated: ArrayLike) -> float:
    """`100 (1 - |measured - simulated| / |measured - mean|)` over the samples that were measured, in percent."""
    y, s = np.asarray(measured, float), np.asarray(simulated, float)
    there = np.isfinite(y)
    y, s = y[there], s[there]
    return float(100 * (1 - np.linalg.norm(y - s) / np.linalg.norm(y - y.mean())))


def relative_error(measured: ArrayLike, simulated: ArrayLike) -> float:
    """`100 |measured - simulated| / |measured|` in percent, the figure of the EMPS benchmark."""
    y = np.asarray(measured, float)
    return float(100 * np.linalg.norm(y - np.asarray(simulated, float)) / np.linalg.norm(y))


def values(fit: Fit) -> dict[str, dict[str, Any]]:
    """The estimates of a fit for the JSON file: value, standard error and status of everything that was free."""
    return {
        name: {"value": e.value, "std_error": None if np.isnan(e.std_error) else e.std_error, "status": e.status}
        for name, e in fit.parameters.items()
        if e.status != "fixed"
    }


def save(figure: Any, pictures: Path, name: str) -> str:
    """Write a picture and return the Markdown that shows it, with its path relative to the page."""
    pictures.mkdir(parents=True, exist_ok=True)
    figure.savefig(pictures / name, dpi=DPI)
    return f"![{name}]({pictures.name}/{name})"
