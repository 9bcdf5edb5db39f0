"""`jaxid fleet`: a folder of robots, each fitted on its own logs, in one batch; tables for programs, a summary for people."""

import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from .._atomic import write_text
from ..estimate.linear.integral_least_squares import linear_estimate
from ..estimate.output_error.far_members import FarMember, far_members
from ..estimate.output_error.fleet import fit_fleet
from ..estimate.result import Fit
from ..logs import LogError, LogSet, read_logs
from ..parameters import ParameterError
from ..report.fleet_files import ESTIMATES, MEMBERS, estimate_rows, member_row, with_distances, write_tables
from ..report.tables import DOUBT, Cell, Table, to_html, to_text, value_cell
from ..robots import Robot
from .arguments import UnusableInput
from .cache import keep_compiled_programs
from .console import say, show, step
from .fit import identifiable, prepare_folder

BATCH = 256
"""Members at a time: what is done is in the files, and memory stays bounded."""
_ENDINGS = (".csv", ".parquet", ".pq")
_SHOWN = 10
_FAR = "far: farther from the fleet's median than chance makes a sound member, by its spread and the standard error."
_ON_PAGE = 200
"""Members that the page lists."""


def members_of(folder: Path) -> dict[str, list[Path]]:
    """Logs by member: a member is a folder with logs, or, where there are none, a log. Raises `UnusableInput`."""
    if not folder.is_dir():
        raise UnusableInput(f"{folder} is no folder; give one with a folder of logs for every robot.")

    def logs_in(place: Path) -> list[Path]:
        return sorted(p for p in place.iterdir() if p.is_file() and p.suffix.lower() in _ENDINGS)

    folders = {place.name: logs_in(place) for place in sorted(folder.iterdir()) if place.is_dir()}
    found = {name: logs for name, logs in folders.items() if logs}
    own = logs_in(folder)
    if found and own:
        raise UnusableInput(
            f"{folder} has folders with logs and logs of its own, such as {own[0].name}; put each robot's into a folder."
        )
    if not (found or own):
        raise UnusableInput(
            f"{folder} holds no logs ({', '.join(_ENDINGS)}), nor does any folder in it; check the path."
        )
    return found or {path.stem: [path] for path in own}


def _started(robot: Robot, logs: LogSet) -> Fit | None:
    """The linear estimate, from which output error starts; None where there is none."""
    try:
        return linear_estimate(robot, logs)[0]
    except (ParameterError, LogError):
        return None


def _batch(
    robot: Robot,
    files: Mapping[str, Sequence[Path]],
    mapping: Path | None,
    options: Mapping[str, Any],
    report: Callable[[str], None],
) -> tuple[list[tuple[Any, ...]], list[tuple[Any, ...]], dict[str, Fit]]:
    """Rows of both tables and the fits."""
    logs: dict[str, LogSet] = {}
    failed: dict[str, str] = {}
    for name, paths in files.items():
        try:
            logs[name] = read_logs(paths, robot, mapping=mapping)
        except LogError as error:
            failed[name] = str(error)
    fits: dict[str, Fit] = {}
    if logs:
        starts = {name: _started(robot, own) for name, own in logs.items()}
        report("linear estimates are there, from which output error starts")
        # What every member goes through is told of a few; of thousands nobody could read it.
        told = report if len(logs) <= _SHOWN else lambda message: None
        fleet = fit_fleet(robot, logs, start=starts, report=told, **options)
        fits, failed = {n: _with_findings(fit, logs[n]) for n, fit in fleet.fits.items()}, failed | fleet.failed
    estimates = [row for name, fit in fits.items() for row in estimate_rows(name, fit)]
    members = [member_row(name, logs.get(name), fits.get(name), failed.get(name, "")) for name in files]
    return estimates, members, fits


def _with_findings(fit: Fit, logs: LogSet) -> Fit:
    """The fit with what pre-flight says of its logs among its notes, such as a column of the wrong sign."""
    found = [str(f) for f in logs.preflight() if f.severity in ("error", "warning")]
    return replace(fit, notes=(*fit.notes, *dict.fromkeys(found)))


def _why(fit: Fit) -> str:
    """Why a fit is doubted: what pre-flight says of its logs, which may be the reason, then its judgement."""
    found = [note for note in fit.notes if note.startswith(("error:", "warning:"))]
    said = [fit.judgement.sentence] if fit.judgement is not None else []
    return " ".join([*found, *said])


def _summary(
    fits: Mapping[str, Fit], members: Sequence[tuple[Any, ...]], far: Sequence[FarMember]
) -> tuple[list[str], Table]:
    """How the fleet fared, and the spread of every parameter over the members whose fits are sound."""
    failure = {row[0]: row[-1] for row in members if row[-1]}
    doubted = [name for name, fit in fits.items() if not fit.trustworthy]
    how = "is" if len(doubted) == 1 else "are"
    said = [f"{len(fits)} of {len(members)} members fitted; {len(doubted)} of these {how} to be doubted."]
    if far:
        out = list(dict.fromkeys(one.member for one in far))
        more = f" and {len(out) - _SHOWN} more" if len(out) > _SHOWN else ""
        said.append(f"Far from the others: {', '.join(out[:_SHOWN])}{more}.")
    rows = []
    sound = [fit for fit in fits.values() if fit.trustworthy]
    for name in next(iter(fits.values())).free_names if fits else ():
        own = [fit[name] for fit in sound if fit[name].status == "identified"]
        cells = [Cell(name), Cell(next(iter(fits.values()))[name].unit, "dim"), Cell(str(len(own)))]
        if own:
            low, middle, high = np.quantile([e.value for e in own], [0.05, 0.5, 0.95])
            error = float(np.median([e.std_error for e in own]))
            cells += [Cell(f"{x:.5g}") for x in (low, middle, high)] + [Cell(f"{error:.2g}")]
        rows.append(tuple(cells + [Cell("")] * (7 - len(cells))))
    first = [one.sentence for one in far[:_SHOWN]]
    notes = [f"{name}: {why}" for name, why in islice(failure.items(), _SHOWN)]
    notes += [f"{name}: {_why(fits[name])}" for name in doubted[:_SHOWN]]
    left = len(failure) + len(doubted) - len(notes)
    notes += [f"{left} more in members.parquet."] if left > 0 else []
    header = ("parameter", "unit", "sound fits", "5 %", "median", "95 %", "median std. error")
    return said, Table("Parameters over the fleet", header, tuple(rows), (*first, *notes))


def _own_cell(fit: Fit, symbol: str, far: bool) -> Cell:
    cell = value_cell(fit[symbol], not fit.trustworthy)
    return Cell(f"{cell.text} far", "bad") if far else cell


def _members_table(fits: Mapping[str, Fit], members: Sequence[tuple[Any, ...]], far: Sequence[FarMember]) -> Table:
    """Every member's estimates and what its residual says of them, the first `_ON_PAGE`."""
    names = next(iter(fits.values())).free_names if fits else ()
    out = {(one.member, one.parameter) for one in far}
    rows = []
    for name, *_, failure in members[:_ON_PAGE]:
        fit = fits.get(name)
        if fit is None:
            rows.append((Cell(name), Cell(f"no fit: {failure}", "bad"), *[Cell("-")] * len(names)))
            continue
        verdict = fit.judgement.verdict if fit.judgement else "-"
        cells = (_own_cell(fit, symbol, (name, symbol) in out) for symbol in names)
        rows.append((Cell(name), Cell(verdict, "" if fit.trustworthy else "bad"), *cells))
    units = (f"{n} [{u}]" if (u := next(iter(fits.values()))[n].unit) else n for n in names)
    more = (f"{len(members) - _ON_PAGE} more in members.parquet and estimates.parquet.",)
    notes = ("± is one standard error.", *([DOUBT] if any(not fit.trustworthy for fit in fits.values()) else []))
    notes += (_FAR,) if far else ()
    return Table("Members", ("member", "judged", *units), tuple(rows), notes + more * (len(members) > _ON_PAGE))


def _write_page(out: Path, robot: Robot, said: Sequence[str], tables: Sequence[Table]) -> None:
    title = html.escape(f"jaxid fleet {robot.name}")
    body = "".join(f"<p><b>{html.escape(text)}</b></p>" for text in said) + "".join(map(to_html, tables))
    write_text(
        out / "report.html",
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title></head>'
        f'<body style="font-family:sans-serif"><h2>{title}</h2>{body}</body></html>\n',
    )


def run_fleet(
    spec: str, folder: Path, model: Path | None, mapping: Path | None, out: Path, options: Mapping[str, Any]
) -> None:
    """Write estimates.parquet and members.parquet to `out`, batch by batch, then report.html, and print a summary.

    A member whose logs cannot be read or fitted is named and does not touch the others. Raises `UnusableInput` where no
    member could be fitted.
    """
    keep_compiled_programs()
    prepare_folder(out)
    files = members_of(folder)
    first = [str(path) for path in next(iter(files.values()))]
    robot = identifiable(spec, model, first, mapping)
    say(f"{len(files)} members")
    estimates: list[tuple[Any, ...]] = []
    members: list[tuple[Any, ...]] = []
    fits: dict[str, Fit] = {}
    names = list(files)
    for begin in range(0, len(names), BATCH):
        some = names[begin : begin + BATCH]
        with step(f"Members {begin + 1} to {begin + len(some)} of {len(names)}") as report:
            more, became, found = _batch(robot, {name: files[name] for name in some}, mapping, options, report)
        estimates, members, fits = estimates + more, members + became, fits | found
        write_tables(out, {"estimates.parquet": (ESTIMATES, estimates), "members.parquet": (MEMBERS, members)})
    far = far_members(fits)
    if far:
        write_tables(out, {"estimates.parquet": (ESTIMATES, with_distances(estimates, far))})
    said, spread = _summary(fits, members, far)
    show(to_text([spread], said))
    _write_page(out, robot, said, [spread, _members_table(fits, members, far)])
    say(f"{out}: estimates.parquet, members.parquet, report.html")
    if not fits:
        raise UnusableInput(f"No member could be fitted; the first: {members[0][-1]}")
