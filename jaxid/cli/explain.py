"""`jaxid explain`: read, look, fit, and say what the model lacks; files for programs and a page for people."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer

from ..estimate.result import Fit
from ..explanation.explain import apart, explain, without_windows
from ..explanation.level import FALSE_ALARM
from ..logs import LogSet
from ..logs.intersample import Intersample
from ..report import compare
from ..report.files import write_fit
from ..robots import Robot
from .arguments import UnusableInput, check_effects, load_effects, load_robot
from .cache import keep_compiled_programs
from .console import complain, say, show, step
from .fit import control_law, estimated, identifiable, read_case
from .folder import record, results_in

BASELINES = ("uncoupled",)
"""What `--baseline` can be."""


def check_baseline(baseline: str | None, robot: Robot) -> None:
    """One line and exit status 2 (`typer.Exit`) for a baseline that there is not, or not for this robot."""
    if baseline is None:
        return
    if baseline not in BASELINES:
        complain(f"There is no baseline {baseline!r}; use --baseline {' or '.join(BASELINES)}, or leave it out.")
        raise typer.Exit(2)
    if "coriolis_coupling" not in robot.mechanisms:
        complain(f"--baseline {baseline} is for the omni and not for {robot.name!r}; leave it out for this robot.")
        raise typer.Exit(2)


def without_coupling(robot: Robot) -> Robot:
    """The omni by its paper's equations, which lack the turning frame's own terms.

    Raises `UnusableInput` for a model that has them as an effect.
    """
    if "coriolis_coupling" in [effect.id for effect in robot.effects]:
        raise UnusableInput(
            "The model has the effect coriolis_coupling, which --baseline uncoupled leaves out; take one of the two away."
        )
    for name in robot.mechanisms["coriolis_coupling"]:
        robot = robot.change(name, value=0.0, free=False)
    return robot


def _write_fits(out: Path, fits: list[Fit], fit: LogSet, held_out: LogSet) -> None:
    with step("Prediction of held-out logs"):
        comparison = compare(*fits, held_out=held_out, fit=fit)
    write_fit(out, fits, comparison.predicted)


def run_explain(
    spec: str,
    fit: list[str],
    held_out: list[str],
    model: Path | None,
    baseline: str | None,
    mapping: Path | None,
    out: Path,
    options: Mapping[str, Any],
    intersample: Intersample = "hold",
    controller: str | None = None,
    false_alarm: float = FALSE_ALARM,
    overwrite: bool = False,
    own_effects: str | None = None,
) -> None:
    """Write fit.json, explanation.json, model.toml, report.html and pictures to `out` and print what was found."""
    keep_compiled_programs()
    check_baseline(baseline, load_robot(spec))
    effects = load_effects(own_effects)
    robot = identifiable(spec, model, fit, mapping, effects)
    if baseline is not None:
        robot = without_coupling(robot)
    check_effects(effects, robot)
    law = control_law(controller)
    with results_in(out, "explain", robot.name, overwrite):
        fit_logs, held_out_logs = read_case(robot, fit, held_out, mapping)
        if held_out_logs is not None:
            apart(fit_logs, held_out_logs)
        fits, fit_logs, held_out_logs = estimated(robot, fit_logs, held_out_logs, options, intersample, law)
        assert held_out_logs is not None  # --held-out is required
        fits[-1] = without_windows(fits[-1], fit_logs, say, **options)
        record(out, "explain", robot.name)  # before the first file, which alone would look like another command's
        _write_fits(out, fits, fit_logs, held_out_logs)
        record(out, "explain", robot.name)  # the search takes long: whoever stops it has edited no model.toml
        with step("Explanation") as report:
            found = explain(
                fits[-1], fit_logs, held_out_logs, effects=effects, false_alarm=false_alarm, report=report, **options
            )
        judged = found.final.judgement.sentence if found.final.judgement else ""
        for note in found.final.notes if found.effects else ():
            if note != judged:  # stands in the explanation, where there is one
                say(f"warning: {note}", style="yellow")
        show(repr(found))
        with step("Page and pictures"):
            written = found.save(out)
    say(f"{out}: fit.json, {', '.join(path.name for path in written if path.suffix != '.png')} and pictures")
