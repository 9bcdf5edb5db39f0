"""What people read of a fleet: sentences, the spread of every parameter, and a row for every member."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..estimate.output_error.far_members import FarMember, OneParameter, too_few
from ..estimate.result import Estimate
from ..explanation.fleet import named, summary
from ..report.document import Listing, Page, Section, Tabled, texts
from ..report.fleet_files import Columns, remarks_on_logs
from ..report.tables import DOUBT, Cell, Table, value_cell
from ..robots import Robot

_SHOWN = 10
_FAR = "far: farther from the fleet's median than chance makes a sound member, by its spread and the standard error."
_UNKNOWN = {
    "not_identifiable": "Not determined by a sound member's logs",
    "at_bound": "On its bound, of a sound member",
}
_EXPLAINED = ("verdict", "effects", "equivalent", "failure")
_ON_PAGE = 200
"""Members that the page lists."""


def _sound(members: Columns) -> NDArray[Any]:
    """The names of members whose fits are trustworthy."""
    return members["member"][members["trustworthy"].astype(bool)]


def _doubted(members: Columns) -> list[str]:
    return list(members["member"][(members["failure"] == "") & ~members["trustworthy"].astype(bool)])


def _remarked(members: Columns) -> dict[str, list[str]]:
    """What is said of the logs of members whose fits are sound all the same."""
    sound = set(_sound(members))
    said = {m: remarks_on_logs(notes.split("\n")) for m, notes in zip(members["member"], members["notes"], strict=True)}
    return {member: found for member, found in said.items() if found and member in sound}


def _counting(members: Columns, estimates: Columns) -> NDArray[Any]:
    """Which estimates are identified ones of sound members."""
    sound = set(_sound(members))
    of_sound = np.fromiter((member in sound for member in estimates["member"]), bool, len(estimates["member"]))
    return of_sound & (estimates["status"] == "identified")


def _of_status(members: Columns, estimates: Columns, status: str) -> dict[str, list[str]]:
    """Free parameters of this status, by sound member."""
    sound, found = set(_sound(members)), {}
    for k in np.flatnonzero((estimates["status"] == status) & estimates["free"].astype(bool)):
        if estimates["member"][k] in sound:
            found.setdefault(estimates["member"][k], []).append(estimates["parameter"][k])
    return found


def identified(members: Columns, estimates: Columns) -> dict[str, OneParameter]:
    """What the sound members have identified, by parameter: what `far_estimates` judges."""
    values, errors = (estimates[name].astype(float) for name in ("value", "std_error"))
    counts = _counting(members, estimates) & np.isfinite(values) & np.isfinite(errors)
    found = {}
    for name in dict.fromkeys(estimates["parameter"][counts]):
        own = counts & (estimates["parameter"] == name)
        unit = str(estimates["unit"][own][0])
        found[name] = OneParameter(list(estimates["member"][own]), unit, values[own], errors[own])
    return found


def sentences(tables: Mapping[str, Columns], far: Sequence[FarMember]) -> list[str]:
    """How the fleet fared, and what it lacks where that was looked for."""
    failure = tables["members"]["failure"]
    doubted = _doubted(tables["members"])
    how = "is" if len(doubted) == 1 else "are"
    fitted = np.count_nonzero(failure == "")
    said = [f"{fitted} of {len(failure)} members fitted; {len(doubted)} of these {how} to be doubted."]
    if doubted and "explanations" not in tables:
        said.append("What a member lacks that is to be doubted: the same command with --explain and --held-out.")
    for status, what in _UNKNOWN.items():
        if found := _of_status(tables["members"], tables["estimates"], status):
            more = f" and {len(found) - _SHOWN} more" if len(found) > _SHOWN else ""
            listed = (f"{member} ({', '.join(names)})" for member, names in list(found.items())[:_SHOWN])
            said.append(f"{what}: {', '.join(listed)}{more}.")
    if far:
        out = list(dict.fromkeys(one.member for one in far))
        more = f" and {len(out) - _SHOWN} more" if len(out) > _SHOWN else ""
        said.append(f"Far from the others: {', '.join(out[:_SHOWN])}{more}.")
    said += filter(None, [too_few(len(_sound(tables["members"])), len(failure))])
    if remarked := list(_remarked(tables["members"])):
        more = f" and {len(remarked) - _SHOWN} more" if len(remarked) > _SHOWN else ""
        said.append(f"Sound, with something to look at in the logs: {', '.join(remarked[:_SHOWN])}{more}.")
    if "explanations" in tables:
        every = (tables["explanations"][name] for name in ("member", *_EXPLAINED))
        every = list(zip(*every, strict=True))
        said += summary(every)
        # Why a member has no fit stands with the fits.
        without = [f"{name}: no explanation: {why}" for name, *_, why in every if why and why not in failure]
        said += without[:_SHOWN]
    return said


def _free(members: Columns, estimates: Columns) -> list[tuple[str, str]]:
    """The free parameters, and their units: those of the first member that has a fit, then what is free in others alone, such
    as a constant that was found to be off."""
    fitted = members["member"][members["failure"] == ""]
    free = estimates["free"].astype(bool)
    units = dict(zip(estimates["parameter"][free], estimates["unit"][free], strict=True))
    first = estimates["parameter"][free & (estimates["member"] == fitted[0])] if len(fitted) else ()
    return [(name, units[name]) for name in dict.fromkeys([*first, *units])]


def spread_table(members: Columns, estimates: Columns, far: Sequence[FarMember]) -> Table:
    """The spread of every parameter over the members whose fits are sound, and what is to be said of single members."""
    counts = _counting(members, estimates)
    rows = []
    for name, unit in _free(members, estimates):
        own = counts & (estimates["parameter"] == name)
        cells = [Cell(name), Cell(unit, "dim value"), Cell(str(np.count_nonzero(own)))]
        if own.any():
            low, middle, high = np.quantile(estimates["value"][own].astype(float), [0.05, 0.5, 0.95])
            error = float(np.median(estimates["std_error"][own].astype(float)))
            cells += [Cell(f"{x:.5g}") for x in (low, middle, high)] + [Cell(f"{error:.2g}")]
        rows.append(tuple(cells + [Cell("")] * (7 - len(cells))))
    why = dict(zip(members["member"], members["why"], strict=True))
    doubted, failed = _doubted(members), np.flatnonzero(members["failure"] != "")
    first = [one.sentence for one in far[:_SHOWN]]
    notes = [f"{members['member'][k]}: {members['failure'][k]}" for k in failed[:_SHOWN]]
    notes += [f"{name}: {why[name]}" for name in doubted[:_SHOWN]]
    remarked = _remarked(members)
    notes += [f"{name}: {' '.join(found)}" for name, found in list(remarked.items())[:_SHOWN]]
    left = len(failed) + len(doubted) + len(remarked) - len(notes)
    notes += [f"{left} more in members.parquet."] if left > 0 else []
    header = ("parameter", "unit", "sound fits", "5 %", "median", "95 %", "median std. error")
    return Table("Parameters over the fleet", header, tuple(rows), (*first, *notes))


def members_table(
    members: Columns, estimates: Columns, far: Sequence[FarMember], explanations: Columns | None
) -> Table:
    """Every member's estimates, what its residual says of them and what it lacks, the first `_ON_PAGE`."""
    free = _free(members, estimates)
    out = {(one.member, one.parameter) for one in far}
    shown = set(members["member"][:_ON_PAGE])
    fields = ("member", "parameter", "value", "std_error", "low", "high", "unit", "status")
    own = {
        (member, name): Estimate(float(value), float(error), (float(low), float(high)), unit, status)
        for member, name, value, error, low, high, unit, status in zip(*(estimates[f] for f in fields), strict=True)
        if member in shown
    }
    rows = []
    for k, name in enumerate(members["member"][:_ON_PAGE]):
        failure, sound = members["failure"][k], bool(members["trustworthy"][k])
        missing = [] if explanations is None else [_missing(*(explanations[f][k] for f in _EXPLAINED))]
        if failure:
            rows.append((Cell(name), Cell(f"no fit: {failure}", "bad"), *[Cell("-")] * (len(missing) + len(free))))
            continue
        cells = (
            _own_cell(own[name, symbol], sound, (name, symbol) in out) if (name, symbol) in own else Cell("-")
            for symbol, _ in free
        )
        rows.append((Cell(name), Cell(members["verdict"][k] or "-", "" if sound else "bad"), *missing, *cells))
    units = (f"{n} [{u}]" if u else n for n, u in free)
    header = ("member", "judged", *([] if explanations is None else ["missing"]), *units)
    left = len(members["member"]) - _ON_PAGE
    notes = ("± is one standard error.", *([DOUBT] if _doubted(members) else []), *([_FAR] if far else []))
    more = (f"{left} more in members.parquet and estimates.parquet.",) * (left > 0)
    return Table("Members", header, tuple(rows), notes + more)


def _missing(verdict: str, effects: str, equivalent: str, failure: str) -> Cell:
    """A member's explanation in words."""
    if failure:
        return Cell(f"no explanation: {failure}", "bad")
    lacks = named(verdict, effects, equivalent)
    return Cell("nothing" if verdict == "adequate" else f"{verdict}{': ' if lacks else ''}{lacks}")


def _own_cell(estimate: Estimate, sound: bool, far: bool) -> Cell:
    """An estimate with its standard error below it."""
    cell = value_cell(estimate, not sound)
    value, _, error = cell.text.partition(" ± ")
    if error:
        # "(2.11 ± 0.15)e-4" is of one power of ten, which both have then.
        inner, closed, rest = error.partition(")")
        power, _, mark = rest.partition(" ") if closed else ("", "", "")
        inner, _, own_mark = inner.partition(" ")
        cell = replace(cell, text=f"{value.lstrip('(')}{power} {mark or own_mark}".strip(), detail=f"± {inner}{power}")
    return replace(cell, text=f"{cell.text} far", mark="bad") if far else cell


def _with_meanings(table: Table, robot: Robot) -> Table:
    """The table with what every parameter stands for below its symbol."""

    def named(cell: Cell) -> Cell:
        known = robot.parameters[cell.text].meaning if cell.text in robot.parameters else ""
        return replace(cell, detail=known)

    return replace(table, rows=tuple((named(row[0]), *row[1:]) for row in table.rows))


def fleet_page(robot: Robot, said: Sequence[str], tables: Sequence[Table], explained: bool) -> Page:
    """The page of a fleet: what stands out, then the spread and every member, then what to do."""
    headline, *rest = said or (f"A fleet of {robot.name}.",)
    tables = [_with_meanings(tables[0], robot), *tables[1:]]
    doubt = any("bad" in cell.mark for table in tables for row in table.rows for cell in row)
    items = ["Look first at members that are marked: their logs, then what `jaxid explain` says of each."]
    items += [] if explained else ["What each robot lacks: the same command with --explain and --held-out."]
    return Page(
        title=f"jaxid fleet {robot.name}",
        kind=f"jaxid fleet: {robot.name}",
        verdict="Some to look at" if doubt else "Sound",
        tone="open" if doubt else "good",
        headline=headline,
        lead=texts(rest),
        sections=tuple(Section(table.title, (Tabled(replace(table, title="")),)) for table in tables),
        next=(Listing(tuple(items)),),
    )
