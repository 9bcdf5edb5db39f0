"""`jaxid fit`: read, look, estimate by every method asked for, predict held-out logs; files for programs, tables for people."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ..checks.in_words import doubtful_units
from ..estimate.linear.instrumental_variables import instrumental_variables
from ..estimate.linear.integral_least_squares import integral_least_squares
from ..estimate.output_error.output_error import output_error
from ..estimate.prediction_error.prediction_error import prediction_error
from ..estimate.result import Fit
from ..explanation.left.other_way import other_way
from ..logs import LogError, LogSet, noise_scale, read_logs
from ..logs.intersample import Intersample, between_samples
from ..model_file import read_model
from ..parameters import ParameterError
from ..report import Comparison, compare
from ..report.comparing import on_fitted
from ..report.files import write_fit
from ..report.tables import DOUBT, Cell, Table, title_of, to_text, value_cell, with_error
from ..robots import Effect, Robot, closed_loop
from ..robots.closed_loop import Controller, Law
from .arguments import UnusableInput, for_logs, load_controller, load_effects, load_robot
from .cache import keep_compiled_programs
from .console import say, show, step
from .findings import refuse_useless, warn_of_findings, warn_of_unused
from .folder import results_in

_SHOWN = 5
"""Stretches of outliers that are printed."""
UNCHECKED = "No logs were held out (--held-out), so nothing says how well these models predict."


def _say_outliers(fit: Fit) -> None:
    """Warn of the samples that the loss gave little weight, the longest stretches first."""
    if not fit.outliers:
        return
    total = sum(outlier.samples for outlier in fit.outliers)
    say(f"warning: {total} samples far from the simulation had little weight (all are in fit.json):", style="yellow")
    for o in sorted(fit.outliers, key=lambda o: -o.samples)[:_SHOWN]:
        say(
            f"  {o.log}, {o.channel}, {o.start:g} to {o.stop:g} s: {o.samples} samples, up to {o.deviations:+.3g} deviations"
        )


def _stretch(logs: LogSet, windows: float | str | None) -> int | None:
    """Samples in a stretch of integral least squares where `--windows` gives seconds; its own choice otherwise."""
    if not isinstance(windows, float):
        return None
    return max(2, 1 + round(windows / min(log.sampling_interval for log in logs)))


def _integral_least_squares(robot: Robot, logs: LogSet, start: Fit | None, options: Mapping[str, Any]) -> Fit | None:
    with step("Integral least squares"):
        try:
            return integral_least_squares(robot, logs, window=_stretch(logs, options.get("windows")))
        except (ParameterError, LogError) as error:
            say(f"warning: integral least squares is left out: {error}", style="yellow")
    return None


def _instrumental_variables(robot: Robot, logs: LogSet, start: Fit | None, options: Mapping[str, Any]) -> Fit | None:
    with step("Instrumental variables"):
        try:
            return instrumental_variables(robot, logs, start)
        except (ParameterError, LogError) as error:
            say(f"warning: instrumental variables are left out: {error}", style="yellow")
    return None


def _output_error(robot: Robot, logs: LogSet, start: Fit | None, options: Mapping[str, Any]) -> Fit:
    with step("Output error") as report:
        found = output_error(robot, logs, start=start, report=report, **options)
    for note in found.remarks:  # the judgement stands with the results
        say(f"warning: {note}", style="yellow")
    for name, offset in found.clock_offsets.items():
        say(f"{name}: the inputs' clock is {with_error(offset.value, offset.std_error)} s ahead of the outputs'")
    _say_outliers(found)
    return found


def _prediction_error(robot: Robot, logs: LogSet, start: Fit | None, options: Mapping[str, Any]) -> Fit:
    with step("Prediction error") as report:
        found = prediction_error(robot, logs, start=start, report=report)
    for note in found.remarks:
        say(note)
    return found


METHODS: dict[str, Callable[[Robot, LogSet, Fit | None, Mapping[str, Any]], Fit | None]] = {
    "integral_least_squares": _integral_least_squares,
    "instrumental_variables": _instrumental_variables,
    "output_error": _output_error,
    "prediction_error": _prediction_error,
}
"""The estimators by the name that stands on the command line and in fit.json, each started from the one before."""
USUAL = ("integral_least_squares", "output_error")


def estimate(
    robot: Robot, logs: LogSet, options: Mapping[str, Any] = MappingProxyType({}), methods: Sequence[str] = USUAL
) -> list[Fit]:
    """The estimates by `methods`, in their order; by default integral least squares where the robot is linear in its free
    parameters, then output error from there.

    `options` are those of `output_error`. Raises `ParameterError` if the simulation diverges at the start values.
    """
    fits: list[Fit] = []
    for method in methods:
        found = METHODS[method](robot, logs, fits[-1] if fits else None, options)
        fits += [found] if found is not None else []
    return fits


def control_law(controller: str | None, methods: Sequence[str] = USUAL) -> Controller | Law | None:
    """What `--controller` names. Raises `UnusableInput` for what is none, or where the last of `methods` simulates none."""
    law = None if controller is None else load_controller(controller)
    if law is not None and methods[-1] != "output_error":
        raise UnusableInput(
            "a controller is simulated by output error alone, and prediction error needs none: it starts every prediction "
            "from what was measured; leave out --controller, or put output_error last in --method."
        )
    return law


def estimated(
    robot: Robot,
    logs: LogSet,
    held_out: LogSet | None,
    options: Mapping[str, Any],
    intersample: Intersample = "hold",
    law: Controller | Law | None = None,
    methods: Sequence[str] = USUAL,
) -> tuple[list[Fit], LogSet, LogSet | None]:
    """The estimates by `methods` as the command line asks for them, and the logs that they are of: with their inputs as
    between samples, and, with a controller, as logs of the closed loop, in which the linear estimate is judged, too.

    Raises `UnusableInput` where no method gives an estimate.
    """
    logs = between_samples(logs, intersample)
    held_out = None if held_out is None else between_samples(held_out, intersample)
    fits = estimate(robot, logs, options if law is None else {**options, "controller": law}, methods)
    if not doubtful_units(logs) and (units := doubtful_units(held_out)):  # the fits say it of their own logs
        fits = [replace(fit, notes=(*fit.notes, units)) for fit in fits]
    if not fits:
        raise UnusableInput(f"{', '.join(methods)} gives no estimate here; add --method output_error.")
    if law is not None:
        logs = closed_loop(robot, logs, law)[1]
        held_out = None if held_out is None else closed_loop(robot, held_out, law)[1]
        fits = [_looped(fit, fits[-1]) for fit in fits]
    return fits, logs, held_out


def _estimates_table(fits: Sequence[Fit]) -> Table:
    """Estimated parameters and combinations of every method, without held-out logs."""
    rows = []
    named = dict.fromkeys(name for fit in fits for name in (*fit.free_names, *fit.combinations))
    for name in named:
        cells = [Cell(name), Cell(fits[-1][name].unit, "dim")]
        for fit in fits:
            cells.append(value_cell(fit[name], not fit.trustworthy))
        rows.append(tuple(cells))
    header = ("parameter", "unit", *(title_of(fit.method) for fit in fits))
    doubt = [] if all(fit.trustworthy for fit in fits) else [DOUBT]
    said = {fit.judgement.sentence for fit in fits if fit.judgement}  # stands above the table
    notes = [f"{title_of(fit.method)}: {note}" for fit in fits for note in fit.notes if note not in said]
    notes += [f"{title_of(fit.method)}: {fit.reason}." for fit in fits if not (fit.converged or fit.failed)]
    return Table("Parameters", header, tuple(rows), ("± is one standard error.", *doubt, *notes, UNCHECKED))


def write_results(
    out: Path, fits: Sequence[Fit], held_out: LogSet | None, fitted: LogSet, truth: Mapping[str, float] | None = None
) -> Comparison | None:
    """Everything a fit leaves in its folder, and its tables on stdout. Raises `OSError` if the folder cannot be written."""
    from ..report.comparison_page import comparison_page, fits_page  # and matplotlib with them, once there are results
    from ..report.document import write_page

    if held_out is None:
        table = _estimates_table(fits)
        said = [f"{title_of(fit.method)}: {fit.judgement.sentence}" for fit in fits if fit.judgement]
        comparison, text = None, to_text([table], said)
        write_fit(out, fits)
        with step("Simulation of the fitted logs"):
            noise = noise_scale(fitted)
            seen = on_fitted({fit.method: fit for fit in fits}, fitted, noise)
        page = fits_page(fits, fitted, seen, noise)
    else:
        with step("Prediction of held-out logs"):
            comparison = compare(*fits, held_out=held_out, fit=fitted, truth=truth)
        text = repr(comparison)
        write_fit(out, fits, comparison.predicted, comparison.ahead)
        with step("Pictures"):
            comparison.save_pictures(out)
        page = comparison_page(comparison, "fit")
    write_page(out / "report.html", page)
    show(text)
    return comparison


def identifiable(
    spec: str,
    model: Path | None,
    logs: Sequence[str] = (),
    mapping: Path | None = None,
    effects: Sequence[Effect] = (),
) -> Robot:
    """The robot of the command line, as the `logs` measure it, with its model file, which may name the user's own `effects`.
    Raises `ParameterError` if nothing is free."""
    robot = for_logs(load_robot(spec), logs, mapping)
    if model is not None:
        robot = read_model(model, robot, effects)
    if not robot.parameters.free_names:
        raise ParameterError(
            "no parameter is free; write free = true for at least one in a model file and give --model."
        )
    return robot


def read_case(robot: Robot, fit: list[str], held_out: list[str], mapping: Path | None) -> tuple[LogSet, LogSet | None]:
    """Logs to fit and held-out ones, looked over. Raises `UnusableInput` if no log can be fitted."""
    fit_logs = read_logs(fit, robot, mapping=mapping)
    held_out_logs = read_logs(held_out, robot, mapping=mapping) if held_out else None
    refuse_useless(fit_logs)
    say(f"{len(fit_logs)} logs to fit, {len(held_out_logs or ())} held out")
    warn_of_findings(fit_logs, held_out_logs)
    warn_of_unused(robot, fit_logs, held_out_logs)
    return fit_logs, held_out_logs


def _looped(fit: Fit, loop: Fit) -> Fit:
    """`fit` of a plant in the closed loop that `loop` was fitted in."""
    if fit.robot.controlled or not loop.robot.controlled:
        return fit
    return replace(
        fit, robot=loop.robot.with_values(**{n: fit.robot.parameters[n].value for n in fit.robot.parameters})
    )


def run_fit(
    spec: str,
    fit: list[str],
    held_out: list[str],
    model: Path | None,
    mapping: Path | None,
    out: Path,
    options: Mapping[str, Any],
    intersample: Intersample = "hold",
    controller: str | None = None,
    methods: Sequence[str] = USUAL,
    overwrite: bool = False,
    own_effects: str | None = None,
) -> None:
    """Write fit.json, model.toml, report.html and pictures to `out` and print the estimates."""
    keep_compiled_programs()
    robot = identifiable(spec, model, fit, mapping, load_effects(own_effects))
    law = control_law(controller, methods)
    with results_in(out, "fit", robot.name, overwrite):
        fit_logs, held_out_logs = read_case(robot, fit, held_out, mapping)
        fits, fit_logs, held_out_logs = estimated(robot, fit_logs, held_out_logs, options, intersample, law, methods)
        # An explanation asks by itself.
        if law is None and (columns := other_way(fits[-1], fit_logs, held_out_logs, robot)):
            say(f"warning: {columns}", style="yellow")
            fits[-1] = replace(fits[-1], notes=(*fits[-1].notes, columns))
        write_results(out, fits, held_out_logs, fit_logs)
    say(f"{out}: fit.json, model.toml, report.html" + (" and pictures" if held_out_logs is not None else ""))
