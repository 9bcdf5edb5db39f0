"""The commands and their arguments. Each command's work is in a file of its own, imported when it runs.

Exit status: 0 with a result, 1 for input that cannot be used (one line on stderr), 2 for wrong arguments.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from .arguments import check_loop, check_named, print_version, repeat_flags, window_option
from .collection import collect_seldom
from .errors import one_line_errors
from .options import (
    MANY,
    BetweenSamples,
    Candidates,
    ClockOffset,
    ControlLaw,
    Covariance,
    Loss,
    Mapping,
    Method,
    Model,
    Overwrite,
    OwnEffects,
    RobotArgument,
    Windows,
)

app = typer.Typer(
    name="jaxid",
    help="From a wheeled robot's logs to a model its owner can trust.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    rich_markup_mode="markdown",  # units in brackets stay
    pretty_exceptions_enable=False,
)


@app.callback()
def _jaxid(
    _version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=print_version, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


@app.command()
@one_line_errors
def fit(
    robot: RobotArgument,
    fit: Annotated[list[str], typer.Option("--fit", metavar="LOG...", help="Logs to identify from; patterns work.")],
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for fit.json, model.toml and pictures.")],
    held_out: Annotated[
        list[str] | None,
        typer.Option(
            "--held-out", "--check", metavar="LOG...", help="Logs that are not fitted, on which predictions are judged."
        ),
    ] = None,
    model: Model = None,
    mapping: Mapping = None,
    method: Annotated[
        list[Method] | None,
        typer.Option(
            "--method",
            metavar="METHOD...",
            help="Estimators, each started from the one before (integral_least_squares output_error by default): "
            "integral_least_squares, instrumental_variables, output_error, prediction_error (the motion is disturbed, too).",
        ),
    ] = None,
    loss: Loss = "squares",
    covariance: Covariance = "auto",
    clock_offset: ClockOffset = False,
    windows: Windows = "auto",
    controller: ControlLaw = None,
    intersample: BetweenSamples = "hold",
    own_effects: OwnEffects = None,
    overwrite: Overwrite = False,
) -> None:
    """Identify a robot's parameters from its logs, by integral least squares and by output error, or as --method says."""
    from .fit import USUAL, run_fit

    check_named(own_effects, model)
    options = {"loss": loss, "covariance": covariance, "clock_offset": clock_offset, "windows": window_option(windows)}
    check_loop(controller, intersample)
    methods = tuple(dict.fromkeys(map(str, method or USUAL)))
    run_fit(
        robot,
        fit,
        held_out or [],
        model,
        mapping,
        out,
        options,
        intersample,
        controller,
        methods,
        overwrite,
        own_effects,
    )


@app.command()
@one_line_errors
def explain(
    robot: RobotArgument,
    fit: Annotated[list[str], typer.Option("--fit", metavar="LOG...", help="Logs to identify from; patterns work.")],
    held_out: Annotated[
        list[str],
        typer.Option(
            "--held-out",
            "--check",
            metavar="LOG...",
            help="Logs that are not fitted, on which explanations are judged.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="DIR", help="Folder for explanation.json, model.toml, report.html, pictures."),
    ],
    model: Model = None,
    baseline: Annotated[
        str | None,
        typer.Option("--baseline", metavar="uncoupled", help="Start the omni from the paper's equations."),
    ] = None,
    false_alarm: Annotated[
        float,
        typer.Option(
            "--false-alarm",
            metavar="SHARE",
            min=1e-6,
            max=0.49,
            help="How often a complete model may be called incomplete, such as 0.01 of the time.",
        ),
    ] = 0.01,
    mapping: Mapping = None,
    loss: Loss = "squares",
    covariance: Covariance = "auto",
    windows: Windows = "auto",
    controller: ControlLaw = None,
    intersample: BetweenSamples = "hold",
    own_effects: Candidates = None,
    overwrite: Overwrite = False,
) -> None:
    """Find where simulation and logs disagree, name the missing effect, add it, and show the gap shrink."""
    from .explain import run_explain

    options = {"loss": loss, "covariance": covariance, "windows": window_option(windows)}
    check_loop(controller, intersample)
    run_explain(
        robot, fit, held_out, model, baseline, mapping, out, options, intersample, controller, false_alarm, overwrite,
        own_effects,
    )  # fmt: skip


@app.command()
@one_line_errors
def change(
    robot: RobotArgument,
    before: Annotated[
        list[str], typer.Option("--before", metavar="LOG...", help="Logs of the first set; patterns work.")
    ],
    after: Annotated[
        list[str], typer.Option("--after", metavar="LOG...", help="Logs of the second set, of the same robot.")
    ],
    held_out_before: Annotated[
        list[str] | None,
        typer.Option(
            "--held-out-before", metavar="LOG...", help="Logs of the first set on which the answer is judged."
        ),
    ] = None,
    held_out_after: Annotated[
        list[str] | None,
        typer.Option(
            "--held-out-after", metavar="LOG...", help="Logs of the second set on which the answer is judged."
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Folder for change.json and report.html.")
    ] = None,
    model: Model = None,
    false_alarm: Annotated[
        float,
        typer.Option(
            "--false-alarm",
            metavar="SHARE",
            min=1e-6,
            max=0.49,
            help="How often two sets between which nothing changed may be said to differ.",
        ),
    ] = 0.01,
    mapping: Mapping = None,
    loss: Loss = "squares",
    covariance: Covariance = "auto",
    windows: Windows = "auto",
    intersample: BetweenSamples = "hold",
    own_effects: OwnEffects = None,
    overwrite: Overwrite = False,
) -> None:
    """Say what changed between two sets of logs of one robot: its battery, load, floor, a wheel, a gear, or nothing."""
    from .change import run_change

    check_named(own_effects, model)
    options = {"loss": loss, "covariance": covariance, "windows": window_option(windows)}
    run_change(
        robot, before, after, held_out_before or [], held_out_after or [], model, mapping, out, options, intersample,
        false_alarm, own_effects, overwrite,
    )  # fmt: skip


@app.command()
@one_line_errors
def fleet(
    robot: RobotArgument,
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="A folder of logs for every robot, or one log for each.")
    ],
    out: Annotated[
        Path,
        typer.Option("--out", metavar="DIR", help="Folder for the tables, report.html, and parts to go on from."),
    ],
    explain: Annotated[
        bool, typer.Option("--explain", help="Find what every robot lacks, too, on the logs that are held out.")
    ] = False,
    held_out: Annotated[
        list[str] | None,
        typer.Option(
            "--held-out",
            "--check",
            metavar="PATTERN...",
            help="With --explain: names of the logs in each robot's folder that are not fitted, such as 'check_*'.",
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Share the robots out to so many processes, by Dask.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", metavar="ADDRESS", help="Or to the workers of a Dask scheduler: tcp://host:8786."),
    ] = None,
    model: Model = None,
    mapping: Mapping = None,
    loss: Loss = "squares",
    covariance: Covariance = "auto",
    clock_offset: ClockOffset = False,
    windows: Windows = "auto",
    overwrite: Overwrite = False,
) -> None:
    """Fit many robots, each on its own logs, by output error, and find what each lacks. A run that was stopped goes on."""
    from .fleet import run_fleet

    if explain != bool(held_out):
        raise typer.BadParameter(
            "--explain needs --held-out, the names of logs that are not fitted, and --held-out it."
        )
    if workers and scheduler:
        raise typer.BadParameter(
            "--workers are processes of this machine, --scheduler has its own; give one of the two."
        )
    options = {"loss": loss, "covariance": covariance, "clock_offset": clock_offset, "windows": window_option(windows)}
    run_fleet(robot, folder, model, mapping, out, options, held_out or (), workers, scheduler, overwrite)


@app.command()
@one_line_errors
def serve(
    robot: RobotArgument,
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="The folder to follow; made if it is missing.")],
    held_out: Annotated[
        list[str] | None,
        typer.Option(
            "--held-out",
            "--check",
            metavar="PATTERN...",
            help="Names of the logs that are not fitted, on which the model is judged ('check_*' by default).",
        ),
    ] = None,
    model: Model = None,
    mapping: Mapping = None,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port of the page; 0: any that is free.")
    ] = 8765,
) -> None:
    """Follow a folder of logs on a page in the browser: findings, fit, gap and the missing effect as they are found."""
    from .serve import run_serve

    run_serve(robot, folder, held_out or ["check_*"], model, mapping, port)


@app.command()
@one_line_errors
def look(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A log: bag, data log, MATLAB file, CSV, Parquet.")],
    robot: Annotated[
        str | None, typer.Option("--robot", metavar="ROBOT", help="Propose which field is which of its channels.")
    ] = None,
    write: Annotated[
        Path | None, typer.Option("--write", metavar="MAPPING.toml", help="Write the proposal there, to be edited.")
    ] = None,
    mapping: Mapping = None,
    overwrite: Overwrite = False,
) -> None:
    """Look at a file: its topics, rates, gaps, delays and fields, what is odd, and what could be what for a robot."""
    from .look import run_look

    run_look(file, robot, mapping, write, overwrite)


@app.command()
@one_line_errors
def simulate(
    robot: RobotArgument,
    log: Annotated[str, typer.Option("--log", metavar="LOG", help="Log whose inputs drive the model.")],
    model: Annotated[Path, typer.Option("--model", metavar="MODEL.toml", help="The model, as `jaxid fit` writes it.")],
    out: Annotated[Path, typer.Option("--out", metavar="PREDICTED.csv", help="File for the predicted outputs.")],
    mapping: Mapping = None,
    own_effects: OwnEffects = None,
) -> None:
    """Simulate a log's inputs with a model and write the predicted outputs."""
    from .simulate import run_simulate

    run_simulate(robot, log, model, mapping, out, own_effects)


@app.command()
@one_line_errors
def design(
    robot: RobotArgument,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for experiment.csv, design.json, report.html.")
    ],
    limit: Annotated[
        list[float],
        typer.Option("--limit", metavar="LIMIT...", help="Largest absolute input, one for all or one each."),
    ],
    noise: Annotated[
        list[str] | None,
        typer.Option("--noise", metavar="CHANNEL=SIGMA...", help="Noise by output, such as eta1=0.01."),
    ] = None,
    already: Annotated[
        list[str] | None, typer.Option("--already", metavar="LOG...", help="Logs recorded so far, to add to.")
    ] = None,
    speed: Annotated[
        list[str] | None, typer.Option("--speed", metavar="CHANNEL=LIMIT...", help="Largest outputs, such as eta1=1.")
    ] = None,
    floor: Annotated[
        list[float] | None, typer.Option("--floor", metavar="X Y", help="Extents of the floor to stay on [m].")
    ] = None,
    radius: Annotated[float | None, typer.Option("--radius", help="Largest distance from the start [m].")] = None,
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds", help="Length of an experiment [s]; as the logs in --already, else 100 time constants."
        ),
    ] = None,
    interval: Annotated[
        float | None,
        typer.Option(
            "--interval", help="Sampling interval [s]; as the logs in --already, else a tenth of a time constant."
        ),
    ] = None,
    experiments: Annotated[int, typer.Option("--experiments", help="How many experiments to design.")] = 1,
    doubt: Annotated[
        float,
        typer.Option("--doubt", help="How far the parameters may be off, as a share; limits hold for those, too."),
    ] = 0.1,
    rounds: Annotated[int, typer.Option("--rounds", help="Rounds of improvement, 64 inputs each.")] = 60,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the random exchanges.")] = 0,
    model: Model = None,
    mapping: Mapping = None,
    own_effects: OwnEffects = None,
    overwrite: Overwrite = False,
) -> None:
    """Design the experiment that tells most about the free parameters, within limits."""
    from .design import run_design

    check_named(own_effects, model)
    run_design(
        robot, model, out, limit, seconds, interval, noise or [], speed or [], floor or [], radius, already or [],
        experiments, doubt, rounds, seed, mapping, overwrite, own_effects,
    )  # fmt: skip


@app.command()
@one_line_errors
def demo(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for fit.json and pictures.")] = Path("jaxid-demo"),
    overwrite: Overwrite = False,
) -> None:
    """Both papers' robots identified from the package's own logs, next to the truth, and the papers' tables."""
    from .demo import run_demo

    run_demo(out, overwrite)


def main(argv: Sequence[str] | None = None) -> None:
    """Run one command line (by default the process's own). Always ends in `SystemExit` with the exit status."""
    # One thread: handing long loops of small operations to several takes twice as long, and this process is ours alone.
    os.environ.setdefault("PJRT_NPROC", "1")
    if argv is None:
        collect_seldom()
    app(args=repeat_flags(list(sys.argv[1:] if argv is None else argv), MANY), prog_name="jaxid")
