"""How often output error reaches the best optimum from wrong starts: `python -m benchmarks.starts [--starts 20] [--far]`.

The Pioneer's hard case: logs of reversing PRBS whose casters start at unknown angles, all initial states estimated. Every
free parameter of a start is off by up to 35 %, either way. A start counts as having arrived if its cost (half chi-squared)
is within 0.5 of the best found by any; how far its estimates are from the best's is told, too. Writes
`benchmarks/results/starts.json`.

`--far`: every free parameter of the model (not just of the start) times or divided by up to 10, on logs of the axis, the
omni and the Pioneer that start at rest. Writes `benchmarks/results/starts_far.json`.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

import jaxid
from jaxid.simulation.rollout import Integrator
from jaxid.simulation.simulate import integrator_for
from reference import excitation
from reference.axis import AXIS
from reference.logs import simulate_log
from reference.omni import OMNI
from reference.pioneer import PIONEER, STATES

RESULTS = Path(__file__).parent / "results" / "starts.json"
FAR_RESULTS, FAR = RESULTS.with_name("starts_far.json"), 10.0
NOISE, SAMPLING, SAMPLES, OFF, SAME = (0.01, 0.02), 0.02, 500, 0.35, 0.5

KINDS_OF_ROBOT = {
    "axis": (jaxid.Axis(), AXIS, (0.01,)),
    "omni": (jaxid.Omni(), OMNI, (0.01, 0.01, 0.02)),
    "pioneer": (jaxid.Pioneer(), PIONEER, NOISE),
}
"""Model, independent simulator and noise."""


def logs(seed: int) -> jaxid.LogSet:
    """Six reversing logs of 10 s; casters within half a radian of trailing, and nobody knows where."""
    rng = np.random.default_rng([seed, 35])
    found = []
    for number in range(6):
        common = excitation.prbs(SAMPLES, 25, -6.0, 6.0, rng)
        turn = excitation.prbs(SAMPLES, 17, -1.5, 1.5, rng)
        inputs = excitation.wheels(common, turn)
        start = {STATES.index("beta"): float(rng.uniform(-0.5, 0.5))}
        table = simulate_log(PIONEER, inputs, SAMPLING, NOISE, 100 * seed + number, start=start)
        outputs = table[["eta1", "eta2"]].to_numpy()
        found.append(
            jaxid.Log.from_arrays(f"reversing {number}", table["t"].to_numpy(), inputs, outputs, jaxid.PIONEER)
        )
    return jaxid.LogSet(found)


def cost(fit: jaxid.Fit, start: jaxid.Robot, data: jaxid.LogSet, noise: tuple[float, ...] = NOISE) -> float:
    """Half chi-squared at the true noise, initial states as estimated, with the integration steps that the fit ended with:
    it begins with those that suit the robot given, shortens them where that would move the estimates noticeably, and fits
    best with its own."""
    states = {n: np.array([fit.initial_states[log.name][n] for log in data]) for n in fit.robot.states}
    usual, found = integrator_for(start, data), []
    for shorter in (1, 4, 16):
        integrator = Integrator(usual.substeps * shorter, usual.friction)
        simulated = jaxid.simulate(fit.robot, data, start=states, integrator=integrator)
        errors = [(y - log.outputs)[:, : len(noise)] / noise for y, log in zip(simulated, data, strict=True)]
        found.append(sum(float(np.nansum(each**2)) for each in errors))
    return 0.5 * min(found)


def apart(fit: jaxid.Fit, best: jaxid.Fit) -> float:
    """How far two estimates are from each other, all parameters together, in standard errors."""
    off = np.array([fit[name].value - best[name].value for name in best.free_names])
    return float(np.sqrt(off @ np.linalg.solve(best.covariance, off)))


def logs_from_rest(robot: str) -> jaxid.LogSet:
    """Logs of 10 s by the independent simulator: nothing is known but the inputs and the noisy speeds."""
    model, simulated, noise = KINDS_OF_ROBOT[robot]
    channels, found = model.channels, []
    for number, kind in enumerate(("multilevel", "turning", "crawl")[: 3 if len(channels.inputs) > 1 else 1]):
        inputs = excitation.experiment(robot, kind, SAMPLES, seed=3 + number)
        table = simulate_log(simulated, inputs, SAMPLING, noise, 50 + number)
        outputs = table[list(channels.outputs)].to_numpy()
        found.append(jaxid.Log.from_arrays(kind, table["t"].to_numpy(), inputs, outputs, channels))
    return jaxid.LogSet(found)


def far(count: int, seed: int) -> None:
    """Models whose every free parameter is off by up to a factor of ten."""
    rows = []
    for robot, (model, _, noise) in KINDS_OF_ROBOT.items():
        data = logs_from_rest(robot)
        rng = np.random.default_rng([seed, 37])
        costs, rescued = [], 0
        for number in range(count):
            names = model.parameters.free_names
            off = {n: model.parameters[n].value * float(FAR ** rng.uniform(-1, 1)) for n in names}
            given, said = model.with_values(**off), []
            try:
                fit = jaxid.output_error(given, data, report=said.append)
                costs.append(cost(fit, given, data, noise))
            except jaxid.ParameterError as error:
                print(error)
                costs.append(float("inf"))
            rescued += any("poor minimum" in sentence for sentence in said)
            print(f"{robot}: model {number + 1} of {count}: cost {costs[-1]:.2f}", flush=True)
        arrived = sum(value < min(costs) + SAME for value in costs)
        print(f"{robot}: {arrived} of {count} reach the best optimum, {rescued} of them from integral least squares")
        rows.append(
            {"robot": robot, "models": count, "arrived": arrived, "from_least_squares": rescued, "costs": costs}
        )
        FAR_RESULTS.write_text(json.dumps({"factor": FAR, "rows": rows}, indent=1) + "\n", encoding="utf-8")


def main() -> None:
    """Fit from every start and count."""
    parser = argparse.ArgumentParser(description="Share of starts that reach the best optimum.")
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--far", action="store_true", help="models off by factors of up to ten")
    arguments = parser.parse_args()
    if arguments.far:
        far(arguments.starts, arguments.seed)
        return
    data, robot = logs(arguments.seed), jaxid.Pioneer()
    rng = np.random.default_rng([arguments.seed, 36])
    rows, fits = [], []
    for number in range(arguments.starts):
        start = {n: robot.parameters[n].value * float(1 + rng.uniform(-OFF, OFF)) for n in robot.parameters.free_names}
        begin = time.perf_counter()
        fit = jaxid.output_error(robot, data, start=start, initial_states="estimate")
        rows.append(
            {"cost": cost(fit, robot, data), "iterations": fit.iterations, "seconds": time.perf_counter() - begin}
        )
        fits.append(fit)
        print(f"start {number + 1} of {arguments.starts}: cost {rows[-1]['cost']:.2f}", flush=True)
    best = min(row["cost"] for row in rows)
    arrived = sum(row["cost"] < best + SAME for row in rows)
    at = fits[int(np.argmin([row["cost"] for row in rows]))]
    for row, fit in zip(rows, fits, strict=True):
        row["standard_errors_from_best"] = apart(fit, at)
    farthest = max(row["standard_errors_from_best"] for row in rows)
    print(f"{arrived} of {len(rows)} starts within {SAME} of the best cost {best:.2f}")
    print(f"farthest estimate: {farthest:.2g} standard errors from the best's")
    result = {"seed": arguments.seed, "off": OFF, "arrived": arrived, "starts": len(rows), "best": best, "rows": rows}
    RESULTS.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
