"""How often output error reaches the best optimum from starts 35 % off: `python -m benchmarks.starts [--starts 20]`.

The Pioneer's hard case: logs of reversing PRBS whose casters start at unknown angles, all initial states estimated. Every
free parameter of a start is off by up to 35 %, either way. A start counts as having arrived if its cost (half chi-squared)
is within 0.5 of the best found by any. Writes `benchmarks/results/starts.json`.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

import jaxid
from reference import excitation
from reference.logs import simulate_log
from reference.pioneer import PIONEER, STATES

RESULTS = Path(__file__).parent / "results" / "starts.json"
NOISE, SAMPLING, SAMPLES, OFF, SAME = (0.01, 0.02), 0.02, 500, 0.35, 0.5


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


def cost(fit: jaxid.Fit, data: jaxid.LogSet) -> float:
    """Half chi-squared at the true noise, initial states as estimated."""
    states = {n: np.array([fit.initial_states[log.name][n] for log in data]) for n in fit.robot.states}
    simulated = jaxid.simulate(fit.robot, data, start=states)
    squares = sum(
        float(np.sum(((y[:, :2] - log.outputs[:, :2]) / NOISE) ** 2)) for y, log in zip(simulated, data, strict=True)
    )
    return 0.5 * squares


def main() -> None:
    """Fit from every start and count."""
    parser = argparse.ArgumentParser(description="Share of starts that reach the best optimum.")
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    data, robot = logs(arguments.seed), jaxid.Pioneer()
    rng = np.random.default_rng([arguments.seed, 36])
    rows = []
    for number in range(arguments.starts):
        start = {n: robot.parameters[n].value * float(1 + rng.uniform(-OFF, OFF)) for n in robot.parameters.free_names}
        begin = time.perf_counter()
        fit = jaxid.output_error(robot, data, start=start, initial_states="estimate")
        rows.append({"cost": cost(fit, data), "iterations": fit.iterations, "seconds": time.perf_counter() - begin})
        print(f"start {number + 1} of {arguments.starts}: cost {rows[-1]['cost']:.2f}", flush=True)
    best = min(row["cost"] for row in rows)
    arrived = sum(row["cost"] < best + SAME for row in rows)
    print(f"{arrived} of {len(rows)} starts within {SAME} of the best cost {best:.2f}")
    result = {"seed": arguments.seed, "off": OFF, "arrived": arrived, "starts": len(rows), "best": best, "rows": rows}
    RESULTS.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
