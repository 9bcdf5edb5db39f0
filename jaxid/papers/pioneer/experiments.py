"""Tables 3-5 of the Pioneer paper from logs, next to what it prints, and the check of its model on another log.

B. Innocenti, P. Ridao, N. Gascons, A. El-Fakdi, B. Lopez, J. Salvi, "Dynamical model parameters identification of a
wheeled mobile robot", section 4. Three experiments for each movement are fitted one by one by integral least squares
(equations 34 and 35) and averaged.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from ...estimate.confidence.agreement import Agreement, agreement
from ...estimate.result import Estimate, Fit
from ...logs import Log, LogSet, noise_level
from ...report.tables import with_error
from ...robots.pioneer import Pioneer
from ...robots.pioneer_closed_form import turning_coefficients
from ...simulation.simulate import simulate
from ..mean import mean_of
from ..paper_table import Cell, PaperTable
from .printed import RESIDUAL, TABLE_3, TABLE_4, TABLE_5
from .uncoupled import uncoupled_least_squares


def _input_kind(log: Log) -> str:
    """STEP or PRBS, from the log's name."""
    return next((kind for kind in ("PRBS", "STEP") if kind.lower() in log.name.lower()), "-")


def _numbers_of(robot: Pioneer, truth: Mapping[str, float]) -> dict[str, float]:
    """The truth by symbol, combinations included, as far as the robot has them."""
    p = {**robot.parameters.numbers, **truth}
    return p | {label: float(function(p)) for label, (function, _, _) in robot.combinations.items()}


@dataclass(frozen=True, repr=False)
class Movement:
    """One movement's experiments, fitted one by one, and their mean: the paper's Table 3 or 4.

    - `title`; `printed`: TABLE_3 or TABLE_4.
    - `fits`: by log name, in the order given; `kinds`: their inputs, "STEP" or "PRBS".
    - `truth`: what the logs were simulated with, by symbol, where it is known.
    - `note`: a sentence below the table.
    """

    title: str
    printed: Mapping[str, tuple[float, ...]]
    fits: dict[str, Fit]
    kinds: tuple[str, ...]
    truth: Mapping[str, float]
    note: str = "± is one standard error."

    @property
    def mean(self) -> dict[str, Estimate]:
        """The plain mean over the experiments by symbol, with the standard error of independent estimates."""
        return {name: mean_of([fit[name] for fit in self.fits.values()]) for name in self.printed}

    @property
    def robot(self) -> Pioneer:
        """The robot with the mean of every free parameter over the experiments."""
        first = next(iter(self.fits.values()))
        assert isinstance(first.robot, Pioneer)
        own = [fit.robot.parameters.numbers for fit in self.fits.values()]
        return first.robot.with_values(**{n: float(np.mean([p[n] for p in own])) for n in first.free_names})

    @property
    def table(self) -> PaperTable:
        """The paper's layout: one row for each experiment, then the mean, each number next to the printed one."""
        rows: list[tuple[Cell, ...]] = []
        numbered = zip(map(str, range(1, 1 + len(self.fits))), self.kinds, self.fits.values(), strict=True)
        for number, kind, found in [*numbered, ("Mean", "", self.mean)]:
            row: list[Cell] = [number, kind]
            for symbol, printed in self.printed.items():
                # The paper has three experiments; a fourth stands without a printed number.
                place = -1 if number == "Mean" else int(number) - 1
                paper = printed[place] if place < len(printed) - 1 else None
                row += [with_error(found[symbol].value, found[symbol].std_error), paper]
            rows.append(tuple(row))
        if self.truth:
            numbers = _numbers_of(self.robot, self.truth)
            rows.append(("Truth", "", *(c for symbol in self.printed for c in (f"{numbers[symbol]:.4g}", None))))
        mean = self.mean
        columns = [(f"{symbol} [{mean[symbol].unit}]", f"{symbol} (paper)") for symbol in self.printed]
        header = ("Exp.", "Input", *(name for two in columns for name in two))
        return PaperTable(self.title, header, tuple(rows), (self.note,))

    def __repr__(self) -> str:
        return repr(self.table)

    def _repr_html_(self) -> str:
        return self.table._repr_html_()


def _one_by_one(robot: Pioneer, logs: Iterable[Log], window: int | None) -> tuple[dict[str, Fit], tuple[str, ...]]:
    logs = LogSet(logs)
    fits = {log.name: uncoupled_least_squares(robot, [log], window=window) for log in logs}
    return fits, tuple(_input_kind(log) for log in logs)


def straight_experiments(
    logs: Iterable[Log],
    robot: Pioneer | None = None,
    *,
    truth: Mapping[str, float] | None = None,
    window: int | None = None,
) -> Movement:
    """Table 3: 1/a11 [kg], Cv [N m s] and Cs [N m] by equation 34 from each log that drives straight.

    `robot` gives what counts as known (R, the motors; the paper's by default). `window` is that of
    `uncoupled_least_squares`; 2 is equation 31 as printed. Raises `LogError` for logs that do not drive straight.
    """
    fits, kinds = _one_by_one(robot or Pioneer(), logs, window)
    return Movement("Table 3. Translational movement", TABLE_3, fits, kinds, truth or {})


def scatter(ways: Mapping[str, Movement]) -> PaperTable:
    """How far the single experiments lie apart, by several ways of fitting them and in the paper.

    Scatter is the standard deviation of the experiments over their mean; beside it the ratio of each experiment's
    standard errors to those of the first way, smallest and largest.
    """
    first, *others = ways
    rows: list[tuple[Cell, ...]] = []
    for symbol, printed in ways[first].printed.items():
        fits = {name: [fit[symbol] for fit in movement.fits.values()] for name, movement in ways.items()}
        columns = [[e.value for e in fits[name]] for name in ways] + [list(printed[:-1])]
        row: list[Cell] = [symbol, *(f"{100 * np.std(c, ddof=1) / np.mean(c):.2g} %" for c in columns)]
        for name in others:
            ratio = [e.std_error / own.std_error for e, own in zip(fits[name], fits[first], strict=True)]
            row.append(f"{min(ratio):.1f} to {max(ratio):.1f}")
        rows.append(tuple(row))
    header = ("Symbol", *(f"scatter, {name}" for name in ways), "scatter, paper")
    return PaperTable(
        "Experiments against each other", (*header, *(f"std errors, {name} / {first}" for name in others)), tuple(rows)
    )


def spot_experiments(
    logs: Iterable[Log],
    robot: Pioneer | None = None,
    *,
    truth: Mapping[str, float] | None = None,
    window: int | None = None,
) -> Movement:
    """Table 4: 1/a22 [kg m^2], Cv1 [N m s] and Cs1 [N m] by equation 35 from each log that turns on the spot.

    `robot` gives what counts as known: besides lengths and motors the wheels' Cv and Cs, so pass Table 3's `robot`. The
    caster's frictions are not bounded below here, as the paper's least squares is not: the mean of estimates cut off at
    zero would be wrong. Raises `LogError` for logs that do not turn on the spot.
    """
    robot = robot or Pioneer()
    for name in ("Cv1", "Cs1"):
        robot = robot.change(name, lower=-math.inf)
    fits, kinds = _one_by_one(robot, logs, window)
    note = "± is one standard error, with Cv and Cs taken as known."
    return Movement("Table 4. Rotational movement", TABLE_4, fits, kinds, truth or {}, note)


@dataclass(frozen=True, repr=False)
class Identified:
    """Both movements together: the paper's Table 5."""

    straight: Movement
    spot: Movement

    @property
    def robot(self) -> Pioneer:
        """The coupled model with the means; Ir and I0 match 1/a11 and 1/a22, negative caster friction becomes zero."""
        turning = self.spot.robot.parameters
        frictions = {name: max(turning[name].value, 0.0) for name in ("Cv1", "Cs1")}
        robot = self.straight.robot.with_values(**frictions)
        function, _, _ = robot.combinations["1/a22"]
        left = self.spot.mean["1/a22"].value - float(function(robot.parameters.numbers))
        return robot.with_values(I0=max(robot.parameters["I0"].value + left, 0.0))

    @property
    def table(self) -> PaperTable:
        """Table 5 with where each number comes from."""
        robot, truth = self.robot, {**self.straight.truth, **self.spot.truth}
        means = {**self.straight.mean, **self.spot.mean}
        rows: list[tuple[Cell, ...]] = []
        for name, printed in TABLE_5.items():
            p = robot.parameters[name]
            if name in means:
                value = with_error(means[name].value, means[name].std_error)
                origin = "mean of Table 3" if name in self.straight.mean else "mean of Table 4"
            elif name in ("Ir", "I0"):
                value, origin = f"{p.value:.4g}", f"what {'1/a11' if name == 'Ir' else '1/a22'} leaves for it"
            else:
                value, origin = f"{p.value:.4g}", "taken as known"
            rows.append((name, value, printed, *([truth.get(name)] if truth else []), p.unit, origin))
        header = ("Symbol", "Value", "Paper", *(["Truth"] if truth else []), "Unit", "From")
        return PaperTable("Table 5. Estimated parameters", header, tuple(rows))

    def __repr__(self) -> str:
        return repr(self.table)

    def _repr_html_(self) -> str:
        return self.table._repr_html_()


@dataclass(frozen=True, repr=False)
class Check:
    """A model on a log that it was not fitted to, for figures 3 and 4. `noise` is each channel's, from that log."""

    log: Log
    found: Agreement
    noise: dict[str, float]

    @property
    def table(self) -> PaperTable:
        """Mean and standard deviation of eta1's residual (simulated minus measured) next to the paper's."""
        rows = tuple(
            (f"{what} [m/s]", value, RESIDUAL[what])
            for what, value in (("mean", self.found.mean["eta1"]), ("standard deviation", self.found.std["eta1"]))
        )
        note = f"The speed sensor's own noise in this log: {self.noise['eta1']:.4f} m/s."
        return PaperTable(f"Residual of eta1, {self.log.name}", ("", "Value", "Paper"), rows, (note,))

    def __repr__(self) -> str:
        return repr(self.table)

    def _repr_html_(self) -> str:
        return self.table._repr_html_()


def check_model(robot: Pioneer, log: Log) -> Check:
    """Simulate `log` from its inputs alone and judge the residual."""
    logs = LogSet([log])
    noise = noise_level(logs)
    return Check(log, agreement(logs, simulate(robot, logs), noise), noise)


def with_caster_across(log: Log, robot: Pioneer | None = None) -> Log:
    """The same log with its caster starting at the angle that stays put while the robot turns left about its axle.

    There d + l1 cos(beta) = 0: -99.6 degrees for the published lengths. A log that says nothing starts with the caster
    trailing.
    """
    p = (robot or Pioneer()).parameters
    beta = np.full(len(log), -math.acos(-p["d"].value / p["l1"].value))
    return replace(log, extra=log.extra.assign(beta=beta) if len(log.extra.columns) else pd.DataFrame({"beta": beta}))


def turning_resistance(robot: Pioneer | None = None) -> PaperTable:
    """What resists a turn on the spot by equation 35: the caster's share of a26 and a29."""
    p = (robot or Pioneer()).parameters.numbers
    a = turning_coefficients(p)
    viscous, coulomb = a.a26 / a.a22, a.a29 / a.a22
    rows = (
        ("viscous, a26/a22 [N m s]", viscous, viscous - p["Cv1"], p["Cv1"], f"{100 * p['Cv1'] / viscous:.2f} %"),
        ("dry, a29/a22 [N m]", coulomb, coulomb - p["Cs1"], p["Cs1"], f"{100 * p['Cs1'] / coulomb:.2f} %"),
    )
    header = ("Resistance to a turn on the spot", "all", "driving wheels", "caster", "caster's share")
    lever = 2 * p["L"] / p["R"]  # of Cs on the turn
    apart = {name: np.ptp(table[name][:-1]) for table, name in ((TABLE_3, "Cs"), (TABLE_4, "Cs1"))}
    notes = (
        f"An error of 1 % in Cs moves Cs1 by {0.01 * lever * p['Cs'] / p['Cs1']:.1f} times its value.",
        f"The paper's experiments differ by {apart['Cs']:.2g} N m in Cs, and by {apart['Cs1']:.1g} N m in Cs1: "
        f"{1e6 * apart['Cs1'] / coulomb:.1f} parts in a million of all dry resistance.",
    )
    return PaperTable("Equation 35 with the published numbers", header, rows, notes)


def side_by_side(fits: Mapping[str, Fit], truth: Mapping[str, float]) -> PaperTable:
    """What Tables 3 and 4 list, as several `fits` of the Pioneer have it, next to the paper's means and the truth."""
    numbers = _numbers_of(Pioneer(), truth)
    rows: list[tuple[Cell, ...]] = []
    for symbol, printed in {**TABLE_3, **TABLE_4}.items():
        row: list[Cell] = [
            f"{symbol} [{next(iter(fits.values()))[symbol].unit}]",
            f"{numbers[symbol]:.4g}",
            printed[-1],
        ]
        for fit in fits.values():
            found = fit[symbol]
            bound = " (bound)" if found.status == "at_bound" else ""
            row.append(with_error(found.value, math.nan if bound else found.std_error) + bound)
        rows.append(tuple(row))
    return PaperTable("The same experiments", ("Symbol", "Truth", "Paper", *fits), tuple(rows))
