"""Which method when? Every estimator on the same noisy logs: `python -m benchmarks.methods [--only axis --fits 60]`.

The simulators of `benchmarks.prediction_error` (Euler-Maruyama in NumPy, nothing of jaxid in them) move robots under
four kinds of noise; every realisation is fitted by integral least squares, instrumental variables, output error (as a
fleet, with all that a result says) and prediction error (as lanes; robust standard errors where tests reject its
innovations, as `prediction_error` does). Writes `benchmarks/results/methods.json` and docs/methods.md.
"""

import argparse
import datetime
import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import jax.numpy as jnp
import numpy as np

import jaxid
from jaxid.estimate.prediction_error.likelihood import flat
from jaxid.estimate.prediction_error.scoring import minimise_lanes
from jaxid.estimate.prediction_error.setup import build
from jaxid.estimate.prediction_error.uncertainties import doubts, sandwich, whitened

from .methods_page import write_page
from .prediction_error import _OMNI, _USUAL, DT, _axis, axis, covariances, omni

RESULTS = Path(__file__).parent / "results" / "methods.json"
PAGE = Path(__file__).parents[1] / "docs" / "methods.md"
CODE = hashlib.sha256(
    b"".join(file.read_bytes() for file in sorted((Path(jaxid.__file__).parent / "estimate").rglob("*.py")))
).hexdigest()[:12]
"""Fingerprint of the estimators, by which the page tells cells that were run with other code."""
JUDGED = 4.0
"""Standard errors that a parameter must be away from its bounds."""


@dataclass(frozen=True)
class Noise:
    """Sensor noise in units of the usual, its AR(1) coefficient, and process noise in units of the usual."""

    name: str
    sensor: float = 1.0
    colour: float = 0.0
    process: float = 0.0


@dataclass(frozen=True)
class Machine:
    """A robot, its simulator, its usual sensor and process noise, and the inputs of its runs."""

    name: str
    robot: Callable[[], jaxid.Robot]
    simulator: Callable
    sensor: tuple[float, ...]
    process: tuple[float, ...]
    inputs: tuple[np.ndarray, ...]


NOISES = (
    Noise("sensors, white"),
    Noise("sensors, white, five times as large", sensor=5.0),
    Noise("sensors, AR(1) 0.9", colour=0.9),
    Noise("sensors, white, and disturbed motion", process=1.0),
)
MACHINES = (
    Machine("axis", _axis, axis, (0.01,), (0.1,), _USUAL),
    Machine("omni", jaxid.Omni, omni, (0.01, 0.01, 0.02), (0.05, 0.05, 0.1), _OMNI),
)


def measured(machine: Machine, noise: Noise, fits: int, true) -> list[np.ndarray]:
    """What the sensors show in every run [fits, T, ny]."""
    random, sigma = np.random.default_rng(23), noise.sensor * np.array(machine.sensor)
    q, nothing = noise.process * np.array(machine.process), np.zeros(len(machine.sensor))
    found = []
    for u in machine.inputs:
        y, _ = machine.simulator(u, fits, q, nothing, random, true)
        wave = random.normal(size=y.shape)
        for t in range(1, y.shape[1]):
            wave[:, t] = noise.colour * wave[:, t - 1] + np.sqrt(1 - noise.colour**2) * wave[:, t]
        found.append(y + sigma * wave)
    return found


def log_sets(machine: Machine, robot: jaxid.Robot, runs: list[np.ndarray]) -> dict[str, jaxid.LogSet]:
    """The logs of every realisation."""
    names = robot.channels.outputs
    return {
        f"{k}": jaxid.LogSet(
            jaxid.Log.from_arrays(f"{e}", DT * np.arange(len(u)), u, dict(zip(names, y[k].T, strict=True)), robot)
            for e, (u, y) in enumerate(zip(machine.inputs, runs, strict=True))
        )
        for k in range(len(runs[0]))
    }


def by_prediction_error(robot: jaxid.Robot, sets: dict[str, jaxid.LogSet]) -> tuple[np.ndarray, np.ndarray]:
    """Estimates and standard errors [N, n]."""
    with jaxid.float64():
        tasks = [build(robot, logs, start={}, initial="known") for logs in sets.values()]
        task, n = tasks[0], len(tasks[0].names)
        outputs = jnp.stack([own.problem.records.outputs for own in tasks])
        starts = jnp.repeat(flat(task.start)[None], len(tasks), axis=0)
        lanes = min(32, len(tasks))
        found = minimise_lanes(task.names, task.model, task.problem, {"outputs": outputs}, starts, lanes=lanes)
        scale, errors = np.asarray(task.problem.scale), []
        spreads = covariances(task, {"outputs": outputs}, found, lanes)
        for k, logs in enumerate(sets.values()):
            problem = replace(task.problem, records=task.problem.records._replace(outputs=outputs[k]))
            white = whitened(task.names, task.model, problem, found.x[k])
            information = np.asarray(found.look.information[k])
            doubted = doubts(white, problem, logs[0].channels.measured)
            spread = sandwich(white, problem, information, spreads[k]) if doubted else spreads[k]
            errors.append(np.sqrt(np.diag(spread)[:n]))
        return np.asarray(found.x)[:, :n] * scale, np.array(errors) * scale


def _numbers(fits: list[jaxid.Fit]) -> tuple[np.ndarray, np.ndarray]:
    names = fits[0].free_names
    values, errors = (
        np.array([[getattr(fit[n], what) for n in names] for fit in fits]) for what in ("value", "std_error")
    )
    return values, errors


def _said(fits: list[jaxid.Fit]) -> dict[str, float]:
    """Shares of the results that are not called sound, and that name a better estimator."""
    verdicts = [fit.judgement for fit in fits if fit.judgement is not None]
    return {
        "biased": float(np.mean([bool(judgement.biased) for judgement in verdicts])),
        "not_sound": float(np.mean([judgement.verdict != "sound" for judgement in verdicts])),
        "name_prediction_error": float(np.mean(["prediction error" in j.better for j in verdicts])),
        "name_instruments_or_output_error": float(np.mean(["nstrumental variables" in j.better for j in verdicts])),
    }


def study(machine: Machine, noise: Noise, fits: int) -> dict:
    """One row."""
    begin, robot = time.process_time(), machine.robot()
    true = robot.parameters.numbers
    sets = log_sets(machine, robot, measured(machine, noise, fits, true))
    least_squares = [jaxid.integral_least_squares(robot, logs) for logs in sets.values()]
    instruments = [
        jaxid.instrumental_variables(robot, logs, start)
        for logs, start in zip(sets.values(), least_squares, strict=True)
    ]
    fleet = jaxid.fit_fleet(robot, sets, windows=None)
    results = {
        "integral_least_squares": least_squares,
        "instrumental_variables": instruments,
        "output_error": list(fleet.fits.values()),
    }
    numbers = {method: _numbers(own) for method, own in results.items()}
    numbers["prediction_error"] = by_prediction_error(robot, sets)
    names = list(least_squares[0].free_names)
    values = np.array([true[name] for name in names])
    table = [robot.parameters[name] for name in names]
    room = np.array([min(p.value - p.lower, p.upper - p.value) for p in table])
    judged = JUDGED * numbers["output_error"][0].std(axis=0) < room
    errors = {method: np.sqrt(np.mean((theta - values) ** 2, axis=0)) for method, (theta, _) in numbers.items()}
    least = np.min(list(errors.values()), axis=0)
    row = {"robot": machine.name, "noise": noise.name, "fits": fits, "parameters": names, "judged": judged.tolist()}
    row["methods"] = {}
    for method, (theta, reported) in numbers.items():
        off = theta - values
        there = np.isfinite(reported)
        cover = np.sum(there & (np.abs(off) <= 1.959964 * reported), axis=0) / np.maximum(there.sum(axis=0), 1)
        row["methods"][method] = {
            "bias": (off.mean(axis=0) / off.std(axis=0, ddof=1)).tolist(),
            "error_over_least": (errors[method] / least).tolist(),
            "coverage": cover.tolist(),
            **(_said(results[method]) if method in results else {}),
        }
    return {
        **row,
        "code": CODE,
        "run": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "processor_seconds": time.process_time() - begin,
    }


def main() -> None:
    """Run all cells, or those whose robot or noise holds a word, and write figures and page."""
    parser = argparse.ArgumentParser(description="Every estimator under every noise.")
    parser.add_argument("--fits", type=int, default=60)
    parser.add_argument("--only", default="", help="cells whose name holds this; the others stay as they are")
    arguments = parser.parse_args()
    cells = [(machine, noise) for machine in MACHINES for noise in NOISES]
    rows = {(r["robot"], r["noise"]): r for r in json.loads(RESULTS.read_text())["rows"]} if RESULTS.exists() else {}
    for machine, noise in cells:
        if arguments.only not in f"{machine.name}: {noise.name}":
            continue
        row = rows[machine.name, noise.name] = study(machine, noise, arguments.fits)
        print(f"{machine.name}: {noise.name}, {row['processor_seconds']:.0f} processor seconds", flush=True)
        for method, found in row["methods"].items():
            cover = np.array(found["coverage"])[row["judged"]]
            worst = np.abs(np.array(found["bias"]))[row["judged"]].max()
            print(f"  {method}: bias {worst:.2f}, covers {cover.min():.2f} to {cover.max():.2f}", flush=True)
        kept = [rows[m.name, n.name] for m, n in cells if (m.name, n.name) in rows]
        RESULTS.write_text(json.dumps({"rows": kept}, indent=1) + "\n", encoding="utf-8")
    write_page(
        [rows[m.name, n.name] for m, n in cells if (m.name, n.name) in rows],
        PAGE,
        [f"{m.name}, {n.name}" for m, n in cells if (m.name, n.name) not in rows],
    )


if __name__ == "__main__":
    main()
