"""The demonstration: both papers' robots from the logs that come with the package, whose truth is known.

The logs were written by an independent simulator (`jaxid/demo_logs/README.md`). Estimates start well away from the
truth, and the papers' tables are computed again by the papers' own methods.
"""

import tomllib
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

from .logs import LogSet, read_logs
from .papers.omni import tables as omni_tables
from .papers.omni.experiments import method_1, method_2
from .papers.omni.hanging import method_3, read_hanging
from .papers.paper_table import PaperTable
from .papers.pioneer.experiments import Identified, spot_experiments, straight_experiments
from .robots import BUILT_IN, Robot

ROBOTS = ("pioneer", "omni")
START_FACTOR = 1.5
"""Start values of the free parameters are this multiple of the truth."""

STRAIGHT = ("straight_1_prbs.csv", "straight_2_prbs.csv", "straight_3_step.csv")
SPOT = ("spot_1_step.csv", "spot_2_prbs.csv", "spot_3_prbs.csv")


def folder(name: str) -> Path:
    """Folder of the demonstration logs: "pioneer", "omni", "pioneer_paper", "omni_paper" or "unknown"."""
    return Path(str(files("jaxid"))) / "demo_logs" / name


def truth(name: str) -> dict[str, float]:
    """The constants behind a folder's logs, by symbol, SI units."""
    return tomllib.loads((folder(name) / "truth.toml").read_text(encoding="utf-8"))


class Case(NamedTuple):
    """One robot of the demonstration: start values, logs to fit and held out, and the truth by symbol."""

    robot: Robot
    fit: LogSet
    held_out: LogSet
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


def pioneer_tables() -> list[PaperTable]:
    """Tables 3-5 of Innocenti et al. by the paper's way: equations 34 and 35 on uncoupled experiments, three each."""
    known = truth("pioneer_paper")
    logs = read_logs([folder("pioneer_paper") / name for name in (*STRAIGHT, *SPOT)], "pioneer")
    straight = straight_experiments([logs[name] for name in STRAIGHT], truth=known)
    spot = spot_experiments([logs[name] for name in SPOT], straight.robot, truth=known)
    coupled = (
        "The simulated robot is the coupled one: turning on the spot, its centre of mass pulls it backwards",
        "and the caster moves, which equation 35 books as caster friction. Output error on the coupled model",
        "recovers Cv1 and Cs1 (first table of this demonstration).",
    )
    fourth = spot.table
    return [straight.table, replace(fourth, notes=(*fourth.notes, *coupled)), Identified(straight, spot).table]


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
