r"""The Pioneer paper's own way: equations 34 and 35, each from the logs that show only that motion.

Straight logs give a11, a15, a18, logs on the spot a22, a26, a29; the physical parameters follow with standard errors by
the delta method (Innocenti et al., section 3.2 and Tables 3-5).
"""

from collections.abc import Iterable
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np

from ..._float64 import in_float64
from ...estimate.linear.judge_equations import judged_equations
from ...estimate.linear.linear_steps import estimates_of, identify, notes_on
from ...estimate.result import Estimate, Fit
from ...logs import Channels, Log, LogError, LogSet
from ...parameters import Parameter, ParameterError
from ...robots.custom import Custom
from ...robots.pioneer import Pioneer, straight_inertia, turning_inertia
from ...robots.pioneer_closed_form import (
    StraightCoefficients,
    TurningCoefficients,
    caster_friction,
    straight_coefficients,
    traction,
    turning_coefficients,
    wheel_friction,
)

METHOD = "equations 34 and 35"


def motion(robot: Pioneer, log: Log) -> Literal["straight", "turning", "other"]:
    """What a log shows, by the RMS of eta1 and L eta2: straight (yaw below 10 %), on the spot (eta1 below 50 %), other.

    Nothing holds a turning robot on the spot: the centre of mass behind the axle (ym) drives it backwards.
    """
    ahead, turn = (float(np.sqrt(np.nanmean(log.output(name) ** 2))) for name in ("eta1", "eta2"))
    turn *= robot.parameters["L"].value
    if max(ahead, turn) == 0:
        return "other"
    return "straight" if turn <= 0.1 * ahead else "turning" if ahead <= 0.5 * turn else "other"


# Module-level functions of constants in the table, so that every fit uses the same compiled program.
def _straight(state, inputs, p, friction):
    driving = traction(inputs["V2"], inputs["V3"], p)[0]
    return {"eta1": p["a11"] * driving - p["a15"] * state["eta1"] - friction["wheels"]}


def _turning(state, inputs, p, friction):
    driving = traction(inputs["V2"], inputs["V3"], p)[1]
    return {"eta2": p["a22"] * driving - p["a26"] * state["eta2"] - friction["wheels"]}


def _single(robot: Pioneer, speed: str, coefficients, dynamics, title: str) -> Custom:
    free = {name: Parameter(float(value), free=True) for name, value in coefficients._asdict().items()}
    return Custom(
        dynamics=dynamics,
        state_names=(speed,),
        own_channels=Channels(inputs=("V2", "V3"), outputs=(speed,)),
        table={**robot.parameters.with_free(), **free},
        dry_friction=(("wheels", speed, list(free)[2]),),
        title=title,
    )


def equation_34(robot: Pioneer) -> Custom:
    """Straight motion, `deta1/dt = a11 F - a15 eta1 - a18 sgn(eta1)`, as a robot with free a11, a15, a18."""
    return _single(robot, "eta1", straight_coefficients(robot.parameters.numbers), _straight, "equation 34")


def equation_35(robot: Pioneer) -> Custom:
    """Turning on the spot, `deta2/dt = a22 Gamma - a26 eta2 - a29 sgn(eta2)`, as a robot with free a22, a26, a29."""
    return _single(robot, "eta2", turning_coefficients(robot.parameters.numbers), _turning, "equation 35")


def _from_coefficients(a, p: dict, free: tuple[str, ...]) -> dict:
    """Physical parameters and combinations from (a11, a15, a18, a22, a26, a29)."""
    straight, turning = StraightCoefficients(*a[:3]), TurningCoefficients(*a[3:])
    p = dict(p)
    cv, cs = wheel_friction(straight, p)
    p |= {name: value for name, value in (("Cv", cv), ("Cs", cs)) if name in free}
    cv1, cs1 = caster_friction(turning, p)
    found = {"Cv": cv, "Cs": cs, "Cv1": cv1, "Cs1": cs1, "1/a11": 1.0 / straight.a11, "1/a22": 1.0 / turning.a22}
    if "Ir" in free:
        p["Ir"] = p["Ir"] + 0.5 * p["R"] ** 2 * (found["1/a11"] - straight_inertia(p))
    found["Ir"] = p["Ir"]
    found["I0"] = p["I0"] + found["1/a22"] - turning_inertia(p)
    return found


@in_float64
def uncoupled_least_squares(robot: Pioneer, logs: Iterable[Log], *, window: int | None = None) -> Fit:
    """Fit the Pioneer's free parameters to `logs` by equations 34 and 35, each on the logs that show only that motion.

    `window`: samples in a stretch with one unknown initial speed, as in `integral_least_squares`; 2 is the paper's
    eq. 31, all consecutive intervals. The frictions follow from the coefficients; of the inertias only 1/a11 and 1/a22
    do, and Ir and I0, where free, are moved until the robot has these.

    Raises `LogError` where no log drives straight or turns on the spot, or the speeds of such a log do not vary, and
    `ParameterError` for a robot with effects, which these equations lack, or without a free parameter.
    """
    logs = list(logs)
    if not logs:
        raise LogError("There are no logs to identify from; give at least one.")
    if not robot.parameters.free_names:
        raise ParameterError("no parameter is free; free at least one (`robot.change('Cs', free=True)`)")
    if robot.effects:
        raise ParameterError(
            f"equations 34 and 35 know nothing of {', '.join(e.id for e in robot.effects)}; use "
            "jaxid.integral_least_squares."
        )
    kinds = [motion(robot, log) for log in logs]
    groups = {
        kind: [log for log, own in zip(logs, kinds, strict=True) if own == kind] for kind in ("straight", "turning")
    }
    if not groups["straight"] and not groups["turning"]:
        raise LogError(
            f"none of {', '.join(log.name for log in logs)} drives straight or turns on the spot, as equations 34 and "
            "35 need; give such logs or use jaxid.integral_least_squares, which has the coupled equations."
        )
    numbers, free = robot.parameters.numbers, robot.parameters.free_names
    notes, noise, parts, iterations = [], {}, [], 1
    covariance = np.zeros((6, 6))
    for k, (kind, single) in enumerate((("straight", equation_34(robot)), ("turning", equation_35(robot)))):
        own = groups[kind]
        equation = "34 (straight)" if kind == "straight" else "35 (on the spot)"
        if not own:
            lost = "1/a11, Cv and Cs" if kind == "straight" else "1/a22, Cv1 and Cs1"
            notes.append(f"No log for equation {equation}: {lost} keep the table's values; add such a log.")
            parts.append(np.array([single.parameters[name].value for name in single.parameters.free_names]))
            continue
        solution, equations, _, _ = identify(single, own, window)
        if any(status != "identified" for status in solution.status):
            which = [n for n, s in zip(equations.names, solution.status, strict=True) if s != "identified"]
            raise LogError(
                f"{', '.join(log.name for log in own)} do not determine {', '.join(which)} of equation {equation}; "
                "give logs with more than one speed."
            )
        parts.append(solution.theta)
        covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = solution.covariance
        noise[equations.speeds[0]] = float(solution.noise[0])
        notes.append(f"Equation {equation} from {', '.join(log.name for log in own)}.")
        notes += notes_on(robot, equations)[:1]
    notes += [
        f"{log.name} is neither straight nor on the spot and was not used."
        for log, k in zip(logs, kinds, strict=True)
        if k == "other"
    ]

    a = jnp.concatenate([jnp.asarray(part) for part in parts])
    values = _from_coefficients(a, numbers, free)
    slopes = jax.jacfwd(lambda x: _from_coefficients(x, numbers, free))(a)
    labels = tuple(values)
    slope = np.stack([np.asarray(slopes[label]) for label in labels])
    spread = slope @ covariance @ slope.T
    have = {"straight": bool(groups["straight"]), "turning": bool(groups["turning"])}
    needs = {
        "Cv": "straight",
        "Cs": "straight",
        "1/a11": "straight",
        "Cv1": "turning",
        "Cs1": "turning",
        "1/a22": "turning",
    }
    found: dict[str, Estimate] = {}
    numbers = dict(numbers)
    for name in free:
        p = robot.parameters[name]
        value, error, status = p.value, float("nan"), "not_identifiable"
        if (
            name in needs
            and have[needs[name]]
            or name in ("Ir", "I0")
            and have["straight" if name == "Ir" else "turning"]
        ):
            raw = float(values[name])
            value = float(np.clip(raw, p.lower, p.upper))
            i = labels.index(name)
            if value != raw:
                status = "at_bound"
            elif name in needs:
                error, status = float(np.sqrt(spread[i, i])), "identified"
        numbers[name] = value
        found[name] = Estimate.of(value, error, p.unit, status)  # type: ignore[arg-type]
    if groups["turning"]:
        notes.append(
            "Equation 35 neglects the centre of mass (ym) and the caster's own motion; Cv1 and Cs1 are small "
            "differences of large numbers and take up what it neglects, far beyond their standard errors."
        )
    moved = [f"{n} to match {c}" for n, c in (("Ir", "1/a11"), ("I0", "1/a22")) if n in free and have[needs[c]]]
    if moved:
        notes.append(f"Single inertias are not determined by equations 34 and 35; the robot has {' and '.join(moved)}.")
    identified = robot.with_values(**{name: numbers[name] for name in free})
    combined = {}
    for label, (_, unit, _) in robot.combinations.items():
        i = labels.index(label)
        ok = have[needs[label]]
        error = float(np.sqrt(spread[i, i])) if ok else float("nan")
        combined[label] = Estimate.of(float(values[label]), error, unit, "identified" if ok else "not_identifiable")
    own = np.full((len(free), len(free)), np.nan)
    known = [i for i, name in enumerate(free) if found[name].status == "identified"]
    places = [labels.index(free[i]) for i in known]
    own[np.ix_(known, known)] = spread[np.ix_(places, places)]
    fit = Fit(
        method=METHOD,
        robot=identified,
        parameters=estimates_of(identified, found),
        combinations=combined,
        free_names=free,
        covariance=own,
        noise=noise,
        converged=True,
        reason="linear least squares, solved",
        iterations=iterations,
        notes=tuple(notes),
    )
    return judged_equations(fit, LogSet(logs))
