"""Arguments and options that several commands share: their names on the command line, and what the help says of them."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal

import typer

MANY = (
    "--fit", "--held-out", "--check", "--method", "--limit", "--noise", "--already", "--speed", "--floor", "--before",
    "--after", "--held-out-before", "--held-out-after",
)  # fmt: skip
"""Flags that take every value up to the next flag."""


def _robots(begun: str) -> list[str]:
    """Built-in robots whose names begin so, for the shell to complete."""
    return [name for name in ("pioneer", "omni", "axis", "differential") if name.startswith(begun)]


RobotArgument = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="pioneer, omni, axis, differential, a robot's file (.toml), or package.module:attribute for your own.",
        autocompletion=_robots,
    ),
]
Mapping = Annotated[
    Path | None, typer.Option("--map", metavar="MAPPING.toml", help="Standard column name to the file's column.")
]
Model = Annotated[
    Path | None,
    typer.Option(
        "--model", metavar="MODEL.toml", help="Known constants, start values, free parameters, bounds, priors, effects."
    ),
]

Loss = Annotated[
    Literal["squares", "huber", "cauchy", "student_t"],
    typer.Option("--loss", help="Of output error: squares, or one that outliers pull less."),
]
Covariance = Annotated[
    Literal["auto", "white", "robust"],
    typer.Option(
        "--covariance",
        help="Of output error: for white residuals, or robust against coloured ones; auto: as the residual is.",
    ),
]
ClockOffset = Annotated[
    bool, typer.Option("--clock-offset", help="Inputs and outputs may be on different clocks: estimate the offset.")
]
Windows = Annotated[
    str,
    typer.Option(
        "--windows",
        metavar="SECONDS|auto|none",
        help="Windows with their own initial states, for what a free simulation cannot follow: of output error, and, in "
        "seconds, of integral least squares.",
    ),
]


ControlLaw = Annotated[
    str | None,
    typer.Option(
        "--controller",
        metavar="MODULE:ATTRIBUTE",
        help="Simulate the closed loop with this control law, from the reference among the logs' further columns.",
    ),
]
BetweenSamples = Annotated[
    Literal["hold", "linear"],
    typer.Option(
        "--intersample",
        help="Inputs between samples: held, as a computer commands them, or linear, as a sensor sees.",
    ),
]


Candidates = Annotated[
    str | None,
    typer.Option(
        "--effects",
        metavar="MODULE:ATTRIBUTE",
        help="Effects of your own to try beside the catalogue's: an Effect, a list of them, or a function that returns them.",
    ),
]
OwnEffects = Annotated[
    str | None,
    typer.Option(
        "--effects",
        metavar="MODULE:ATTRIBUTE",
        help="Effects of your own that --model names, as jaxid explain writes it.",
    ),
]
Overwrite = Annotated[
    bool,
    typer.Option(
        "--overwrite", help="Write over results of another command or robot in the folder, and over files edited there."
    ),
]


class Method(StrEnum):
    """Estimators by the name that they have in fit.json."""

    integral_least_squares = "integral_least_squares"
    instrumental_variables = "instrumental_variables"
    output_error = "output_error"
    prediction_error = "prediction_error"
