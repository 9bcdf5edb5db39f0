"""Cost of jaxid's linearisation per experiment and sample over experiments, samples and parameters; and of small fits by the
number done together."""

from dataclasses import replace
from typing import Any

import numpy as np

from . import jaxid_fit
from .linearisations import least, pioneer_ways, repeated
from .pioneer_problem import FREE, FitProblem
from .small_fits import members, side_by_side

EXPERIMENTS = (1, 2, 4, 8, 16, 64, 256)
SAMPLES = (100, 1_000, 10_000, 100_000)
PARAMETERS = (1, 2, 4, 7)
BATCHES = (1, 8, 64)
_CALLS = 3


def _row(problem: FitProblem, **what: int) -> dict[str, Any]:
    ways, _ = pioneer_ways(problem)
    spent = least({"jaxid": ways["jaxid"]}, _CALLS)["jaxid"]["processor_ms"]
    E, T = problem.inputs.shape[:2]
    row = {
        "experiments": E,
        "samples": T,
        **what,
        "processor_ms": spent,
        "us_per_experiment_sample": 1e3 * spent / (E * T),
    }
    print(f"scaling  {row}", flush=True)
    return row


def over_sizes(problem: FitProblem, quick: bool) -> list[dict[str, Any]]:
    """One size changed at a time, and long records of one experiment."""
    experiments, samples = (EXPERIMENTS[:4], SAMPLES[:2]) if quick else (EXPERIMENTS, SAMPLES)
    rows = [_row(repeated(problem, E)) for E in experiments]
    rows += [_row(repeated(problem, E, T)) for E in (8, 1) for T in samples if T != problem.inputs.shape[1] or E == 1]
    return rows


def over_parameters(problem: FitProblem) -> list[dict[str, Any]]:
    """The first few of the parameters free, initial states always."""
    from jaxid import float64
    from jaxid.estimate.output_error.direct import linearised_directly
    from jaxid.estimate.output_error.laid_out import direct
    from jaxid.estimate.output_error.setup import build
    from jaxid.estimate.output_error.what_counts import of_what_counts

    rows = []
    for count in PARAMETERS:
        names = FREE[:count]
        with float64():
            robot = jaxid_fit.robot_of(problem)
            robot = robot.with_parameters(robot.parameters.with_free(*names))
            start = {name: float(value) for name, value in zip(names, problem.start, strict=False)}
            structure, arrays, unknowns = build(
                robot, jaxid_fit.logs_of(problem), start=start, initial="estimate", integrator=jaxid_fit.INTEGRATOR
            )
            every: Any = direct(structure, replace(arrays, sigma=np.asarray(jaxid_fit.SIGMA)))
            laid_out, _ = of_what_counts(every)
        spent = least({"jaxid": lambda d=laid_out, u=unknowns: linearised_directly(d, u)}, _CALLS)["jaxid"]
        rows.append({"parameters": count, "processor_ms": spent["processor_ms"]})
        print(f"scaling  {rows[-1]}", flush=True)
    return rows


def over_batches(quick: bool) -> list[dict[str, Any]]:
    """Small fits a second by how many are done together."""
    rows = []
    for count in BATCHES[:2] if quick else BATCHES:
        problems = members(count)
        side_by_side(problems)  # what there is to compile
        found = side_by_side(problems)
        rows.append({"fits": count, "fits_per_processor_second": count / found.processor_seconds})
        print(f"scaling  {rows[-1]}", flush=True)
    return rows
