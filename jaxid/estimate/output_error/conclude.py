"""The last step of an output-error fit: simulate at the optimum, judge the residual, and choose standard errors that hold."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...logs import LogSet
from ...logs.noise import noise_scale
from ...logs.windows import bridged, stitched
from ...robots.robot import Robot
from ..judge import judge, judged
from ..judgement import LOOK_FURTHER
from ..lacking import FALSE_ALARM
from ..nothing_moved import where_nothing_moved
from ..result import Fit
from ..slow_sensors import no_larger_than_left
from .bound_conflict import bound_conflicts
from .by_prediction import related_by_prediction
from .counted_speeds import counted_speeds
from .evaluation import cost_at, simulated
from .from_optimum import AtBounds, fit_at, known_spread
from .impossible import without_impossible
from .in_a_loop import in_a_loop
from .innovations import innovations
from .lost_rows import lost_rows
from .neglected import neglected
from .one_way import one_way
from .optimum import Optimum
from .problem import Problem, Structure, Unknowns
from .robust_covariance import robust_covariance
from .went_nowhere import with_search

Covariance = Literal["auto", "white", "robust"]
Rivals = Mapping[str, Callable[[], Unknowns | None]]
_OUTLYING = 0.3
"""Root of a robust loss's weight below which a sample is an outlier and no part of the residual that is judged."""

FED_BACK = (
    "A controller made commands of coloured noise of the sensors: the parameters are estimated from the whitened residual "
    "(generalised least squares), which such a loop does not bias."
)


def simulated_at(structure: Structure, problem: Problem, unknowns: Unknowns, logs: LogSet) -> list[NDArray[np.float64]]:
    """Simulated outputs [T, channels.measured] of each log."""
    every = np.asarray(simulated(structure, problem, unknowns))
    return [every[e, : len(log)] for e, log in enumerate(logs)]


def _without_outliers(logs: LogSet, problem: Problem) -> LogSet:
    """The logs without the samples that a robust loss gave little weight."""
    if problem.weight is None:
        return logs
    kept = []
    for log, weight in zip(logs, np.asarray(problem.weight), strict=True):
        outputs = np.where(weight[: len(log)] < _OUTLYING, np.nan, log.outputs)
        there = np.isfinite(outputs).any(axis=0)
        kept.append(replace(log, outputs=np.where(there, outputs, log.outputs)))
    return LogSet(kept)


def _own_error(robot: Robot, logs: LogSet, problem: Problem, integration: float | None) -> dict[str, float]:
    """The simulation's own error of every channel that is a position, where it is known."""
    if not integration:
        return {}
    places = {*robot.positions.values(), *robot.measured_angles, *logs.channels.positions}
    sigma = dict(zip(logs.channels.measured, np.asarray(problem.sigma).tolist(), strict=True))
    return {name: integration * sigma[name] for name in logs.channels.measured if name in places}


def conclude(
    robot: Robot,
    logs: LogSet,
    structure: Structure,
    problem: Problem,
    inner: Optimum,
    bounded: AtBounds,
    *,
    covariance: Covariance = "auto",
    bread: float = 1.0,
    rivals: Rivals | None = None,
    left_out: Sequence[str] = (),
    whole: tuple[LogSet, float] | None = None,
    integration: float | None = None,
    begun: Mapping[str, float] | None = None,
    read: NDArray[np.float64] | None = None,
    **others: Any,
) -> Fit:
    """The `Fit` at an optimum (see `fit_at`, which takes `others`) with its judgement. Call under float64.

    - `covariance`: "auto" is the robust one where the residual is not white.
    - `bread`: what a robust loss takes off the information.
    - `rivals`: what the fit must not be worse than, by words; they are only simulated where the residual raises doubts.
    - `left_out`: names of the logs without weight.
    - `whole`: the logs whose windows, of so many seconds, `logs` are; the residual is then judged along them.
    - `integration`: RMS of the simulation's own error in units of the noise; where it is given, the residual of a free
      simulation is asked for forces that the model lacks, too (`neglected`).
    - `read`: the readings [E, T, ny], where average rounding was taken out of those in `problem`: how far it is known, they
      say, and not what is left without it.
    - `begun`: the values from which the search began, for a sentence where it went nowhere.
    """
    kept = [e for e, log in enumerate(logs) if log.name not in left_out]
    seen = _without_outliers(logs, problem)
    own: Sequence[NDArray[np.float64]] = ()
    apart: Sequence[NDArray[np.float64]] = ()
    ahead: Sequence[NDArray[np.float64]] = ()
    moved: Sequence[NDArray[np.float64]] | None = None
    if whole is not None:
        told = innovations(structure, bounded.problem, bounded.optimum.unknowns)
        own, ahead = list(told.white), list(told.ahead)
        # A sample that tells where its window began says nothing of the residual.
        absent = [
            np.where(np.isfinite(each[: len(log)]) & (log.name not in left_out), log.outputs, np.nan)
            for log, each in zip(seen, own, strict=True)
        ]
        pairs = list(zip(whole[0], stitched(*whole, absent), strict=True))
        lost = [not np.isfinite(outputs).any() for _, outputs in pairs]
        seen = LogSet(
            [log if none else replace(log, outputs=own) for (log, own), none in zip(pairs, lost, strict=True)]
        )
        noise = noise_scale(whole[0])
    else:
        seen, noise = LogSet([seen[e] for e in kept]), noise_scale(logs)

    def outputs(problem: Problem, unknowns: Unknowns) -> list[NDArray[np.float64]]:
        every = simulated_at(structure, problem, unknowns, logs)
        if whole is not None:
            return [bridged(values) for values in stitched(*whole, every)]
        return [every[e] for e in kept]

    optimum = bounded.optimum
    here = outputs(bounded.problem, optimum.unknowns)
    if whole is None:
        noise = no_larger_than_left(seen, here, noise)
    else:
        apart = [each[: len(log)] * np.asarray(bounded.problem.sigma) for log, each in zip(logs, own, strict=True)]
        apart = stitched(*whole, apart)
        here = [np.where(np.isfinite(e), log.outputs + e, y) for log, e, y in zip(whole[0], apart, here, strict=True)]
        # What each sample's noise is no part of: innovations over their own deviation leave some of it, and what the window
        # simulates hangs on all of its samples.
        errors = [each[: len(log)] * np.asarray(bounded.problem.sigma) for log, each in zip(logs, ahead, strict=True)]
        moved = [
            np.where(np.isfinite(log.outputs), log.outputs + np.nan_to_num(e), y)
            for log, e, y in zip(whole[0], stitched(*whole, errors), here, strict=True)
        ]
    own_error = _own_error(robot, logs, bounded.problem, integration)
    judgement = judge(seen, here, noise, own_error=own_error, moved=moved)
    unrelated: set[str] = set()
    if whole is not None and moved is not None and judgement.follows:
        at, plain = optimum.unknowns, outputs(bounded.problem, optimum.unknowns)
        asked = structure, bounded.problem, at, logs, whole
        unrelated = related_by_prediction(*asked, apart, moved, plain, judgement.follows)
        judgement = judge(seen, here, noise, own_error=own_error, moved=moved, unrelated=unrelated)
    if not judgement.trustworthy and rivals:
        found = {}
        for words, rival in rivals.items():
            there = rival()
            if there is not None:
                found[words] = outputs(problem, there._replace(states=optimum.unknowns.states))
        judgement = judge(seen, here, noise, others=found, own_error=own_error, moved=moved, unrelated=unrelated)
    loop = None
    if whole is None and read is None and not judgement.white and judgement.verdict != "failed":
        loop = in_a_loop(structure, bounded.problem, optimum.unknowns, logs)
    if loop is not None:
        fed_back = judge(seen, outputs(bounded.problem, loop.unknowns), noise, own_error=own_error, fed_back=True)
        # Else it is the model that lacks something, and the colour is that of its errors.
        if fed_back.trustworthy:
            cost = cost_at(structure, bounded.problem, loop.unknowns)
            judgement, optimum = fed_back, optimum._replace(unknowns=loop.unknowns, cost=np.asarray(cost))
            bounded = bounded._replace(optimum=optimum)
        else:
            loop = None
    robust = covariance == "robust" or (covariance == "auto" and not (judgement.white and read is None))
    as_read = problem if read is None else replace(problem, outputs=read)
    colours = loop.colours if loop is not None else ()
    found = robust_covariance(structure, as_read, inner.unknowns, colours) if robust or colours else None
    known = known_spread(problem, inner).covariance
    matrix = bread**2 * found.with_lost(known) if found else None
    fit = fit_at(robot, logs, structure, problem, inner, bounded, covariance=matrix, left_out=left_out, **others)
    fit = without_impossible(fit, structure, bounded.problem, optimum.unknowns)
    if found and np.any(found.between > 1.0):
        fit = replace(fit, notes=(*fit.notes, _disagreement(structure.names, found.between, len(kept))))
    fit = replace(fit, standard_errors="robust" if robust else "white")
    if judgement.trustworthy and whole is None and integration is not None:
        there, at = bounded.problem, optimum.unknowns
        noise_is = {"white": bool(judgement.white), "colours": colours}
        lacking = neglected(fit.robot, logs, structure, there, at, error=integration, **noise_is)
        if lacking is not None and lacking.p_value < FALSE_ALARM:
            marked = lacking.p_value, lacking.moves(fit)
            judgement = replace(judgement.doubted(lacking.sentence(fit)), marked=marked)
        elif lacking is not None and lacking.worth_a_note(fit):
            fit = replace(fit, notes=(*fit.notes, f"{lacking.sentence(fit)} {LOOK_FURTHER}"))
    if loop is not None:
        fit = replace(fit, notes=(*fit.notes, FED_BACK))
    unknown = lost_rows(fit, logs, structure, bounded.problem, optimum.unknowns)
    alone = one_way(fit, whole[0] if whole else logs)
    counted = "" if judgement.trustworthy or whole is not None else counted_speeds(fit, logs)
    fit = replace(fit, notes=(*fit.notes, *filter(None, (unknown, alone, counted))))
    past = bound_conflicts(fit, structure, problem, inner) if judgement.verdict != "failed" else {}
    for sentence in past.values():
        judgement = judgement.doubted(sentence) if judgement.trustworthy else judgement.also(sentence)
    if begun is not None:
        fit, judgement = with_search(fit, judgement, begun, past)
    white = dict(zip(structure.names, np.sqrt(np.maximum(np.diag(known), 0.0)).tolist(), strict=True))
    return judged(fit, where_nothing_moved(fit, judgement, whole[0] if whole else logs), white)


def _disagreement(names: Sequence[str], between: NDArray[np.float64], logs: int) -> str:
    """The sentence on logs that scatter by more than their residuals say."""
    worst = int(np.argmax(between))
    return (
        f"The {logs} logs disagree: fitted alone they would scatter by {between[worst]:.1f} times (in {names[worst]}) what "
        "their residuals say. The standard errors are widened to that; `repeatability` says which log differs."
    )


def no_priors(problem: Problem) -> bool:
    """Whether only the data holds the parameters, so that no other parameters may leave less."""
    return not bool(np.any(np.asarray(problem.prior_precision) > 0))
