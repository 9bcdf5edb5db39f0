"""Fleets: fits per processor second of `fit_fleet`, of `output_error` in a loop, and of the minimisations alone.

    PJRT_NPROC=1 python -m benchmarks.fleet [--members 64]

Every member has parameters of its own (10 % off), two runs of 250 samples at 50 Hz with changing levels of its inputs,
simulated by the independent simulator in `reference/`, and white noise. Everything is done twice; the first time there is
something to compile. "Minimisations alone" is what output error shares with other programs: one minimisation a member, from
the nominal parameters. Results go to `benchmarks/results/fleet.json`.
"""

import argparse
import json
import platform
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np

import jaxid
from jaxid.estimate.output_error.fleet import fit_lanes
from jaxid.estimate.output_error.setup import build
from reference.axis import AXIS
from reference.excitation import experiment
from reference.logs import simulate_log
from reference.omni import OMNI
from reference.pioneer import PIONEER

RESULTS = Path(__file__).parent / "results" / "fleet.json"
SAMPLES, SAMPLING, RUNS, SPREAD = 250, 0.02, 2, 0.1
ROBOTS = {
    "axis": (jaxid.Axis, AXIS, (0.01,)),
    "omni": (jaxid.Omni, OMNI, (0.01, 0.01, 0.02)),
    "pioneer": (jaxid.Pioneer, PIONEER, (0.01, 0.02)),
}


def members(name: str, count: int) -> tuple[jaxid.Robot, dict[str, jaxid.LogSet]]:
    """The nominal robot, and the logs of `count` robots that differ from it."""
    make, simulated, noise = ROBOTS[name]
    rng = np.random.default_rng(17)
    robot = make()
    robot = robot.with_values(**{k: float(v) for k, v in simulated.parameters.items() if k in robot.parameters})
    fleet = {}
    for m in range(count):
        factors = {k: float(np.exp(SPREAD * rng.normal())) for k in robot.parameters.free_names}
        own = simulated.with_parameters(
            **{k: simulated.parameters[k] * f for k, f in factors.items() if k in simulated.parameters}
        )
        logs = []
        for run in range(RUNS):
            inputs = experiment(name, "multilevel", SAMPLES, 100 * m + run)
            table = simulate_log(own, inputs, SAMPLING, noise, 1000 * m + run)
            outputs = {c: table[c].to_numpy() for c in robot.channels.outputs}
            logs.append(jaxid.Log.from_arrays(f"run {run}", table["t"].to_numpy(), inputs, outputs, robot))
        fleet[f"robot {m}"] = jaxid.LogSet(logs)
    return robot, fleet


def stacked(robot: jaxid.Robot, fleet: dict[str, jaxid.LogSet]):
    """The members' minimisations: what they share, what is their own, and their starts."""
    import jax

    built = [build(robot, logs, start={}, initial="known", integrator=jaxid.Integrator(4)) for logs in fleet.values()]
    structure, shared, _ = built[0]
    own = {
        name: np.stack([np.asarray(getattr(problem, name)) for _, problem, _ in built])
        for name in ("inputs", "outputs", "sigma")
    }
    starts = jax.tree.map(lambda *leaves: np.stack(leaves), *(start for _, _, start in built))
    return structure, shared, own, starts


def timed(function) -> tuple[list[float], object]:
    """Processor seconds of two calls, and what the second returned."""
    seconds, found = [], None
    for _ in range(2):
        begun = time.process_time()
        found = function()
        seconds.append(time.process_time() - begun)
    return seconds, found


def row(name: str, count: int) -> dict:
    """One robot's figures."""
    robot, fleet = members(name, count)
    together, found = timed(lambda: jaxid.fit_fleet(robot, fleet))
    alone, singles = timed(lambda: {k: jaxid.output_error(robot, logs) for k, logs in fleet.items()})
    with jaxid.float64():
        problem = stacked(robot, fleet)
        minimised, _ = timed(lambda: fit_lanes(*problem, rounds=1))
    apart = [
        abs(fit[k].value - singles[member][k].value) / fit[k].std_error
        for member, fit in found.fits.items()
        for k in fit.free_names
        if np.isfinite(fit[k].std_error) and fit[k].std_error > 0
    ]
    return {
        "robot": name,
        "members": count,
        "unknowns": len(robot.parameters.free_names),
        "fleet_s": together,
        "loop_s": alone,
        "minimisations_s": minimised,
        "fits_per_s": count / together[1],
        "fits_per_s_in_a_loop": count / alone[1],
        "minimisations_per_s": count / minimised[1],
        "failed": len(found.failed),
        "largest_difference_in_standard_errors": float(max(apart)),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--members", type=int, default=64)
    parser.add_argument("--only", nargs="+", choices=list(ROBOTS), default=list(ROBOTS))
    arguments = parser.parse_args()
    rows = []
    for name in arguments.only:
        rows.append(row(name, arguments.members))
        print(json.dumps(rows[-1]), flush=True)
    document = {
        "machine": platform.processor() or platform.machine(),
        "versions": {package: version(package) for package in ("jax", "numpy", "llvmlite")},
        "rows": rows,
    }
    if list(arguments.only) == list(ROBOTS):
        RESULTS.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
