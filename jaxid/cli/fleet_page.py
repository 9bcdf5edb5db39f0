"""What people read of a fleet: sentences, the spread of every parameter, and a row for every member."""

import html
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from .._atomic import write_text
from ..estimate.output_error.far_members import FarMember, OneParameter
from ..estimate.result import Estimate
from ..explanation.fleet import summary
from ..report.tables import DOUBT, Cell, Table, to_html, value_cell
from ..robots import Robot

_SHOWN = 10
_FAR = "far: farther from the fleet's median than chance makes a sound member, by its spread and the standard error."
_ON_PAGE = 200
"""Members that the page lists."""


def identified(members: pd.DataFrame, estimates: pd.DataFrame) -> dict[str, OneParameter]:
    """What the sound members have identified, by parameter: what `far_estimates` judges."""
    sound = set(members.loc[members["trustworthy"].astype(bool), "member"])
    numbers = np.isfinite(estimates[["value", "std_error"]].to_numpy(float)).all(axis=1)
    counts = estimates[estimates["member"].isin(sound) & (estimates["status"] == "identified") & numbers]
    found = {}
    for name, own in counts.groupby("parameter", sort=False):
        values, errors = (own[column].to_numpy(float) for column in ("value", "std_error"))
        found[str(name)] = OneParameter(list(own["member"]), own["unit"].iloc[0], values, errors)
    return found


def _doubted(members: pd.DataFrame) -> list[str]:
    fitted = members["failure"] == ""
    return list(members.loc[fitted & ~members["trustworthy"].astype(bool), "member"])


def sentences(tables: Mapping[str, pd.DataFrame], far: Sequence[FarMember]) -> list[str]:
    """How the fleet fared, and what it lacks where that was looked for."""
    members = tables["members"]
    doubted = _doubted(members)
    how = "is" if len(doubted) == 1 else "are"
    fitted = int((members["failure"] == "").sum())
    said = [f"{fitted} of {len(members)} members fitted; {len(doubted)} of these {how} to be doubted."]
    if far:
        out = list(dict.fromkeys(one.member for one in far))
        more = f" and {len(out) - _SHOWN} more" if len(out) > _SHOWN else ""
        said.append(f"Far from the others: {', '.join(out[:_SHOWN])}{more}.")
    return said + (summary(tables["explanations"]) if "explanations" in tables else [])


def _free(members: pd.DataFrame, estimates: pd.DataFrame) -> pd.DataFrame:
    """The free parameters of the first member that has a fit."""
    fitted = members.loc[members["failure"] == "", "member"]
    own = estimates[estimates["member"] == (fitted.iloc[0] if len(fitted) else "")]
    return own[own["free"].astype(bool)]


def spread_table(members: pd.DataFrame, estimates: pd.DataFrame, far: Sequence[FarMember]) -> Table:
    """The spread of every parameter over the members whose fits are sound, and what is to be said of single members."""
    sound = set(members.loc[members["trustworthy"].astype(bool), "member"])
    counts = estimates[estimates["member"].isin(sound) & (estimates["status"] == "identified")]
    rows = []
    for name, unit in _free(members, estimates)[["parameter", "unit"]].itertuples(index=False):
        own = counts[counts["parameter"] == name]
        cells = [Cell(name), Cell(unit, "dim"), Cell(str(len(own)))]
        if len(own):
            low, middle, high = np.quantile(own["value"], [0.05, 0.5, 0.95])
            error = float(np.median(own["std_error"]))
            cells += [Cell(f"{x:.5g}") for x in (low, middle, high)] + [Cell(f"{error:.2g}")]
        rows.append(tuple(cells + [Cell("")] * (7 - len(cells))))
    by_name = members.set_index("member")
    doubted, failed = _doubted(members), members[members["failure"] != ""]
    first = [one.sentence for one in far[:_SHOWN]]
    notes = [f"{name}: {why}" for name, why in failed[["member", "failure"]].head(_SHOWN).itertuples(index=False)]
    notes += [f"{name}: {by_name.loc[name, 'why']}" for name in doubted[:_SHOWN]]
    left = len(failed) + len(doubted) - len(notes)
    notes += [f"{left} more in members.parquet."] if left > 0 else []
    header = ("parameter", "unit", "sound fits", "5 %", "median", "95 %", "median std. error")
    return Table("Parameters over the fleet", header, tuple(rows), (*first, *notes))


def members_table(
    members: pd.DataFrame, estimates: pd.DataFrame, far: Sequence[FarMember], explanations: pd.DataFrame | None
) -> Table:
    """Every member's estimates, what its residual says of them and what it lacks, the first `_ON_PAGE`."""
    free = _free(members, estimates)
    names = list(free["parameter"])
    out = {(one.member, one.parameter) for one in far}
    shown = members.head(_ON_PAGE)
    own = {
        (row.member, row.parameter): Estimate(row.value, row.std_error, (row.low, row.high), row.unit, row.status)
        for row in estimates[estimates["member"].isin(set(shown["member"]))].itertuples(index=False)
    }
    rows = []
    for number, (name, verdict, sound, failure) in enumerate(
        shown[["member", "verdict", "trustworthy", "failure"]].itertuples(index=False)
    ):
        missing = [] if explanations is None else [_missing(explanations.iloc[number])]
        if failure:
            rows.append((Cell(name), Cell(f"no fit: {failure}", "bad"), *[Cell("-")] * (len(missing) + len(names))))
            continue
        cells = (_own_cell(own[name, symbol], bool(sound), (name, symbol) in out) for symbol in names)
        rows.append((Cell(name), Cell(verdict or "-", "" if sound else "bad"), *missing, *cells))
    units = (f"{n} [{u}]" if u else n for n, u in free[["parameter", "unit"]].itertuples(index=False))
    asked = [] if explanations is None else ["missing"]
    more = (f"{len(members) - _ON_PAGE} more in members.parquet and estimates.parquet.",)
    notes = ("± is one standard error.", *([DOUBT] if _doubted(members) else []))
    notes += (_FAR,) if far else ()
    header = ("member", "judged", *asked, *units)
    return Table("Members", header, tuple(rows), notes + more * (len(members) > _ON_PAGE))


def _missing(explanation: pd.Series) -> Cell:
    """A member's explanation in words."""
    if explanation["failure"]:
        return Cell(f"no explanation: {explanation['failure']}", "bad")
    named = explanation["effects"].replace("_", " ").replace(",", ", ")
    return Cell(f"{explanation['verdict']}{': ' if named else ''}{named}")


def _own_cell(estimate: Estimate, sound: bool, far: bool) -> Cell:
    cell = value_cell(estimate, not sound)
    return Cell(f"{cell.text} far", "bad") if far else cell


def write_page(out: Path, robot: Robot, said: Sequence[str], tables: Sequence[Table]) -> None:
    """Write report.html. Raises `OSError`."""
    title = html.escape(f"jaxid fleet {robot.name}")
    body = "".join(f"<p><b>{html.escape(text)}</b></p>" for text in said) + "".join(map(to_html, tables))
    write_text(
        out / "report.html",
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title></head>'
        f'<body style="font-family:sans-serif"><h2>{title}</h2>{body}</body></html>\n',
    )
