"""Long logs: processor time a sample and memory, of both methods, for a log of an hour beside one of twenty seconds.

    PJRT_NPROC=1 python -m benchmarks.long_log

A Pioneer at 100 Hz from the independent simulator in `reference/`, noise 0.01 m/s and 0.02 rad/s. The logs are
written to files first; every row is a process of its own, which reads one, and each fit is done twice in it: the first has
everything to compile. Results go to `benchmarks/results/long_log.json`.
"""

import argparse
import json
import platform
import resource
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np

RESULTS = Path(__file__).parent / "results" / "long_log.json"
SECONDS = (20, 3600)
RATE, NOISE = 100, (0.01, 0.02)


def write(seconds: int, file: Path) -> None:
    """A log of that length."""
    from reference.excitation import experiment
    from reference.logs import simulate_log
    from reference.pioneer import PIONEER

    samples, piece = seconds * RATE, 20 * RATE
    # One kind of excitation after the other.
    kinds = ("multilevel", "prbs_reversing", "turning", "steps")
    parts = [experiment("pioneer", kinds[k % len(kinds)], piece, k) for k in range(-(-samples // piece))]
    simulate_log(PIONEER, np.concatenate(parts)[:samples], 1.0 / RATE, NOISE).to_parquet(file)


def one(method: str, seconds: int, file: Path) -> dict[str, float]:
    """One row: fit a log of that length twice."""
    import pandas as pd

    import jaxid
    from reference.pioneer import PIONEER

    robot, frame = jaxid.Pioneer(), pd.read_parquet(file)
    inputs, outputs = (frame[list(own)].to_numpy() for own in (robot.channels.inputs, robot.channels.outputs))
    logs = jaxid.LogSet([jaxid.Log.from_arrays("run", frame["t"], inputs, outputs, robot)])
    samples = len(frame)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    times = []
    for _ in range(2):
        begun = time.process_time()
        if method == "integral_least_squares":
            fit = jaxid.integral_least_squares(robot, logs)
        else:
            fit = jaxid.output_error(robot, logs)
        times.append(time.process_time() - begun)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    errors = [(fit[name].value - value) / fit[name].std_error for name, value in truth(fit, PIONEER).items()]
    return {
        "method": method,
        "seconds": seconds,
        "samples": samples,
        "first_s": times[0],
        "again_s": times[1],
        "again_us_a_sample": times[1] / samples * 1e6,
        "peak_mib": most / 1024,
        "of_these_before_the_fit_mib": before / 1024,
        "largest_error_in_standard_errors": float(np.max(np.abs(errors))),
        "verdict": fit.judgement.verdict if fit.judgement else "",
    }


def truth(fit, simulated) -> dict[str, float]:
    """True values of what the fit calls identified."""
    names = [name for name in fit.free_names if fit[name].status == "identified" and name in simulated.parameters]
    return {name: simulated.parameters[name] for name in names}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", nargs=2, metavar=("SECONDS", "FILE"), help=argparse.SUPPRESS)
    parser.add_argument("--one", nargs=3, metavar=("METHOD", "SECONDS", "FILE"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.write:
        return write(int(arguments.write[0]), Path(arguments.write[1]))
    if arguments.one:
        method, seconds, file = arguments.one
        return print(json.dumps(one(method, int(seconds), Path(file))))
    rows, again = [], [sys.executable, "-m", "benchmarks.long_log"]
    with tempfile.TemporaryDirectory() as folder:
        files = {seconds: str(Path(folder) / f"{seconds}.parquet") for seconds in SECONDS}
        for seconds, file in files.items():
            subprocess.run([*again, "--write", str(seconds), file], check=True)
        for method in ("integral_least_squares", "output_error"):
            for seconds, file in files.items():
                command = [*again, "--one", method, str(seconds), file]
                said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
                rows.append(json.loads(said.splitlines()[-1]))
                print(rows[-1], flush=True)
    versions = {name: version(name) for name in ("jax", "jaxlib", "numpy", "llvmlite")}
    document = {"command": "python -m benchmarks.long_log", "machine": platform.processor() or platform.machine()}
    RESULTS.write_text(json.dumps(document | {"versions": versions, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
