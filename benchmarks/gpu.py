"""A GPU against two processor cores of the same machine: small fits a second, derivatives, and what limits them.

    python -m benchmarks.gpu            # on a machine with an NVIDIA GPU and JAX for it; some minutes
    python -m benchmarks.gpu --quick    # a trial with few members; writes nothing

The fits are those of `benchmarks.fleet` (two runs of 250 samples at 50 Hz each, logs of the independent simulator in
`reference/`, starts 10 % off): one minimisation a member, as one call of `fit_lanes`. The ways, each in a process of its own:

- "processor": machine code on two cores;
- "GPU": the same expressions as one kernel a rollout (`jaxid.kernel.on_gpu`);
- "GPU, XLA": XLA's own scan, as any JAX program that holds a loop over the samples; of few members, since it takes minutes.

Elapsed seconds of the second call (the first compiles and is given beside it); how far the optima are from the processor's, in
standard errors; and of a profile of the GPU's second call: kernels launched, their time, the share of the call in which the
GPU worked, and the kernels that took most. Derivatives: outputs and their derivatives by parameters and initial states of
rollouts of 1,000 samples, as in `benchmarks.kernel`. Results go to `benchmarks/results/gpu.json` and `docs/gpu.md`.
"""

import argparse
import gzip
import json
import os
import platform
import subprocess
import sys
import tempfile
import textwrap
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from importlib.metadata import version
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
RESULTS, PAGE = ROOT / "benchmarks/results/gpu.json", ROOT / "docs/gpu.md"
PROCESSOR, GPU, XLA = "processor", "GPU", "GPU, XLA"
ROBOTS = ("axis", "omni", "pioneer")
MEMBERS = {PROCESSOR: (64, 256), GPU: (1024, 8192), XLA: (64,)}
EXPERIMENTS = {PROCESSOR: (8, 128, 1024), GPU: (1024, 8192), XLA: (8, 128, 1024)}
MEMBERS_OF_FLEET = 64
DISTINCT = 64
"""Members with parameters of their own; beyond, the same with other noise."""
CORES = 2


def fleet_of(name: str, count: int):
    """`fit_lanes`' arguments for `count` members."""
    from benchmarks import fleet
    from jaxid import float64

    robot, logs = fleet.members(name, min(count, DISTINCT))
    with float64():
        structure, shared, own, starts = fleet.stacked(robot, logs)
    rng = np.random.default_rng(5)
    which = np.arange(count) % min(count, DISTINCT)
    own = {key: value[which] for key, value in own.items()}
    more = which != np.arange(count)
    noise = rng.normal(size=own["outputs"].shape) * own["sigma"][:, None, None]
    own["outputs"] = own["outputs"] + np.where(more[:, None, None, None], noise, 0.0)
    return structure, shared, own, type(starts)(*(np.asarray(leaf)[which] for leaf in starts))


def profiled(call) -> dict:
    """What the GPU did during a call."""
    import jax

    with tempfile.TemporaryDirectory() as folder:
        begun = time.perf_counter()
        with jax.profiler.trace(folder):
            call()
        elapsed = time.perf_counter() - begun
        traces = list(Path(folder).rglob("*.trace.json.gz"))
        events = [event for path in traces for event in json.loads(gzip.decompress(path.read_bytes()))["traceEvents"]]
    gpus = {e["pid"] for e in events if e.get("name") == "process_name" and "GPU" in e["args"]["name"]}
    streams = {(e["pid"], e["tid"]) for e in events
               if e.get("name") == "thread_name" and e["pid"] in gpus and "Stream" in e["args"]["name"]}  # fmt: skip
    ran = [e for e in events if e.get("ph") == "X" and (e["pid"], e["tid"]) in streams]
    by_name: Counter = Counter()
    for event in ran:
        by_name[event["name"].rstrip("0123456789_")] += event["dur"] * 1e-6
    busy = sum(by_name.values())
    return {
        "elapsed_s": elapsed,
        "kernels": len(ran),
        "busy_s": busy,
        "microseconds_a_kernel": 1e6 * busy / max(len(ran), 1),
        "most": [{"kernel": name[:80], "s": seconds} for name, seconds in by_name.most_common(6)],
    }


def twice(call) -> tuple[list[float], Any]:
    """Elapsed seconds of two calls, and what the second returned."""
    seconds, found = [], None
    for _ in range(2):
        begun = time.perf_counter()
        found = call()
        seconds.append(time.perf_counter() - begun)
    return seconds, found


def fits(name: str, count: int, way: str) -> dict:
    """One row of fits."""
    import jax

    from jaxid import float64
    from jaxid.estimate.output_error.fleet import fit_lanes

    arguments = fleet_of(name, count)
    lanes = {} if way == PROCESSOR else {"lanes": count}
    with float64():
        call = lambda: jax.block_until_ready(fit_lanes(*arguments, rounds=1, **lanes))  # noqa: E731
        seconds, found = twice(call)
        profile = profiled(call) if way == GPU else None  # XLA's has a million events
    return {
        "fits": count, "seconds": seconds, "fits_per_s": count / seconds[1], "profile": profile,
        "optima": np.asarray(found.optimum.unknowns.z)[:64].tolist(),
        "triangle": np.asarray(found.optimum.triangle.shared)[:64].tolist(),
    }  # fmt: skip


def derivatives(name: str, count: int, way: str) -> dict:
    """One row of derivatives."""
    import jaxid
    from benchmarks import kernel
    from jaxid import float64
    from jaxid.simulation.rollout import rollout, rollout_in_xla

    robot = {"axis": jaxid.Axis, "omni": jaxid.Omni, "pioneer": jaxid.Pioneer}[name]()
    with float64():
        inputs = kernel.excited(robot, count)
        call = kernel.derivatives(robot, rollout_in_xla if way == XLA else rollout, inputs)
        call()
        seconds, _ = twice(call)
        profile = profiled(call) if way == GPU or (way == XLA and count == EXPERIMENTS[XLA][-1]) else None
    return {"experiments": count, "seconds": min(seconds), "samples_per_s": count * kernel.SAMPLES / min(seconds),
            "profile": profile}  # fmt: skip


def whole(name: str) -> dict:
    """`fit_fleet` as its users call it: starts, rounds of weights and everything that is said of a fit."""
    import jaxid
    from benchmarks import fleet

    robot, logs = fleet.members(name, MEMBERS_OF_FLEET)
    seconds, found = twice(lambda: jaxid.fit_fleet(robot, logs))
    return {"members": MEMBERS_OF_FLEET, "seconds": seconds, "failed": len(found.failed)}


def work(way: str, name: str, quick: bool) -> None:
    """Everything of one robot in one way, a JSON line each."""
    import jax

    print(json.dumps({"device": jax.devices()[0].device_kind}), flush=True)
    with ExitStack() as stack:
        if way == XLA:
            stack.enter_context(patch("jaxid.simulation.rollout.machine_rollout", lambda *_: None))
        for count in MEMBERS[way][: 1 if quick else None]:
            print(json.dumps({"robot": name, "way": way, "what": "fits", **fits(name, count, way)}), flush=True)
        for count in EXPERIMENTS[way][: 2 if quick else None]:
            print(
                json.dumps({"robot": name, "way": way, "what": "derivatives", **derivatives(name, count, way)}),
                flush=True,
            )
        if way != XLA and not quick:
            print(json.dumps({"robot": name, "way": way, "what": "fit_fleet", **whole(name)}), flush=True)


def _run(way: str, name: str, quick: bool, limit: float) -> list[dict]:
    environment = {
        **os.environ,
        "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
        "JAX_PLATFORMS": "cpu" if way == PROCESSOR else "cuda",
    }
    command = [sys.executable, "-m", "benchmarks.gpu", "--way", way, "--robots", name, *(["--quick"] if quick else [])]
    if way == PROCESSOR:
        environment["PJRT_NPROC"] = str(CORES)
        command = ["taskset", "-c", ",".join(map(str, range(CORES))), *command]
    elif (os.cpu_count() or 1) > CORES:
        command = ["taskset", "-c", f"{CORES}-{(os.cpu_count() or 1) - 1}", *command]
    try:
        done = subprocess.run(command, cwd=ROOT, env=environment, timeout=limit, capture_output=True)
        lines, said = done.stdout, done.stderr.decode() if done.returncode else ""
    except subprocess.TimeoutExpired as late:
        lines, said = late.stdout or b"", f"not done after {limit:.0f} s"
    rows = [json.loads(line) for line in lines.decode().splitlines() if line.startswith("{")]
    if said:
        print(f"{way}, {name}: {said[-1500:]}", flush=True)
    return rows


def _agreement(row: dict, reference: dict) -> float:
    """Largest difference of an optimum from the processor's, in standard errors of the shared parameters."""
    z, there = (np.array(r["optima"]) for r in (row, reference))
    # |R (z - z')| is the length of the difference in standard errors, all parameters together
    return float(np.abs(np.einsum("mij,mj->mi", np.array(reference["triangle"]), z - there)).max())


def page(document: dict) -> str:
    """`docs/gpu.md`."""
    rows = document["rows"]
    fits, derived, whole = ([r for r in rows if r["what"] == what] for what in ("fits", "derivatives", "fit_fleet"))

    def ratio(row: dict, key: str, size: str) -> str:
        same = [r for r in rows if (r["what"], r["robot"], r["way"]) == (row["what"], row["robot"], PROCESSOR)]
        times = row[key] / max(same, key=lambda r: r[size])[key]
        return f"{times:.0f}" if times >= 10 else f"{times:.2g}"

    def table(head: str, cells: list[tuple]) -> str:
        line = "| " + " | ".join("---" for _ in head.split("|")) + " |"
        return "\n".join([f"| {head} |", line, *("| " + " | ".join(map(str, each)) + " |" for each in cells)])

    def of_fits(r: dict) -> tuple:
        profile = r.get("profile")
        return (
            r["robot"], r["way"], f"{r['fits']:,}", f"{r['seconds'][0]:.2g}", f"{r['fits_per_s']:,.0f}",
            ratio(r, "fits_per_s", "fits"), f"{r['difference']:.0e}" if "difference" in r else "",
            f"{profile['kernels']:,}" if profile else "",
            f"{100 * profile['busy_s'] / r['seconds'][1]:.0f} %" if profile else "",
        )  # fmt: skip

    def of_derivatives(r: dict) -> tuple:
        profile = r.get("profile")
        return (
            r["robot"], r["way"], f"{r['experiments']:,}", f"{r['samples_per_s'] / 1e6:.3g}",
            ratio(r, "samples_per_s", "experiments"), f"{profile['kernels']:,}" if profile else "",
        )  # fmt: skip

    profiled = [max(group, key=lambda r: r["fits"]) for name in ROBOTS
                if (group := [r for r in fits if r["robot"] == name and r.get("profile")])]  # fmt: skip
    most = [
        f"- {r['robot']}, {r['fits']:,} members: "
        + ", ".join(f"`{e['kernel'].split('<')[0]}` {1e3 * e['s']:.3g} ms" for e in r["profile"]["most"])
        for r in profiled
    ]
    of_a_fit = "robot | way | members | first call, s | fits/s | against two cores | difference | kernels | GPU at work"
    of_a_rollout = "robot | way | experiments | million samples/s | against two cores | kernels"
    of_whole = ", ".join(
        f"{r['robot']} {r['way']} {r['seconds'][0]:.2g} s, then {r['seconds'][1]:.2g} s" for r in whole
    )
    of_all = (
        f"`fit_fleet` as a whole, {MEMBERS_OF_FLEET} members, with everything that it decides and says in Python, and on a GPU "
        f"with a program for each of its parts: {of_whole}. What is left out here was not done within the time: for fleets of "
        "such a size the cores are the better choice."
    )
    measured = (
        f"Measured by `python -m benchmarks.gpu` on one {document['device']} and {CORES} cores of its machine (JAX "
        f"{document['versions']['jax']}). {document.get('note', '')}"
    ).strip()
    return f"""\
# On a GPU

A fleet's fits and a rollout's derivatives run on an NVIDIA GPU by the same functions. Where JAX finds one, a rollout is one
kernel, made in Pallas from the same expressions as the processor's machine code (`jaxid.kernel.on_gpu`): a thread an experiment
and direction of the derivatives, with the loop over the samples inside. XLA's own scan launches all its small kernels anew at
every sample and sub-step. Double precision throughout.

{textwrap.fill(measured, 128)}

Two runs of 250 samples a member, one minimisation each from starts 10 % off. "Against two cores" is the ratio to the cores'
largest row for the same robot, "difference" the largest of 64 members' optima from the cores', in standard errors, and "GPU at
work" the time of its kernels over the call's.

{table(of_a_fit, [*map(of_fits, fits)])}

Kernels that took most of a call:

{chr(10).join(most)}

Outputs and their derivatives by parameters and initial states, 1,000 samples a rollout, four steps each:

{table(of_a_rollout, [*map(of_derivatives, derived)])}

{textwrap.fill(of_all, 128)}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--way", choices=[PROCESSOR, GPU, XLA])
    parser.add_argument("--gpu", nargs="+", choices=[GPU, XLA], default=[GPU, XLA], help="the GPU's ways")
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=list(ROBOTS))
    parser.add_argument("--limit", type=float, default=150.0, help="seconds that one robot may take in one way")
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--add", nargs="+", type=Path, default=[], help="results of runs on the same kind of machine")
    arguments = parser.parse_args()
    if arguments.way:
        work(arguments.way, arguments.robots[0], arguments.quick)
        return
    rows, devices = [], []

    def in_turn(ways: list[str]) -> None:
        for way in ways:
            for name in arguments.robots:
                for row in _run(way, name, arguments.quick, arguments.limit):
                    (devices if "device" in row else rows).append(row)
                    print({k: v for k, v in row.items() if k not in ("optima", "triangle", "profile")}, flush=True)

    # On cores of their own, side by side.
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(in_turn, [[PROCESSOR], arguments.gpu]))
    device = next((each["device"] for each in devices if each["device"] != "cpu"), None)
    if device is None:
        raise SystemExit("No GPU that JAX can use: nothing is written.")
    for row in rows:
        # The first members are the same of any number.
        same = [r for r in rows if (r["what"], r["robot"], r["way"]) == ("fits", row["robot"], PROCESSOR)]
        if row["what"] == "fits" and row["way"] != PROCESSOR and same:
            row["difference"] = _agreement(row, same[0])
    for row in rows:
        row.pop("optima", None)
        row.pop("triangle", None)
    document = {
        "device": device,
        "machine": platform.processor() or platform.machine(),
        "versions": {package: version(package) for package in ("jax", "numpy", "llvmlite")},
        "rows": rows,
    }
    if arguments.add:
        key = lambda r: (r["what"], r["robot"], r["way"], r.get("fits"), r.get("experiments"))  # noqa: E731
        before = [r for path in arguments.add for r in json.loads(path.read_text("utf-8"))["rows"]]
        there = {key(r): r for r in [*before, *rows]}
        document["rows"] = sorted(
            there.values(), key=lambda r: (ROBOTS.index(r["robot"]), r["way"] != PROCESSOR, r["way"])
        )
    if not arguments.quick:
        arguments.out.parent.mkdir(parents=True, exist_ok=True)
        arguments.out.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        if arguments.out == RESULTS:
            PAGE.write_text(page(document), encoding="utf-8")


if __name__ == "__main__":
    main()
