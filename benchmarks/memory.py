"""Memory of a process that explains one robot after another.

    PJRT_NPROC=1 python -m benchmarks.memory [--robots 100] [--out FILE]

No two robots are alike: kind, constants, hidden effect, number and length of the logs are drawn anew for each; every fifth is
a robot written as functions, whose functions are made anew. Logs are short (4 to 10 s at 50 Hz), since what grows from robot
to robot is what is compiled, not what is read. After each explanation its verdict, its seconds and the memory that the process
holds and has held at most are noted. Results go to `benchmarks/results/memory.json`.
"""

import argparse
import json
import platform
import resource
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np

import jaxid
from reference.excitation import experiment
from reference.logs import simulate_log

from .hidden.cases import AXIS_NAMES, MODEL, NOISE, REFERENCE, UNKNOWN, effect

RESULTS = Path(__file__).parent / "results" / "memory.json"
SIZES = Path(__file__).parent / "hidden" / "sizes.json"
SAMPLING = 0.02
KINDS = ("pioneer", "omni", "axis", "pioneer", "custom")
SPREAD = 0.15
Logs = tuple[jaxid.LogSet, jaxid.LogSet]


def built_in(kind: str, rng: np.random.Generator, seed: int) -> tuple[jaxid.Robot, Logs]:
    """A robot that comes with jaxid, and logs of one like it with an effect that it lacks."""
    known = json.loads(SIZES.read_text(encoding="utf-8"))[kind]
    hidden = str(rng.choice(sorted(known)))
    simulated = REFERENCE[kind]
    if kind == "axis":
        simulated = simulated.with_parameters(J=20.0, k=10.0, Cv=30.0, Cs=8.0)
    drawn = {name: simulated.parameters[name] * float(1 + rng.uniform(-SPREAD, SPREAD)) for name in UNKNOWN[kind]}
    simulated = simulated.with_parameters(**drawn)
    effects = {hidden: effect(kind, hidden, known[hidden]["medium"], rng)}
    robot = MODEL[kind]()
    if kind == "axis":
        robot = robot.with_values(**{AXIS_NAMES["k"]: 10.0, "M": 20.0, "Fv": 30.0, "Fc": 8.0})
    count = int(rng.integers(2, 5))
    logs = []
    for number, what in enumerate((*("prbs_reversing", "turning", "multilevel", "crawl")[:count], "steps", "arcs")):
        samples = int(rng.integers(200, 500))
        inputs = experiment(kind, what, samples, 1000 * seed + number)
        table = simulate_log(simulated, inputs, SAMPLING, NOISE[kind], 1000 * seed + 500 + number, effects=effects)
        outputs = {c: table[c].to_numpy() for c in robot.channels.outputs}
        logs.append(jaxid.Log.from_arrays(f"{number} {what}", table["t"].to_numpy(), inputs, outputs, robot))
    return robot, (jaxid.LogSet(logs[:count]), jaxid.LogSet(logs[count:]))


def custom(rng: np.random.Generator, seed: int) -> tuple[jaxid.Robot, Logs]:
    """A cart written as functions that are new every time, and its logs with a drag that they lack."""
    mass, viscous, drag, gain = (float(x) for x in rng.uniform((1.5, 2.0, 0.3, 4.0), (2.5, 4.0, 0.8, 6.0)))
    channels = jaxid.Channels(inputs=("u",), outputs=("v",), units={"u": "V", "v": "m/s"})

    def dynamics(state, given, p):
        return {"v": (gain * given["u"] - p["viscous"] * state["v"]) / p["mass"]}

    table = {
        "mass": jaxid.Parameter(2.0, "kg", free=True, lower=0.0),
        "viscous": jaxid.Parameter(3.0, "N s/m", free=True, lower=0.0),
    }
    robot = jaxid.Custom(
        dynamics=dynamics, state_names=("v",), own_channels=channels, table=table, forces={"v": "mass"}, title="cart"
    )
    logs, few = [], 20
    for number in range(4):
        samples = int(rng.integers(200, 500))
        u = np.repeat(rng.uniform(-5.0, 5.0, -(-samples // 25)), 25)[:samples]
        v = np.zeros(samples)
        for k in range(samples - 1):
            now = v[k]
            for _ in range(few):
                now += SAMPLING / few * (gain * u[k] - viscous * now - drag * now * abs(now)) / mass
            v[k + 1] = now
        noisy = v + 0.01 * rng.standard_normal(samples)
        logs.append(
            jaxid.Log.from_arrays(
                f"{seed} run {number}", SAMPLING * np.arange(samples), u[:, None], {"v": noisy}, robot
            )
        )
    return robot, (jaxid.LogSet(logs[:2]), jaxid.LogSet(logs[2:]))


def held() -> float:
    """What the process holds now [MB]."""
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    return pages * resource.getpagesize() / 1e6


def row(number: int) -> dict:
    """One robot explained."""
    rng = np.random.default_rng([number, 11])
    kind = KINDS[number % len(KINDS)]
    robot, (logs, held_out) = custom(rng, number) if kind == "custom" else built_in(kind, rng, number)
    began = time.process_time()
    found = jaxid.explain(jaxid.output_error(robot, logs), logs, held_out)
    return {
        "robot": kind,
        "verdict": found.verdict,
        "named": [one.id for one in found.effects],
        "processor_s": round(time.process_time() - began, 2),
        "held_MB": round(held(), 1),
        "most_MB": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6, 1),
    }


def main() -> None:
    """Explain one robot after another and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--out", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    rows = []
    for number in range(arguments.robots):
        rows.append(row(number))
        print(json.dumps(rows[-1]), flush=True)
        document = {
            "command": f"python -m benchmarks.memory --robots {arguments.robots}",
            "machine": platform.processor() or platform.machine(),
            "versions": {package: version(package) for package in ("jax", "numpy", "llvmlite")},
            "rows": rows,
        }
        arguments.out.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
