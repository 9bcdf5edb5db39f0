"""Do 95 % intervals hold when the motion is disturbed, too? `python -m benchmarks.prediction_error [--only axis --fits 300]`.

An Euler-Maruyama simulator in NumPy with steps of half a millisecond (nothing of jaxid in it) disturbs the velocities with
white noise and measures with sensor noise; all realisations are fitted in one compiled batch, by prediction error and by
output error with standard errors for white residuals and with robust ones. Writes
`benchmarks/results/prediction_error.json` and the coverage section of docs/prediction_error.md.
"""

import argparse
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import jaxid
from jaxid.estimate.output_error.fleet import fit_lanes
from jaxid.estimate.output_error.problem import Unknowns as Coordinates
from jaxid.estimate.output_error.robust_covariance import robust_covariance
from jaxid.estimate.output_error.setup import build as build_simulation
from jaxid.estimate.prediction_error.likelihood import flat
from jaxid.estimate.prediction_error.scoring import QUIETEST, Optimum, minimise_lanes
from jaxid.estimate.prediction_error.setup import Task, build
from jaxid.estimate.prediction_error.uncertainties import pseudo_inverse
from jaxid.estimate.prediction_error.unknown_levels import Looks, averaged, nodes
from reference import excitation
from reference.effects import complete, kernel_vector
from reference.pioneer import PIONEER, mass_and_bias
from reference.stick_slip import integrate

from .prediction_error_page import write_page

RESULTS = Path(__file__).parent / "results" / "prediction_error.json"
PAGE = Path(__file__).parents[1] / "docs" / "prediction_error.md"
DT, FINE = 0.02, 40
JUDGED = 4.0
"""Standard errors that a parameter must be away from its bounds."""
_APART = 0.3
"""Logarithm of the largest factor by which start values are off."""
_ROBUST = 100
"""Fits whose robust covariance is computed."""


def multilevel(seed: int, samples: int, largest: float, hold: int = 20) -> np.ndarray:
    """Random levels, each held for some samples [T]."""
    levels = np.random.default_rng(seed).uniform(-largest, largest, -(-samples // hold))
    return np.repeat(levels, hold)[:samples]


def stopped(v: np.ndarray, slowed: np.ndarray | float) -> np.ndarray:
    """Speeds after dry friction has taken off up to `slowed`."""
    return np.sign(v) * np.maximum(np.abs(v) - slowed, 0.0)


def axis(u: np.ndarray, N: int, q, r, random, true) -> tuple[np.ndarray, np.ndarray]:
    """Speeds [N, T, 1] of N disturbed axes, and their inputs [N, T, 1]."""
    h, v, found = DT / FINE, np.zeros(N), []
    for force in u[:, 0]:
        found.append(v + r[0] * random.normal(size=N))
        for _ in range(FINE):
            rate = (force - true["offset"] - true["Fv"] * v) / true["M"]
            v = stopped(v + h * rate + q[0] * np.sqrt(h) * random.normal(size=N), h * true["Fc"] / true["M"])
    return np.stack(found, axis=1)[..., None], np.broadcast_to(u, (N, *u.shape))


def omni(u: np.ndarray, N: int, q, r, random, true) -> tuple[np.ndarray, np.ndarray]:
    """V, Vn, W [N, T, 3] of N disturbed omnis (equations of Conceicao et al. 2006 with the turning frame's own terms)."""
    M, b, radius, gear, constant, resistance = 35.0, 0.195, 0.05, 12.0, 0.025, 0.6
    inertia = np.array([M, M, true["J"]])
    viscous = np.array([true["Bv"], true["Bvn"], true["Bw"]])
    slowed = np.array([true["Cv"], true["Cvn"], true["Cw"]]) / inertia
    h, x, found = DT / FINE, np.zeros((N, 3)), []
    for volts in u:
        found.append(x + np.asarray(r) * random.normal(size=(N, 3)))
        for _ in range(FINE):
            V, Vn, W = x.T
            rims = np.stack([Vn + b * W, -V + b * W, -Vn + b * W, V + b * W])
            f = gear * constant / radius * (volts[:, None] - constant * gear * rims / radius) / resistance
            pull = np.stack([f[3] - f[1] + M * W * Vn, f[0] - f[2] - M * W * V, b * f.sum(axis=0)], axis=1)
            kick = np.asarray(q) * np.sqrt(h) * random.normal(size=(N, 3))
            x = stopped(x + h * (pull - viscous * x) / inertia + kick, h * slowed)
    return np.stack(found, axis=1), np.broadcast_to(u, (N, *u.shape))


def pioneer(u: np.ndarray, N: int, q, r, random, true) -> tuple[np.ndarray, np.ndarray]:
    """eta1, eta2 [N, T, 2] of N disturbed Pioneers, by the independent simulator: forces that are drawn anew every half
    millisecond, of the size that kicks both speeds as asked while the caster trails."""
    robot = PIONEER.with_parameters(**{name: true[name] for name in PIONEER.parameters if name in true})
    p, e = np.array(list(robot.parameters.values())), kernel_vector(complete(None, robot.name))
    mass, start, h = np.empty((2, 2)), np.zeros(robot.n_states), DT / FINE
    mass_and_bias(0.0, 0.0, 0.0, p, 0.0, mass, np.empty(2))
    breaks, felt, found = h * np.arange((len(u) - 1) * FINE + 1), np.repeat(u, FINE, axis=0), []
    for _ in range(N):
        kicks = (np.asarray(q) / np.sqrt(h) * random.normal(size=(len(breaks), 2))) @ mass.T
        inputs = np.concatenate([felt[: len(breaks)], kicks], axis=1)
        states, _, events = integrate(robot.dynamics, start, breaks, inputs, p, e, 4, 2, 3, 1e-6, 1e-8, 0.01)
        if events < 0:
            raise RuntimeError("The simulation of a disturbed Pioneer came to a halt.")
        found.append(states[::FINE, 4:6] + np.asarray(r) * random.normal(size=(len(u), 2)))
    return np.stack(found), np.broadcast_to(u, (N, *u.shape))


def pendulum(u: np.ndarray, N: int, q, r, random, true) -> tuple[np.ndarray, np.ndarray]:
    """Angles [N, T, 1] of N inverted pendulums, held upright by a controller that the model does not know, and inputs."""
    h, angle, speed, last, found, inputs = DT / FINE, np.zeros(N), np.zeros(N), np.zeros(N), [], []
    for wanted in u[:, 0]:
        y = angle + r[0] * random.normal(size=N)
        volts = wanted - 8.0 * y - 1.5 * (y - last) / DT
        last = y
        found.append(y)
        inputs.append(volts)
        for _ in range(FINE):
            rate = true["k"] * np.sin(angle) - true["c"] * speed + true["b"] * volts
            angle, speed = angle + h * speed, speed + h * rate + q[0] * np.sqrt(h) * random.normal(size=N)
    return np.stack(found, axis=1)[..., None], np.stack(inputs, axis=1)[..., None]


def upright() -> jaxid.Custom:
    """An inverted pendulum of which only the angle is measured."""

    def dynamics(s, u, p):
        return {"angle": s["speed"], "speed": p["k"] * jnp.sin(s["angle"]) - p["c"] * s["speed"] + p["b"] * u["u"]}

    values = {"k": (9.0, "1/s^2"), "c": (0.5, "1/s"), "b": (3.0, "1/(V s^2)")}
    return jaxid.Custom(
        dynamics=dynamics,
        state_names=("angle", "speed"),
        own_channels=jaxid.Channels(inputs=("u",), outputs=("angle",), units={"u": "V", "angle": "rad"}),
        table={name: jaxid.Parameter(v, unit, free=True, lower=0.0) for name, (v, unit) in values.items()},
        title="pendulum",
    )


@dataclass(frozen=True)
class Setting:
    """One row of the study: process noise `q` per velocity, sensor noise `r` per channel, `inputs` of the runs."""

    name: str
    robot: Callable[[], jaxid.Robot]
    simulator: Callable
    q: tuple[float, ...]
    r: tuple[float, ...]
    inputs: tuple[np.ndarray, ...]
    simulated: bool = True
    """Whether a free simulation can follow it, so that output error is compared."""


def _axis() -> jaxid.Robot:
    return jaxid.Axis().with_values(M=1.0, Fv=2.0, Fc=0.5, offset=0.05)


_USUAL = tuple(multilevel(seed, 512, 4.0)[:, None] for seed in (0, 1))
_CRAWL = tuple(multilevel(seed, 512, 1.2)[:, None] for seed in (0, 1))
_OMNI = tuple(excitation.experiment("omni", "multilevel", 512, seed=seed) for seed in (40, 41))
SETTINGS = (
    Setting("axis: process 0.05, sensor 0.01", _axis, axis, (0.05,), (0.01,), _USUAL),
    Setting("axis: process 0.2, sensor 0.01", _axis, axis, (0.2,), (0.01,), _USUAL),
    Setting("axis: process 0.005, sensor 0.01", _axis, axis, (0.005,), (0.01,), _USUAL),
    Setting("axis: crawling, process 0.05, sensor 0.01", _axis, axis, (0.05,), (0.01,), _CRAWL),
    Setting(
        "inverted pendulum: process 0.1, sensor 0.002",
        upright,
        pendulum,
        (0.1,),
        (0.002,),
        tuple(multilevel(seed, 512, 2.0)[:, None] for seed in (0, 1)),
        False,
    ),
    Setting(
        "omni: process 0.05, 0.05, 0.1, sensor 0.01, 0.01, 0.02",
        jaxid.Omni,
        omni,
        (0.05, 0.05, 0.1),
        (0.01, 0.01, 0.02),
        _OMNI,
    ),
    Setting(
        "pioneer: process 0.05, 0.1, sensor 0.01, 0.02",
        jaxid.Pioneer,
        pioneer,
        (0.05, 0.1),
        (0.01, 0.02),
        tuple(
            excitation.experiment("pioneer", kind, 512, seed=seed)
            for seed, kind in ((40, "multilevel"), (41, "turning"))
        ),
    ),
)


def _figures(off: np.ndarray, errors: np.ndarray, judged: np.ndarray) -> dict:
    """Coverage of 95 % intervals, bias in standard deviations, and reported over real standard deviation."""
    cover = np.mean(np.abs(off) <= 1.959964 * errors, axis=0)
    spread = off.std(axis=0, ddof=1)
    return {
        "coverage": {
            "mean": float(cover[judged].mean()),
            "lowest": float(cover[judged].min()),
            "highest": float(cover[judged].max()),
            "each": cover.tolist(),
        },
        "bias_in_standard_deviations": (off.mean(axis=0) / spread).tolist(),
        "standard_error_over_scatter": (np.median(errors, axis=0) / spread).tolist(),
    }


def covariances(task: Task, own: Mapping[str, jax.Array], found: Optimum, lanes: int) -> np.ndarray:
    """Covariances [N, p, p] of N fits, as `prediction_error` has them for white innovations: averaged over the levels of
    process noise that the logs leave open."""
    problem, n = task.problem, len(task.names)
    x, information = np.asarray(found.x), np.asarray(found.look.information)
    levels = range(n, n + len(task.model.noisy))
    lower, upper = (np.asarray(edge / problem.scale) for edge in (problem.lower, problem.upper))
    moved = np.concatenate([(x[:, :n] > lower) & (x[:, :n] < upper), x[:, n:] > QUIETEST], axis=1)
    places = [nodes(one, about, levels) for one, about in zip(x, information, strict=True)]
    points = [place.points for own_places in places for place in own_places]
    if not points:
        return np.array([pseudo_inverse(about) for about in information])
    sizes = [sum(len(place.points) for place in own_places) for own_places in places]
    whose = np.repeat(np.arange(len(x)), sizes)
    mine, at = {name: leaf[whose] for name, leaf in own.items()}, jnp.asarray(np.concatenate(points))
    look = minimise_lanes(task.names, task.model, task.problem, mine, at, lanes=lanes, max_steps=0).look
    all_of_them, begin = Looks(*map(np.asarray, look)), iter(np.cumsum([0, *map(len, points)]))

    def looks(points: np.ndarray) -> Looks:
        first = next(begin)  # asked for in the order of `points`
        return Looks(*(leaf[first : first + len(points)] for leaf in all_of_them))

    return np.array([averaged(x[k], information[k], looks, levels, moved[k]) for k in range(len(x))])


def study(setting: Setting, fits: int, seed: int) -> dict:
    """One row."""
    begin, robot = time.process_time(), setting.robot()
    true, random = robot.parameters.numbers, np.random.default_rng(seed)
    runs = [setting.simulator(u, fits, setting.q, setting.r, random, true) for u in setting.inputs]
    logs = jaxid.LogSet(
        jaxid.Log.from_arrays(
            f"{e}", DT * np.arange(y.shape[1]), u[0], dict(zip(robot.channels.outputs, y[0].T, strict=True)), robot
        )
        for e, (y, u) in enumerate(runs)
    )
    with jaxid.float64():
        task = build(robot, logs, start={}, initial="known")
        E, T, ny = task.problem.records.outputs.shape
        outputs, inputs = np.zeros((fits, E, T, ny)), np.zeros((fits, *task.problem.records.inputs.shape))
        for e, (y, u) in enumerate(runs):
            outputs[:, e, : y.shape[1], : y.shape[2]], inputs[:, e, : u.shape[1]] = y, u
        own = {"outputs": jnp.asarray(outputs), "inputs": jnp.asarray(inputs)}
        n = len(task.names)
        factors = np.exp(np.random.default_rng(13).uniform(-_APART, _APART, (fits, n)))
        starts = np.repeat(np.asarray(flat(task.start))[None], fits, axis=0)
        starts[:, :n] *= factors
        lanes = min(32, fits)
        found = minimise_lanes(task.names, task.model, task.problem, own, jnp.asarray(starts), lanes=lanes)
        x = np.asarray(found.x)
        errors = np.sqrt(np.diagonal(covariances(task, own, found, lanes), axis1=1, axis2=2))
        scale, values = np.asarray(task.problem.scale), np.array([true[name] for name in task.names])
        off, spread = x[:, :n] * scale - values, errors[:, :n] * scale
        lower, upper = np.asarray(task.problem.lower), np.asarray(task.problem.upper)
        judged = JUDGED * np.median(spread, axis=0) < np.minimum(values - lower, upper - values)
        level = np.concatenate([np.log(np.asarray(task.problem.process_reference) / setting.q),
                                np.log(np.asarray(task.problem.sensor_reference)[: len(setting.r)] / setting.r)])  # fmt: skip
        noises = slice(n, n + len(level))
        row = {
            "setting": setting.name,
            "fits": fits,
            "seed": seed,
            "parameters": list(task.names),
            "judged": judged.tolist(),
            "prediction_error": {
                "converged": float(np.mean(np.asarray(found.converged))),
                **_figures(off, spread, judged),
                "noises": _figures(x[:, noises] + level, errors[:, noises], np.ones(len(level), dtype=bool)),
            },
        }
        if setting.simulated:
            row |= _output_error(robot, logs, own["outputs"], factors, values, judged)
    return {**row, "processor_seconds": time.process_time() - begin}


def _output_error(robot, logs, outputs, factors, values, judged) -> dict:
    """The same realisations by output error: standard errors for white residuals, and robust ones of some of the fits."""
    structure, problem, at = build_simulation(robot, logs, start={}, initial="known")
    N, outputs = len(outputs), outputs[..., : problem.outputs.shape[-1]]
    z = jax.vmap(problem.bounds.coordinates)(problem.held * jnp.asarray(factors))
    own = {"outputs": outputs, "sigma": jnp.broadcast_to(problem.sigma, (N, len(problem.sigma)))}
    starts = Coordinates(z, jnp.zeros((N, *at.states.shape)))
    found = fit_lanes(structure, problem, own, starts, lanes=min(64, N))
    coordinates = found.optimum.unknowns.z
    off = np.asarray(jax.vmap(problem.bounds.physical)(coordinates)) - values
    slope = np.asarray(jax.vmap(problem.bounds.slope)(coordinates))
    jacobian = np.asarray(found.optimum.triangle.shared) / slope[:, None, :]
    covariance = np.linalg.pinv(np.einsum("kij,kil->kjl", jacobian, jacobian))
    white = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    robust = []
    for k in range(min(_ROBUST, N)):
        mine = replace(problem, outputs=outputs[k], sigma=found.sigma[k])
        spread = robust_covariance(structure, mine, Coordinates(coordinates[k], starts.states[k])).covariance
        robust.append(np.sqrt(np.diag(spread)))
    return {
        "output_error": _figures(off, white, judged),
        "output_error_robust": _figures(off[: len(robust)], np.array(robust), judged),
    }


def main() -> None:
    """Run all settings, or those whose name holds a word, and write the figures."""
    parser = argparse.ArgumentParser(description="Coverage with process and sensor noise.")
    parser.add_argument("--fits", type=int, default=300)
    parser.add_argument("--seed", type=int, default=2611, help="of the noises")
    parser.add_argument("--only", default="", help="settings whose name holds this; the others stay as they are")
    arguments = parser.parse_args()
    rows = {row["setting"]: row for row in json.loads(RESULTS.read_text())["rows"]} if RESULTS.exists() else {}
    for setting in SETTINGS:
        if arguments.only not in setting.name:
            continue
        row = rows[setting.name] = study(setting, arguments.fits, arguments.seed)
        for method in ("prediction_error", "output_error", "output_error_robust"):
            if method in row:
                cover = row[method]["coverage"]
                print(f"{setting.name}: {method} covers {cover['lowest']:.3f} to {cover['highest']:.3f}", flush=True)
        noises = row["prediction_error"]["noises"]["coverage"]["each"]
        print(f"  noises {noises}, {row['processor_seconds']:.0f} processor seconds", flush=True)
        kept = [rows[s.name] for s in SETTINGS if s.name in rows]
        RESULTS.write_text(json.dumps({"rows": kept}, indent=1) + "\n", encoding="utf-8")
        write_page(kept, PAGE, [s.name for s in SETTINGS if s.name not in rows])


if __name__ == "__main__":
    main()
