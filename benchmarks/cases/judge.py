"""Whether a result is wrong, and whether it says so.

Wrong: the free simulation of the fitted model misses the fit logs or the held-out log by more than twice the truth's own
simulation, or a parameter that is called identified is off by more than five of its standard errors. The truth's own
simulation is the independent simulator's, hidden effects included, without noise of sensors or process.

A result says so where it has not converged, where its residual is judged "poor" or "failed" ("coloured" alone still says
that the estimates stand), where the parameter in question is not called identified, or where any of its other notes warns.

A miss on the held-out log is no mistake where the uncertainty that the result states explains it: by the scatter of draws from
its covariance, or because the truth itself lies within it. For parameters that is within five standard errors; for all of
them together, the region of the same probability (chi-squared of the whole distance). There a prediction may hang on a hair,
as a pendulum's does close to the top, and the simulation at the true parameters must follow the held-out log, so that nothing
but those parameters can be at fault.

Where constants are given wrongly, estimates are right for those constants at best: there only predictions are held against
them.
"""

import time
import traceback
from collections.abc import Mapping, Sequence

import numpy as np
from scipy import stats

import jaxid
from benchmarks.cases.draw import Case

TOO_FAR, TOO_WRONG = 2.0, 5.0
_BEYOND = 1e9
"""Error that counts as any."""
_DRAWS = 6


def errors(case: Case, outputs: Sequence[np.ndarray], logs: jaxid.LogSet, first: int) -> float:
    """Error of simulated outputs over that of the truth's own simulation: root mean square over the channels, worst log."""
    worst = 0.0
    for k, (simulated, log) in enumerate(zip(outputs, logs, strict=True)):
        clean = case.clean[first + k]
        measured = log.outputs[:, : clean.shape[1]]
        floor = np.sqrt(np.nanmean((measured - clean) ** 2, axis=0))
        # Without noise a ten-thousandth of the signal is as good as none.
        floor = np.maximum(floor, 1e-4 * np.sqrt(np.nanmean(measured**2, axis=0)))
        missed = np.sqrt(np.nanmean((measured - simulated[:, : clean.shape[1]]) ** 2, axis=0))
        worst = max(worst, float(np.sqrt(np.mean((missed / floor) ** 2))))
    return worst


def words(fit: jaxid.Fit) -> list[str]:
    """What a result says against itself."""
    said = [] if fit.converged else [f"not converged: {fit.reason}"]
    judgement = fit.judgement
    if judgement is None:
        return [*said, *fit.notes]
    # A residual that is called coloured, no more, says that the estimates stand.
    said += [] if judgement.trustworthy else [judgement.sentence]
    return [*said, *(note for note in fit.notes if note != judgement.sentence)]


def own_scatter(case: Case, fit: jaxid.Fit) -> float:
    """Held-out error, in units as in `errors`, that the covariance of the fit lets one expect."""
    names, covariance = list(fit.free_names), np.nan_to_num(np.asarray(fit.covariance))
    rng = np.random.default_rng(case.number)
    centre = np.array([fit[name].value for name in names])
    table = fit.robot.parameters
    low, high = (np.array([getattr(table[name], side) for name in names]) for side in ("lower", "upper"))
    clean, log = case.clean[-1], case.held_out[0]
    measured = log.outputs[:, : clean.shape[1]]
    floor = np.sqrt(np.nanmean((measured - clean) ** 2, axis=0)) + 1e-4 * np.sqrt(np.nanmean(measured**2, axis=0))
    best = jaxid.simulate(fit.robot, case.held_out)[0][:, : clean.shape[1]]
    squares = []
    for _ in range(_DRAWS):
        drawn = np.clip(rng.multivariate_normal(centre, covariance, check_valid="ignore"), low, high)
        robot = fit.robot.with_values(**dict(zip(names, drawn.tolist(), strict=True)))
        try:
            other = jaxid.simulate(robot, case.held_out)[0][:, : clean.shape[1]]
        except jaxid.ParameterError:  # motions too fast to be simulated are within its errors
            return _BEYOND
        squares.append(float(np.mean(((other - best) / floor) ** 2)))
    return float(np.sqrt(1.0 + np.mean(squares)))


def truth_within(case: Case, fit: jaxid.Fit) -> bool:
    """Whether the truth explains the held-out log in the user's model and lies in the fit's own joint region."""
    if case.conditional:
        return False
    true = fit.robot.with_values(**case.truth)
    if not errors(case, jaxid.simulate(true, case.held_out), case.held_out, len(case.fit)) <= TOO_FAR:
        return False
    away = np.array([fit[name].value - case.truth[name] for name in fit.free_names])
    deviations = np.sqrt(np.diag(fit.covariance))
    if not (np.isfinite(fit.covariance).all() and np.all(deviations > 0)):
        return False
    z, correlation = away / deviations, fit.covariance / np.outer(deviations, deviations)
    distance = float(z @ np.linalg.solve(correlation + 1e-12 * np.eye(len(z)), z))
    return 0.0 <= distance <= float(stats.chi2.isf(2.0 * stats.norm.sf(TOO_WRONG), len(z)))


def _truth_in_interval(case: Case, fit: jaxid.Fit) -> dict[str, list]:
    rows = {}
    for name, true in case.truth.items():
        e = fit[name]
        off = (e.value - true) / e.std_error if e.std_error > 0 else float("nan")
        rows[name] = [true, e.value, e.std_error, e.status, off]
    return rows


def run(case: Case, estimate) -> dict:
    """The row of one case. `estimate(robot, logs)` gives a `Fit`; errors of jaxid's own count as having said so."""
    row = {
        "number": case.number,
        "family": case.family,
        "condition": case.condition,
        "adequate": case.adequate,
        "units": [case.units.time, case.units.length, case.units.mass, case.units.input],
        "facts": case.facts,
        "start": {name: case.start[name] / true if true else 1.0 for name, true in case.truth.items()},
    }
    begin = time.perf_counter()
    try:
        fit = estimate(case.robot.with_values(**case.start), case.fit)
        row["seconds"] = round(time.perf_counter() - begin, 3)
        states = None  # a fit in windows has no initial states of whole logs
        if all(log.name in fit.initial_states for log in case.fit):
            states = {n: np.array([fit.initial_states[log.name][n] for log in case.fit]) for n in fit.robot.states}
        free = errors(case, jaxid.simulate(fit.robot, case.fit, start=states), case.fit, 0)
        held_out = errors(case, jaxid.simulate(fit.robot, case.held_out), case.held_out, len(case.fit))
    except (jaxid.ParameterError, jaxid.LogError) as error:
        return row | {"outcome": "refused", "words": [str(error)]}
    except Exception:
        return row | {"outcome": "traceback", "words": [traceback.format_exc()[-1500:]]}
    parameters = {} if case.conditional else _truth_in_interval(case, fit)
    numbers = [fit[name].value for name in case.truth]
    row |= {"fit_error": free, "held_out_error": held_out, "parameters": parameters, "words": words(fit)}
    row["own_scatter"] = own_scatter(case, fit) if held_out > TOO_FAR else 1.0
    row["truth_within"] = truth_within(case, fit) if held_out > TOO_FAR else True
    row["verdict"] = fit.judgement.verdict if fit.judgement else ""
    row["errors_for"] = fit.standard_errors
    row["preflight"] = sorted({f.check for f in case.fit.preflight() if f.severity != "note"})
    return row | verdict(row, finite=bool(np.isfinite(numbers).all()))


def explained(row: Mapping) -> bool:
    """Whether a finite miss on the held-out log is what the stated uncertainty of the parameters leaves open."""
    return bool(row.get("truth_within")) and bool(row["held_out_error"] < np.inf)


def verdict(row: Mapping, finite: bool = True) -> dict:
    """`outcome`: "right", "wrong, said" or "wrong, silent", and why it is wrong."""
    why = [] if finite else ["not finite"]
    if not row["fit_error"] <= TOO_FAR:
        why.append("fit error")
    if not (row["held_out_error"] <= TOO_FAR * row["own_scatter"] or explained(row)):
        why.append("held-out error")
    off = [
        name
        for name, (_, _, deviation, status, z) in row["parameters"].items()
        if status == "identified" and not (abs(z) <= TOO_WRONG and deviation > 0)
    ]
    why += [f"{name} off" for name in off]
    if not why:
        return {"outcome": "right", "why": []}
    return {"outcome": "wrong, said" if row["words"] else "wrong, silent", "why": why}
