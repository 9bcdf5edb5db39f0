"""The demonstration: both papers' robots from the logs that come with the package, whose truth is known.

The logs were written by an independent simulator (`jaxid/demo_logs/README.md`). Estimates start well away from the
truth, and the papers' tables are computed again by the papers' own methods.
"""

import math
import tomllib
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .estimate.linear.integral_least_squares import integral_least_squares
from .estimate.result import Fit
from .logs import LogSet, read_logs
from .papers.omni import tables as omni_tables
from .papers.omni.experiments import method_1, method_2
from .papers.omni.hanging import method_3, read_hanging
from .papers.paper_table import PaperTable
from .robots import BUILT_IN, Pioneer, Robot

ROBOTS = ("pioneer", "omni")
START_FACTOR = 1.5
"""Start values of the free parameters are this multiple of the truth."""

STRAIGHT = ("straight_1_prbs.csv", "straight_2_prbs.csv", "straight_3_step.csv")
SPOT = ("spot_1_step.csv", "spot_2_prbs.csv", "spot_3_prbs.csv")

# Innocenti et al., Tables 3-5: rows 1/a11 [kg], Cv [N m s], Cs [N m] and 1/a22 [kg m^2], Cv1 [N m s], Cs1 [N m].
TABLE_3 = ((17.83, 0.0441, 0.3349), (16.49, 0.0445, 0.3287), (16.89, 0.0446, 0.2921), (17.07, 0.0444, 0.3186))
TABLE_4 = ((0.4301, 0.000429, 0.004535), (0.4127, 0.000389, 0.004532), (0.4292, 0.000469, 0.004541),
           (0.424, 0.000429, 0.004536))  # fmt: skip
TABLE_5 = {"I0": 0.3, "Ir1": 2.144e-4, "Ir": 0.0012, "Ip1": 1.072e-4, "Cs1": 0.004536, "Cv1": 0.000429, "Cs": 0.3184,
           "Cv": 0.0444}  # fmt: skip


def folder(name: str) -> Path:
    """Folder of the demonstration logs: "pioneer", "omni", "pioneer_paper", "omni_paper" or "unknown"."""
    return Path(str(files("jaxid"))) / "demo_logs" / name


def truth(name: str) -> dict[str, float]:
    """The constants behind a folder's logs, by symbol, SI units."""
    return tomllib.loads((folder(name) / "truth.toml").read_text(encoding="utf-8"))


class Case(NamedTuple):
    """One robot of the demonstration: start values, logs to fit and to check, and the truth by symbol."""

    robot: Robot
    fit: LogSet
    check: LogSet
    truth: dict[str, float]


def case(name: str) -> Case:
    """The Pioneer ("pioneer") or the omni ("omni") with its demonstration logs."""
    robot = BUILT_IN[name]()
    known = {symbol: value for symbol, value in truth(name).items() if symbol in robot.parameters}
    robot = robot.with_values(**known)
    start = {symbol: START_FACTOR * robot.parameters[symbol].value for symbol in robot.parameters.free_names}
    return Case(
        robot.with_values(**start),
        read_logs(folder(name) / "fit_*.csv", robot),
        read_logs(folder(name) / "check_*.csv", robot),
        known,
    )


def title(name: str) -> str:
    """What the demonstration does with a robot, in a sentence."""
    return (
        f"{name.capitalize()}: identified from its demonstration logs, starting from {START_FACTOR:g} times the truth."
    )


def _movement(
    title: str,
    fits: Sequence[tuple[str, Fit]],
    symbols: Sequence[str],
    paper: Sequence[Sequence[float]],
    notes: tuple[str, ...],
) -> PaperTable:
    """One row for each experiment, then the mean; every estimate with its standard error next to the paper's."""
    rows = []
    values = np.array([[fit[symbol].value for symbol in symbols] for _, fit in fits])
    errors = np.array([[fit[symbol].std_error for symbol in symbols] for _, fit in fits])
    for i, (name, _) in enumerate(fits):
        cells = [(values[i, j], errors[i, j], paper[i][j]) for j in range(len(symbols))]
        rows.append((name, *(cell for three in cells for cell in three)))
    # Standard error of the mean from the experiments' scatter, which needs no assumption about each of them; none where
    # an experiment determines nothing.
    scatter = np.where(np.isfinite(errors).all(axis=0), values.std(axis=0, ddof=1) / math.sqrt(len(fits)), np.nan)
    means = [(values[:, j].mean(), scatter[j], paper[-1][j]) for j in range(len(symbols))]
    rows.append(("mean", *(cell for three in means for cell in three)))
    # Column names must differ from one another.
    columns = [(symbol, "std error" + " " * j, "paper" + " " * j) for j, symbol in enumerate(symbols)]
    return PaperTable(title, ("experiment", *(c for three in columns for c in three)), tuple(rows), notes)


def pioneer_tables() -> list[PaperTable]:
    """Tables 3-5 of Innocenti et al. by the paper's way: equations 34 and 35 on uncoupled experiments, three each."""
    robot = Pioneer()
    logs = read_logs([folder("pioneer_paper") / name for name in (*STRAIGHT, *SPOT)], robot)
    single = {
        log.name: integral_least_squares(robot, logs[i : i + 1], equations="uncoupled") for i, log in enumerate(logs)
    }
    together = integral_least_squares(robot, logs, equations="uncoupled")
    straight = [(name.removesuffix(".csv"), single[name]) for name in STRAIGHT]
    spot = [(name.removesuffix(".csv"), single[name]) for name in SPOT]
    coupled = (
        "The simulated robot is the coupled one: turning on the spot, its centre of mass pulls it backwards",
        "and the caster moves, which equation 35 books as caster friction. Its true Cv1 and Cs1 are the",
        "paper's; output error on the coupled model recovers them (first table of this demonstration).",
    )
    rows = []
    for name, paper in TABLE_5.items():
        e = together[name]
        status = e.status.replace("_", " ")
        rows.append((name, e.value, e.std_error, e.unit, paper, status))
    return [
        _movement(
            "Table 3: straight (1/a11 [kg], Cv [N m s], Cs [N m])",
            straight,
            ("1/a11", "Cv", "Cs"),
            TABLE_3,
            (
                "The logs are simulated with Table 5, so the means can agree with the paper's, single experiments cannot.",
            ),
        ),
        _movement(
            "Table 4: on the spot (1/a22 [kg m^2], Cv1 [N m s], Cs1 [N m])",
            spot,
            ("1/a22", "Cv1", "Cs1"),
            TABLE_4,
            coupled,
        ),
        PaperTable(
            "Table 5: physical parameters, from all six experiments together",
            ("symbol", "value", "std error", "unit", "paper", "status"),
            tuple(rows),
            (
                "The paper takes the single inertias from theory: equations 34 and 35 determine 1/a11 and 1/a22 alone.",
                "Ir and I0 are moved here until they give these; the others stand as the table has them.",
            ),
        ),
    ]


def omni_paper_tables() -> list[PaperTable]:
    """Conceicao et al.: Tables 1-6 from logs by the paper's three methods, then from the paper's own printed numbers."""
    at = folder("omni_paper")
    first = method_1(read_logs(at / "steady_*.csv", "omni"))
    second = method_2(read_logs(at / "coast_*.csv", "omni"), first)
    third = method_3(read_hanging(at / "hanging_*.csv"))
    logged = [first.table_1, first.table_2, second.table_3, third.table_4]
    summary = omni_tables.Summary(first, second, third)
    printed = [omni_tables.table_2, omni_tables.table_3, omni_tables.table_4, omni_tables.table_5, omni_tables.table_6]
    return [*logged, summary.table, *(table() for table in printed)]


PAPERS = {
    "Innocenti et al., Tables 3-5: the paper's methods on simulated experiments, next to what it prints": pioneer_tables,
    "Conceicao et al., Tables 1-6: the paper's methods on simulated experiments, then on its own printed numbers": (
        omni_paper_tables
    ),
}
"""The papers' tables by title."""
