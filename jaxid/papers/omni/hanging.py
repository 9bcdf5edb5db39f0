"""Method 3's own logs: the hanging robot's angle while a mass falls (Conceição et al. 2006, section 3.3).

CSV or Parquet with columns `t` [s], `theta` [rad] and `mass` [kg]; the mass may instead stand in a comment line of the
file, such as `# mass = 0.510`.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...estimate.result import Estimate
from ...logs import Channels, Log, LogError, LogSet, read_logs
from ...logs.files import PathLike, files_of
from ...logs.read import _numbers
from ...logs.table import read_table
from ..mean import mean_of
from ..paper_table import PaperTable
from .methods import Inertia, hanging_inertia
from .printed import TABLE_4, TABLE_6

HANGING = Channels(inputs=("mass",), outputs=("theta",), units={"mass": "kg", "theta": "rad"})
"""Columns of a hanging-robot log."""
_MASS = re.compile(r"^\s*(?:#|%|//).*\bmass\b\s*(?:\[?kg\]?)?\s*[=:]\s*([^\s,;]+)", re.MULTILINE)


def _mass_in_comment(path: Path, columns: list[str]) -> float:
    match = _MASS.search(path.read_text(encoding="utf-8", errors="replace"))
    if match is None:
        raise LogError(
            f"{path} has neither a column 'mass' (it has {columns}) nor a comment line such as '# mass = 0.510'; say "
            "how many kg were hanging."
        )
    try:
        return float(match.group(1))
    except ValueError:
        raise LogError(f"{path}: the comment gives mass = {match.group(1)!r}, which is no number; give kg.") from None


def _read(path: Path) -> Log:
    table = read_table(path)
    columns = [str(name) for name in table.frame.columns]
    if "mass" in columns or not {"t", "theta"} <= set(columns):
        return read_logs(path, HANGING)[0]  # which also has the words for missing columns
    mass = np.full(len(table.frame), _mass_in_comment(path, columns))
    time, theta = (_numbers(table, name, path) for name in ("t", "theta"))
    return Log.from_arrays(path.name, time, {"mass": mass}, {"theta": theta}, HANGING, source=str(path))


def _mass(log: Log) -> float:
    mass = log.input("mass")
    changed = np.flatnonzero(mass != mass[0])
    if len(changed):
        raise LogError(
            f"{log.name}: column 'mass' changes at sample {changed[0]} ({mass[0]:g} kg, then {mass[changed[0]]:g} kg); "
            "give each experiment its own log."
        )
    if not mass[0] > 0:
        raise LogError(f"{log.name}: column 'mass' is {mass[0]:g} kg; give the hanging mass, above zero.")
    return float(mass[0])


def read_hanging(paths: PathLike | Iterable[PathLike]) -> LogSet:
    """Read hanging-robot logs: a file, a pattern, or a list of them.

    Raises `LogError`, one sentence with file, column, sample and remedy, for whatever cannot be used.
    """
    return LogSet(_read(path) for path in files_of(paths))


@dataclass(frozen=True, repr=False)
class Hanging:
    """Method 3 on logs: J of each experiment, by log name, and their mean."""

    experiments: dict[str, Inertia]
    mean: Estimate
    without_mass: Estimate

    @property
    def table_4(self) -> PaperTable:
        """Torque, angular acceleration and J of each experiment next to the paper's Table 4 (by position)."""
        rows = []
        for number, (name, found) in enumerate(self.experiments.items()):
            paper = TABLE_4[number] if number < len(TABLE_4) else (None, None, None)
            a = found.acceleration
            alpha, error = (a.value, a.std_error) if a else (None, None)
            rows.append(
                (name, found.torque, paper[0], alpha, error, paper[1], found.J.value, found.J.std_error, paper[2])
            )
        paper_mean = TABLE_6["Method 3 (mean)"]
        rows.append(("mean", None, None, None, None, None, self.mean.value, self.mean.std_error, paper_mean))
        columns = (
            "log",
            "torque [N m]",
            "paper",
            "dW/dt [rad/s^2]",
            "std error",
            "paper ",
            "J [kg m^2]",
            "std error ",
            "paper  ",
        )
        without = f"{self.without_mass.value:.4g} kg m^2"
        note = f"With the falling mass's own inertia taken off (the paper leaves it in): {without}."
        return PaperTable("J by method 3 (Table 4)", columns, tuple(rows), (note,))

    def __repr__(self) -> str:
        return repr(self.table_4)

    def _repr_html_(self) -> str:
        return self.table_4._repr_html_()


def method_3(logs: Iterable[Log], *, differentiate: bool = False) -> Hanging:
    """Method 3 (section 3.3) on logs of `read_hanging`; `differentiate=True` for the paper's Euler differences.

    Each log must hold the free fall alone (`log.window(start, stop)` cuts). Raises `LogError` for a mass that changes
    or is not above zero, and for too few samples.
    """
    experiments = {}
    for log in logs:
        if log.channels != HANGING:
            raise LogError(f"{log.name} is no hanging-robot log; read it with read_hanging.")
        theta = log.output("theta")
        there = np.isfinite(theta)
        try:
            found = hanging_inertia(log.time[there], theta[there], _mass(log), differentiate=differentiate)
        except LogError:
            raise
        except ValueError as error:
            raise LogError(f"{log.name}: {error}") from None
        experiments[log.name] = found
    if not experiments:
        raise LogError("Method 3 was given no logs; give at least one.")
    without = [found.without_mass for found in experiments.values() if found.without_mass is not None]
    return Hanging(experiments, mean_of([found.J for found in experiments.values()]), mean_of(without))
