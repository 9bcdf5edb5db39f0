"""A fleet's results as two Parquet tables: estimates.parquet, a row for every member and parameter, and members.parquet."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from .._atomic import replacing
from ..estimate.output_error.far_members import FarMember
from ..estimate.result import Fit
from ..logs import LogSet

ESTIMATES = ("member", "parameter", "value", "std_error", "low", "high", "unit", "status", "far")
MEMBERS = (
    "member", "logs", "samples", "method", "verdict", "trustworthy", "converged", "reason", "iterations",
    "standard_errors", "cost", "notes", "failure",
)  # fmt: skip


def estimate_rows(member: str, fit: Fit) -> list[tuple[Any, ...]]:
    """A row for each free parameter, and for what the logs determine when single parameters are not; columns `ESTIMATES`."""
    rows = []
    for name in (*fit.free_names, *fit.combinations):
        e = fit[name]
        rows.append((member, name, e.value, e.std_error, *e.ci95, e.unit, e.status, 0.0))
    return rows


def with_distances(rows: Sequence[tuple[Any, ...]], far: Sequence[FarMember]) -> list[tuple[Any, ...]]:
    """The rows with the distances of those that are far from the fleet, in the last column."""
    distances = {(one.member, one.parameter): one.distance for one in far}
    return [(*row[:-1], distances.get((row[0], row[1]), 0.0)) for row in rows]


def member_row(member: str, logs: LogSet | None, fit: Fit | None, failure: str = "") -> tuple[Any, ...]:
    """What became of one member; columns `MEMBERS`."""
    counted = (0, 0) if logs is None else (len(logs), sum(map(len, logs)))
    if fit is None:
        return (member, *counted, "", "", False, False, "", 0, "", float("nan"), "", failure)
    verdict = fit.judgement.verdict if fit.judgement else ""
    return (
        member, *counted, fit.method, verdict, fit.trustworthy, fit.converged, fit.reason, fit.iterations,
        fit.standard_errors, fit.cost, "\n".join(fit.notes), "",
    )  # fmt: skip


def write_tables(out: Path, tables: Mapping[str, tuple[Sequence[str], Sequence[tuple[Any, ...]]]]) -> None:
    """`tables`: columns and rows by file name; each file is replaced whole. Raises `OSError`."""
    for name, (columns, rows) in tables.items():
        with replacing(out / name) as temporary:
            pd.DataFrame(list(rows), columns=list(columns)).to_parquet(temporary, index=False)
