"""Fits per second of a fleet by the number of processes and members, and what that predicts for a million logs.

    python -m benchmarks.scaling [--processes 1 2] [--members 64 256 1024]

Every member is an axis with parameters of its own (10 % off) and one log of 250 samples at 50 Hz in a CSV file; the driven
speed is exact for each held input, and has white noise. `jaxid fleet` is run on the folder by Dask with one process and with
two, its worker processes started and everything read, written and summed up included. Processor seconds are those of all
processes. Results go to `benchmarks/results/scaling.json`.
"""

import argparse
import json
import os
import platform
import re
import resource
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pandas as pd

RESULTS = Path(__file__).parent / "results" / "scaling.json"
SAMPLES, SAMPLING, NOISE, SPREAD = 250, 0.02, 0.01, 0.1
MODEL = "[parameters.offset]\nvalue = 0\nfree = false\n[parameters.Fc]\nvalue = 0\nfree = false\n"
COMMAND = "import sys; from jaxid.cli import main; main(sys.argv[1:])"


def write_members(folder: Path, count: int) -> None:
    """`count` logs of axes that differ."""
    rng = np.random.default_rng(4)
    for member in range(count):
        mass, friction = 1.0 * np.exp(SPREAD * rng.normal()), 2.0 * np.exp(SPREAD * rng.normal())
        u = np.repeat(rng.uniform(-4.0, 4.0, SAMPLES // 10), 10)
        decay, v = np.exp(-friction / mass * SAMPLING), np.zeros(SAMPLES)
        for k in range(SAMPLES - 1):
            v[k + 1] = decay * v[k] + (1 - decay) * u[k] / friction
        noisy = v + NOISE * rng.normal(size=SAMPLES)
        table = pd.DataFrame({"t": np.arange(SAMPLES) * SAMPLING, "u": u, "v": noisy})
        table.to_csv(folder / f"member_{member:05d}.csv", index=False, float_format="%.8g")


def row(folder: Path, count: int, processes: int, out: Path) -> dict:
    """Elapsed seconds of `jaxid fleet`, processes and all, and of its members alone."""
    argv = ["fleet", "axis", str(folder), "--model", str(folder.parent / "model.toml"), "--windows", "none"]
    began, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    run = subprocess.run(
        [sys.executable, "-c", COMMAND, *argv, "--workers", str(processes), "--out", str(out)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PJRT_NPROC": "1", "OPENBLAS_NUM_THREADS": "1"},
    )
    whole, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    times = [(int(done), float(at)) for done, at in re.findall(r"(\d+) of \d+ members done \(([\d.]+) s\)", run.stderr)]
    found = pd.read_parquet(out / "members.parquet")
    # From the first parts to the last: without the workers' own start and first programs.
    steady = [(done, at) for done, at in times if done > 32 * processes]
    rate = (steady[-1][0] - steady[0][0]) / (steady[-1][1] - steady[0][1]) if len(steady) > 2 else None
    return {
        "processes": processes,
        "members": count,
        "fitted": int((found["failure"] == "").sum()),
        "whole_s": round(whole, 2),
        "processor_s": round(processor, 2),
        "fits_per_s": round(count / whole, 2),
        "fits_per_s_once_going": rate and round(rate, 2),
    }


def main() -> None:
    """Run every combination and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--processes", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--members", type=int, nargs="+", default=[64, 256, 1024])
    arguments = parser.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as place:
        (Path(place) / "model.toml").write_text(MODEL, encoding="utf-8")
        for count in arguments.members:
            folder = Path(place) / f"{count}"
            folder.mkdir()
            write_members(folder, count)
            for processes in arguments.processes:
                rows.append(row(folder, count, processes, Path(place) / f"out_{count}_{processes}"))
                rows[-1]["load"] = round(os.getloadavg()[0], 1)
                print(json.dumps(rows[-1]), flush=True)
    document = {
        "command": " ".join(["python -m benchmarks.scaling", *sys.argv[1:]]),
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "versions": {package: version(package) for package in ("jax", "numpy", "distributed")},
        "rows": rows,
    }
    RESULTS.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
