"""The coverage section of docs/prediction_error.md from the figures of `benchmarks.prediction_error`."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

_BEGIN, _END = "<!-- coverage -->\n", "<!-- end of coverage -->\n"
_TARGET = (0.93, 0.97)
_CHANCE = 0.05
"""Probability of a share as far out as found at which chance is no longer blamed."""


def _range(coverage: dict) -> str:
    low, high = (f"{100 * coverage[end]:.1f}" for end in ("lowest", "highest"))
    return f"{low} %" if low == high else f"{low} to {high} %"


def _row(row: dict[str, Any]) -> str:
    own = row["prediction_error"]
    cells = [row["setting"], f"{row['fits']}", f"**{_range(own['coverage'])}**", _range(own["noises"]["coverage"])]
    left = [name for name, judged in zip(row["parameters"], row["judged"], strict=True) if not judged]
    cells[0] += f" (without {', '.join(left)})" if left else ""
    for method in ("output_error", "output_error_robust"):
        cells.append(_range(row[method]["coverage"]) if method in row else "no free simulation")
    return f"| {' | '.join(cells)} |"


def outside(row: dict[str, Any]) -> list[str]:
    """Judged parameters whose intervals hold the truth less or more often than 93 to 97 % and chance allow, with why."""
    own, fits, found = row["prediction_error"], row["fits"], []
    for i, name in enumerate(row["parameters"]):
        share = own["coverage"]["each"][i]
        held = round(share * fits)
        seldom = stats.binom.cdf(held, fits, _TARGET[0]) < _CHANCE
        if row["judged"][i] and (seldom or stats.binom.sf(held - 1, fits, _TARGET[1]) < _CHANCE):
            found.append(
                f'{name} in "{row["setting"]}" {100 * share:.1f} % (bias '
                f"{own['bias_in_standard_deviations'][i]:+.2f} standard deviations of one fit, standard error "
                f"{own['standard_error_over_scatter'][i]:.2f} of the scatter)"
            )
    return found


def section(rows: Sequence[dict[str, Any]]) -> str:
    """The table, and what it says."""
    head = ["setting", "fits", "prediction error", "its noise levels", "output error, white", "output error, robust"]
    lines = [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}", *map(_row, rows)]
    known = ", ".join(f"{n} to ±{196 * (0.95 * 0.05 / n) ** 0.5:.1f} %" for n in sorted({row["fits"] for row in rows}))
    judged = [np.array(row["prediction_error"]["coverage"]["each"])[row["judged"]] for row in rows]
    together = "; ".join(
        f"{100 * own.mean():.1f} % ({row['setting'].split(', sensor')[0]})"
        for row, own in zip(rows, judged, strict=True)
    )
    out = [text for row in rows for text in outside(row)]
    beyond = f"{len(out)} of {sum(map(len, judged))} intervals hold the truth less or more often than 93 to 97 % of the fits "
    beyond += f"and chance allow ({100 * _CHANCE:.0f} %){': ' + '; '.join(out) if out else ''}."
    said = " ".join(
        [
            "Share of the 95 % intervals that hold the truth, lowest and highest judged parameter (at least four standard "
            "errors from its bounds). So many fits know a coverage of 95 % of one parameter: " + known + ".",
            "All judged parameters together: " + together + ".",
            beyond,
        ]
    )
    before = [row["setting"] for row in rows if "seed" not in row]
    if before:
        said += f" By earlier code, which took every level of process noise for known: {'; '.join(before)}."
    return "\n".join([*lines, "", textwrap.fill(said, 125, break_on_hyphens=False, break_long_words=False), ""])


def write_page(rows: Sequence[dict[str, Any]], path: Path, missing: Sequence[str] = ()) -> None:
    """Put the section where the page has its marks; `missing` are settings of the study that have not been run."""
    text = path.read_text(encoding="utf-8")
    before, rest = text.split(_BEGIN)
    left = f"\nNot run yet: {'; '.join(missing)}.\n" if missing else ""
    path.write_text(before + _BEGIN + section(rows) + left + _END + rest.split(_END)[1], encoding="utf-8")
