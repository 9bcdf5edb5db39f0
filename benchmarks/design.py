"""Designed experiments against a PRBS of the same energy and length: `python -m benchmarks.design [--only ROBOT ...]`.

For each robot an experiment of 20 s at 50 Hz is designed within limits on voltage, speed and floor space. The rival is what
an engineer would take: a PRBS on every input, all different, whose clock is the robot's rise time (63 % of a step), from rest,
scaled to the design's energy (integral of the squared inputs); speed and floor space are not asked of it. Both are then
driven by the independent simulator in `reference/`, measured with fresh noise many times, and fitted by output error.

Writes `benchmarks/results/design.json` (robots one by one), `docs/design.md` and its picture; `--report` writes the page again.
"""

import argparse
import datetime
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

import jaxid
from benchmarks.design_page import write_page
from jaxid.design.design import design_experiment
from jaxid.design.information import Laboratory, std_errors
from jaxid.design.limits import make_limits, used
from jaxid.simulation.excitation import binary, shifted
from reference.axis import AXIS
from reference.logs import simulate
from reference.omni import OMNI
from reference.pioneer import PIONEER

RESULTS = Path(__file__).parent / "results" / "design.json"
SECONDS, INTERVAL, SEED = 20.0, 0.02, 0
CLOCKS = (0.5, 1.0, 2.0, 4.0, 8.0)

ROBOTS: dict[str, dict[str, Any]] = {
    "axis": {
        "robot": jaxid.Axis().with_values(M=1.0, Fv=2.0, Fc=0.5, offset=0.1),
        "truth": AXIS.with_parameters(offset=-0.1),  # the reference's offset pushes, jaxid's resists
        "limit": 4.0, "noise": {"v": 0.01}, "speeds": {}, "rectangle": None, "radius": 2.0, "rounds": 100,
    },
    "omni": {
        "robot": jaxid.Omni(), "truth": OMNI, "limit": 8.0, "noise": {"V": 0.01, "Vn": 0.01, "W": 0.02},
        "speeds": {"V": 1.0, "Vn": 1.0}, "rectangle": (4.0, 4.0), "radius": None, "rounds": 120,
    },
    "pioneer": {
        "robot": jaxid.Pioneer(), "truth": PIONEER, "limit": 8.0, "noise": {"eta1": 0.01, "eta2": 0.02},
        "speeds": {"eta1": 1.0}, "rectangle": (4.0, 4.0), "radius": None, "rounds": 150,
    },
}  # fmt: skip


def fitted(case: dict[str, Any], inputs: np.ndarray, realisations: int) -> dict[str, Any]:
    """Fits to the reference simulator's response with fresh noise: mean, spread and reported errors by parameter."""
    robot, sigma = case["robot"], np.array(list(case["noise"].values()))
    run = simulate(case["truth"], inputs, INTERVAL)
    found, errors = [], []
    for number in range(realisations):
        noise = np.random.default_rng([SEED, 11, number]).standard_normal(run.speeds.shape) * sigma
        log = jaxid.Log.from_arrays("run", run.t, inputs, run.speeds + noise, robot.channels)
        fit = jaxid.output_error(robot, jaxid.LogSet([log]))
        found.append([fit[name].value for name in fit.free_names])
        errors.append([fit[name].std_error for name in fit.free_names])
    limits = make_limits(robot, case["limit"], case["speeds"], case["rectangle"], case["radius"])
    outputs = np.zeros((len(run.t), len(robot.channels.measured)))
    outputs[:, : run.speeds.shape[1]] = run.speeds
    shares = used(limits, robot, outputs, INTERVAL)
    return {
        "mean": np.mean(found, axis=0).tolist(),
        "spread": np.std(found, axis=0, ddof=1).tolist(),
        "reported": np.median(errors, axis=0).tolist(),
        "limits_used": {name: float(share) for name, share in shares.items()},
    }


def rivals(laboratory: Laboratory, energy: float, clock: float, limit: float) -> dict[str, Any]:
    """Expected errors with other PRBSs: other clocks at the same energy, and the same clock at the amplitude limit."""
    count, samples = len(laboratory.robot.channels.inputs), len(laboratory.time)

    def errors(inputs: np.ndarray, which: int = 0) -> list[float]:
        return (std_errors(laboratory.run(inputs[None], which).information[0]) * laboratory.magnitude).tolist()

    def scaled(period: float) -> np.ndarray:
        inputs = shifted(binary(samples * INTERVAL, INTERVAL, period), count)
        return inputs * np.sqrt(energy / (np.sum(inputs**2) * INTERVAL))

    clocks = {f"{factor * clock:.3g}": errors(scaled(factor * clock)) for factor in CLOCKS}
    full = limit * shifted(binary(samples * INTERVAL, INTERVAL, clock), count)
    return {"clocks": clocks, "at_limit": errors(full), "energy_at_limit": float(np.sum(full**2) * INTERVAL)}


def study(name: str, realisations: int) -> dict[str, Any]:
    """One robot: design, predicted errors, and Monte Carlo."""
    case = ROBOTS[name]
    begin = time.process_time()
    design = design_experiment(
        case["robot"], limit=case["limit"], seconds=SECONDS, interval=INTERVAL, noise=case["noise"], speeds=case["speeds"],
        rectangle=case["rectangle"], radius=case["radius"], rounds=case["rounds"], seed=SEED, report=print,
    )  # fmt: skip
    seconds = time.process_time() - begin
    print(design, flush=True)
    run, prbs = design.runs[0], design.reference_runs[0]
    laboratory = Laboratory(case["robot"], case["noise"], len(run.time), INTERVAL, 0.1, SEED)
    off = []
    for which in (1, 2):
        pair = laboratory.run(np.stack([run.inputs, prbs.inputs]), which).information
        off.append((std_errors(pair[0]) / std_errors(pair[1])).tolist())
    clock = float(design.reference.split("clock of ")[1].split()[0])
    begin = time.process_time()
    monte_carlo = {
        "design": fitted(case, run.inputs, realisations),
        "prbs": fitted(case, prbs.inputs, realisations),
    }
    return {
        "settings": {k: case[k] for k in ("limit", "noise", "speeds", "rectangle", "radius", "rounds")},
        "seconds": SECONDS, "interval": INTERVAL, "seed": SEED, "realisations": realisations,
        "run": datetime.date.today().isoformat(),
        "processor_seconds": {"design": seconds, "fits": time.process_time() - begin}, "tried": design.tried,
        "description": run.description, "limited_by": list(run.limited_by), "reference": design.reference, "clock": clock,
        "energy": {"design": run.energy, "prbs": prbs.energy}, "values": design.values, "units": design.units,
        "expected": {"design": list(design.std_errors.values()), "prbs": list(design.reference_std_errors.values())},
        "ratios_with_parameters_off": off, "rivals": rivals(laboratory, run.energy, clock, case["limit"]),
        "monte_carlo": monte_carlo, "input_names": list(run.channels.inputs),
        "inputs": {"design": run.inputs.round(3).tolist(), "prbs": prbs.inputs.round(3).tolist()},
    }  # fmt: skip


def main() -> None:
    """Study the robots asked for and write the page."""
    parser = argparse.ArgumentParser(description="Interval widths of designed experiments against a PRBS.")
    parser.add_argument("--only", nargs="+", choices=list(ROBOTS), default=list(ROBOTS))
    parser.add_argument("--realisations", type=int, default=24)
    parser.add_argument("--report", action="store_true", help="write the page from what was measured before")
    arguments = parser.parse_args()
    results = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.exists() else {}
    for name in [] if arguments.report else arguments.only:
        results[name] = study(name, arguments.realisations)
        RESULTS.write_text(json.dumps(results) + "\n", encoding="utf-8")
    write_page({name: results[name] for name in ROBOTS if name in results})


if __name__ == "__main__":
    main()
