"""A fleet's results: a Parquet file for each part of the members while it is worked on, and the tables of all of them.

A part's file holds a row for every member of it, with its estimates as a list in a column of their own: it is there whole or
not at all.
"""

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from .._atomic import replacing
from ..estimate.output_error.far_members import FarMember
from ..estimate.result import Fit
from ..explanation.explanation import Explanation
from ..explanation.fleet import EFFECTS, EXPLANATIONS, effect_rows, explanation_row
from ..logs import LogSet

ESTIMATES = ("member", "parameter", "value", "std_error", "low", "high", "unit", "status", "far")
MEMBERS = (
    "member", "logs", "samples", "method", "verdict", "trustworthy", "converged", "reason", "iterations",
    "standard_errors", "cost", "notes", "failure",
)  # fmt: skip
_OF_ESTIMATE = (*ESTIMATES[:-1], "free")
_ESTIMATE = pa.struct(
    [
        *((name, pa.string()) for name in ("parameter", "unit", "status")),
        *((name, pa.float64()) for name in ("value", "std_error", "low", "high")),
        ("free", pa.bool_()),
    ]
)
_PART = pa.schema(
    [
        *((name, pa.string()) for name in ("member", "method", "verdict", "reason", "standard_errors", "notes", "failure")),
        *((name, pa.int64()) for name in ("logs", "samples", "iterations")),
        *((name, pa.bool_()) for name in ("trustworthy", "converged")),
        ("cost", pa.float64()),
        ("why", pa.string()),
        ("estimates", pa.list_(_ESTIMATE)),
        ("explanation", pa.string()),
        ("unexplained", pa.string()),
    ]
)  # fmt: skip
Columns = dict[str, NDArray[Any]]
"""A table: columns of one length by name."""
Row = dict[str, Any]
"""What became of a member. Beside the columns of `MEMBERS`: `why` its fit is doubted, its `estimates`, its `explanation` (the
text of explanation.json, empty without one) and why it has none (`unexplained`)."""


def remarks_on_logs(notes: Iterable[str]) -> list[str]:
    """Of a fit's notes, what is wrong with its logs, or may be."""
    return [note for note in notes if note.startswith(("error:", "warning:"))]


def member_row(
    member: str,
    logs: LogSet | None,
    fit: Fit | None,
    failure: str = "",
    why: str = "",
    explanation: Explanation | None = None,
    unexplained: str = "",
) -> Row:
    """What became of one member. `fit` is that of the model with what was found missing, where that was looked for; what such
    an effect is has a table of its own."""
    told = json.dumps(explanation.to_dict()) if explanation is not None else ""
    counted = {} if logs is None else {"logs": len(logs), "samples": sum(map(len, logs))}
    nothing = {name: "" for name in ("method", "verdict", "reason", "standard_errors", "notes")}
    row = {
        "member": member, "logs": 0, "samples": 0, **counted, **nothing, "trustworthy": False, "converged": False,
        "iterations": 0, "cost": float("nan"), "failure": failure, "why": why, "estimates": [], "explanation": told,
        "unexplained": unexplained,
    }  # fmt: skip
    if fit is None:
        return row
    estimates = []
    own = fit.free_names
    if explanation is not None:
        own = [name for name in own if name in explanation.baseline.robot.parameters]
    for name in (*own, *fit.combinations):
        e = fit[name]
        low, high = e.ci95
        numbers = {"value": e.value, "std_error": e.std_error, "low": low, "high": high}
        estimates.append(
            {"parameter": name, "unit": e.unit, "status": e.status, **numbers, "free": name in fit.free_names}
        )
    return row | {
        "method": fit.method, "verdict": fit.judgement.verdict if fit.judgement else "", "trustworthy": fit.trustworthy,
        "converged": fit.converged, "reason": fit.reason, "iterations": fit.iterations,
        "standard_errors": fit.standard_errors, "cost": fit.cost, "notes": "\n".join(fit.notes), "failure": "",
        "estimates": estimates,
    }  # fmt: skip


def write_part(path: Path, rows: Sequence[Row]) -> None:
    """Write a part's rows. Raises `OSError`."""
    with replacing(path) as temporary:
        pq.write_table(pa.Table.from_pylist(list(rows), _PART), temporary)


def read_parts(paths: Iterable[Path]) -> dict[str, Columns]:
    """All parts as tables by name: "members" (with `why` its fit is doubted) and "estimates" (with whether the parameter is
    `free`, and no `far`), and, where any member was to be explained, "explanations" and "effects"."""
    names = {"members": (*MEMBERS, "why"), "estimates": _OF_ESTIMATE, "explanations": EXPLANATIONS, "effects": EFFECTS}
    found: dict[str, list[tuple[Any, ...]]] = {table: [] for table in names}
    asked = False
    for path in paths:
        for row in pq.read_table(path).to_pylist():
            member, document, why = row["member"], json.loads(row["explanation"] or "null"), row["unexplained"]
            found["members"].append(tuple(row[name] for name in names["members"]))
            for one in row["estimates"]:
                # Of millions of rows the same few words are kept once.
                words = {name: sys.intern(one[name]) for name in ("parameter", "unit", "status")}
                found["estimates"].append(tuple(({"member": member} | one | words)[name] for name in _OF_ESTIMATE))
            found["explanations"].append(explanation_row(member, document, why))
            found["effects"] += effect_rows(member, document) if document else []
            asked = asked or bool(document or why)
    tables = {name: columns(found[name], names[name]) for name in names}
    return tables if asked else {name: tables[name] for name in ("members", "estimates")}


def columns(rows: Sequence[tuple[Any, ...]], names: Sequence[str]) -> Columns:
    """Columns by name of rows; words are objects."""
    by = zip(*rows, strict=True) if rows else [()] * len(names)
    return {n: np.array(v, object if v and isinstance(v[0], str) else None) for n, v in zip(names, by, strict=True)}


def with_distances(estimates: Columns, far: Sequence[FarMember]) -> Columns:
    """The estimates with the distances of those that are far from the fleet, in the last column, `far`."""
    distances = {(one.member, one.parameter): one.distance for one in far}
    keys = zip(estimates["member"], estimates["parameter"], strict=True)
    return {n: estimates[n] for n in ESTIMATES[:-1]} | {"far": np.array([distances.get(key, 0.0) for key in keys])}


def write_tables(out: Path, tables: Mapping[str, Columns]) -> None:
    """`tables` by file name; each file is replaced whole. Raises `OSError`."""
    for name, table in tables.items():
        with replacing(out / name) as temporary:
            pd.DataFrame(table).to_parquet(temporary, index=False)
