"""From where a fit begins to its first minimum, with rescues where that is a poor one and without the logs on which the
simulation diverges."""

from functools import partial

from .astray import past_the_astray, without
from .globalise import ambiguous_index, globalise
from .optimum import Optimum
from .posed import Options, Posed
from .problem import Problem, Unknowns
from .rescue import diverging, linear_start, recovered
from .windows import Lost, Unless, left_over


def linear_unknowns(fit: Posed, problem: Problem) -> Unknowns | None:
    """Where the integral least-squares estimate lies, or None where the robot or its logs have none."""
    z = linear_start(fit.robot, fit.whole, fit.structure, problem)
    return None if z is None else fit.unknowns._replace(z=z)


def _where_it_converges(fit: Posed, options: Options) -> tuple[Problem, Optimum, list[int]]:
    """The minimum, its problem, and the numbers of logs left out because the simulation diverges on them alone.

    Logs on which only the start diverges come back once the others have led to better parameters.
    """
    structure, problem = fit.structure, fit.problem
    optimum = options.minimise(structure, problem, fit.unknowns)
    bad = diverging(optimum)
    if not bad or len(bad) == problem.mask.shape[0]:
        return problem, optimum, []
    optimum = options.minimise(structure, without(problem, bad), fit.unknowns)
    again = options.minimise(structure, problem, optimum.unknowns)
    bad = diverging(again)
    if not bad:
        return problem, again, []
    rest = without(problem, bad)
    return rest, options.minimise(structure, rest, optimum.unknowns), bad


def first_minimum(fit: Posed, options: Options, unless: Unless | None = None) -> tuple[Problem, Optimum, list[int]]:
    """The best minimum from the start and, where that one is poor, from others; its problem; the numbers of the logs that
    were left out. Call under float64. Raises `Lost` where `unless` says so."""
    structure, problem, unknowns = fit.structure, fit.problem, fit.unknowns
    index = ambiguous_index(structure)
    if index is not None:
        linear = linear_unknowns(fit, problem)
        starts = [unknowns] if linear is None else [unknowns, linear]
        return problem, _past(fit, options, globalise(structure, problem, starts, index, report=options.report)), []
    problem, optimum, left_out = _where_it_converges(fit, options)
    options.report("first minimum found")
    if unless is not None and unless(problem, optimum):
        raise Lost(left_over(problem, optimum, fit.logs))
    if left_out:
        return problem, optimum, left_out
    optimum = recovered(
        fit.robot,
        fit.whole,
        structure,
        problem,
        unknowns,
        optimum,
        fit.start,
        max_steps=options.max_steps,
        solver=options.solver,
        far_starts=options.far_starts,
        report=options.report,
    )
    return problem, _past(fit, options, optimum), []


def _past(fit: Posed, options: Options, optimum: Optimum) -> Optimum:
    """The minimum beyond the one in which a single log holds all; windows, which begin where the log is, know no such."""
    if fit.window is not None:
        return optimum
    found = past_the_astray(fit.problem, optimum, partial(options.minimise, fit.structure))
    if found is not optimum:
        options.report("one log held the others in a poor minimum; went on from where it was left out")
    return found
