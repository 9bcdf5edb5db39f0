"""What changed between two sets of logs: how often it is named, how well it is sized, how often nothing is called something.

    python -m benchmarks.changes            # what benchmarks/results/changes.jsonl lacks, some five minutes of processor time
    python -m benchmarks.changes --report   # the table in docs/changes.md

Every case is simulated by the independent simulator in `reference/` (true dry friction, another integrator): four logs before
and four after, 16 s each at 50 Hz, and two held out of either set where something changed. Sizes and inputs are
drawn from the seed.
"""

import argparse
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.hidden.cases import MODEL, NOISE, REFERENCE
from jaxid import Log, LogSet, explain_change, output_error
from reference import excitation
from reference.logs import simulate_log

RESULTS = Path(__file__).parent / "results/changes.jsonl"
PAGE = Path(__file__).parents[1] / "docs/changes.md"
MARK = "<!-- measured -->\n"
KINDS, HELD_OUT = ("prbs_forward", "prbs_reversing", "multilevel", "turning"), ("arcs", "prbs_reversing")
ONE_WHEEL = {"axis": ("multilevel", "prbs_reversing", "prbs_forward", "steps"), "pioneer": KINDS, "omni": KINDS}
SAMPLES, SAMPLING = 800, 0.02
FLOOR = {"axis": ("Cs", "Cv"), "pioneer": ("Cs", "Cv"), "omni": ("Cv", "Cvn", "Cw", "Bv", "Bvn", "Bw")}
RIGHT = {
    "payload": {"payload", "payload_off_centre", "M"},
    "battery": {"command_gain"},
    "floor": {"friction", "friction_of_each"},
    "one wheel rubs": {"friction_of_right_wheel", "friction_of_V"},
    "tyre": {"radius_of_right_wheel", "radius_mismatch"},
}
"""Ids that are right answers. An omni's wheels of unequal radius are two and two."""
_PLANE = {"nothing": 3, "nothing, coloured": 2, "payload": 1, "battery": 1, "floor": 1, "one wheel rubs": 1, "tyre": 1}
PLAN = {
    "axis": {"nothing": 12, "nothing, coloured": 12, "payload": 3, "battery": 3, "floor": 3},
    "pioneer": _PLANE,
    "omni": _PLANE,
}


def changed(robot: str, what: str, rng: np.random.Generator) -> tuple[dict[str, Any], dict[str, float]]:
    """How the second set differs, as `recorded` takes it, and the true sizes by the names that an answer has."""
    constants = REFERENCE[robot].parameters
    if what == "payload":
        share = float(rng.uniform(0.05, 0.25))
        if robot == "axis":
            return {"times": {"J": 1.0 + share}}, {"M": share * constants["J"]}
        inertia = {"pioneer": "I0", "omni": "J"}[robot]
        times = {"M": 1.0 + share, inertia: 1.0 + 0.6 * share}
        return {"times": times}, {"M": share * constants["M"], inertia: 0.6 * share * constants[inertia]}
    if what == "battery":
        gain = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.03, 0.1))
        return {"gain": 1.0 + gain}, {"command_gain.gain": gain}
    if what == "floor":
        share = float(rng.uniform(0.1, 0.4))
        return {"times": dict.fromkeys(FLOOR[robot], 1.0 + share)}, {"friction.viscous_friction.viscous": share}
    if what == "one wheel rubs" and robot == "omni":
        share = float(rng.uniform(0.1, 0.4))
        return {"times": {"Cv": 1.0 + share, "Bv": 1.0 + share}}, {"friction_of_V.dry_friction.coulomb": share}
    if what == "one wheel rubs":  # Coulomb friction of the right wheel alone: a Stribeck rise that never falls off
        more = float(rng.uniform(0.03, 0.12))
        whole = constants["Cs"] + constants["tr"] * constants["mu"] * constants["tau_fr"]
        law = {"stribeck_friction/one_wheel": {"amplitude": more, "speed": 1e3, "wheel": 1.0}}
        return {"laws": law}, {"friction_of_right_wheel.dry_friction.coulomb": more / whole}
    if what == "tyre" and robot == "omni":
        return {"effects": {"wheel_radius_mismatch": {"mismatch": -0.04}}}, {"radius_mismatch": -0.02}
    if what == "tyre":
        law = {"wheel_radius_mismatch/one_wheel": {"mismatch": -0.02, "wheel": 1.0}}
        return {"laws": law}, {"radius_of_right_wheel": -0.02}
    return {}, {}


def recorded(
    robot: str, kinds: tuple[str, ...], seed: int, noise: str, times: Mapping[str, float] | None = None, gain: float = 1.0,
    **hidden: Any,
) -> LogSet:  # fmt: skip
    """Logs of a robot whose constants are so many `times` the usual ones, with a battery that gives `gain` times as much as is
    logged."""
    reference, model, found = REFERENCE[robot], MODEL[robot](), []
    reference = reference.with_parameters(**{k: reference.parameters[k] * v for k, v in (times or {}).items()})
    for k, kind in enumerate(kinds):
        inputs = excitation.experiment(robot, kind, SAMPLES, 100 * seed + k)
        table = simulate_log(reference, inputs, SAMPLING, NOISE[robot], 100 * seed + k, noise_kind=noise, **hidden)
        outputs = table[list(model.channels.outputs)].to_numpy()
        found.append(Log.from_arrays(f"{kind} {k}", table["t"].to_numpy(), inputs / gain, outputs, model))
    return LogSet(found)


def run(robot: str, what: str, number: int) -> dict[str, Any]:
    """One case, judged."""
    seed = 1000 * (1 + list(PLAN[robot]).index(what)) + 10 * number
    noise = "coloured" if "coloured" in what else "white"
    hidden, truth = changed(robot, what, np.random.default_rng(seed))
    kinds = ONE_WHEEL[robot]
    before, after = recorded(robot, kinds, seed, noise), recorded(robot, kinds, seed + 1, noise, **hidden)
    held_out = {}
    if hidden:
        held_out["held_out_before"] = recorded(robot, HELD_OUT, seed + 2, noise)
        held_out["held_out_after"] = recorded(robot, HELD_OUT, seed + 3, noise, **hidden)
    model, known = MODEL[robot](), REFERENCE[robot].parameters
    model = model.with_values(**{name: float(value) for name, value in known.items() if name in model.parameters})
    began = time.process_time()
    fits = output_error(model, before), output_error(model, after)
    fitted = time.process_time()
    found = explain_change(*fits, before, after, **held_out)
    named = [found.change, *found.equivalent] if found.change is not None and found.verdict != "unexplained" else []
    sizes = {}
    for own in named:
        for name, d in own.differences.items():
            if name in truth:
                sizes[name] = (truth[name], d.size.value, d.size.std_error)
    return {
        "robot": robot,
        "what": what,
        "number": number,
        "verdict": found.verdict,
        "named": [own.id for own in named],
        "right": found.verdict == "unchanged" if not hidden else bool(RIGHT[what] & {own.id for own in named}),
        "p_value": found.p_value,
        "rms": [found.rms_unchanged, found.change.rms if found.change else None],
        "sizes": sizes,
        "noticeable": {n.name: n.size for n in found.noticeable} if not hidden else {},
        "doubts": list(found.doubts),
        "seconds": [round(fitted - began, 1), round(time.process_time() - fitted, 1)],
    }


def table(rows: list[dict[str, Any]]) -> str:
    """What was run, a line for each robot and change."""
    lines = [
        "| robot | what changed | right | named alone | true size within its 95 % interval | seconds of processor time |"
    ]
    lines.append("| --- | --- | --- | --- | --- | --- |")
    for robot, plan in PLAN.items():
        for what in plan:
            own = [row for row in rows if (row["robot"], row["what"]) == (robot, what)]
            if not own:
                continue
            right = [row for row in own if row["right"]]
            alone = str(sum(len(row["named"]) == 1 for row in right)) if what in RIGHT else "-"
            sizes = [abs(value - true) < 1.96 * error for row in right for true, value, error in row["sizes"].values()]
            covered = f"{sum(sizes)} of {len(sizes)}" if sizes else "-"
            seconds = np.median([row["seconds"][1] for row in own])
            lines.append(f"| {robot} | {what} | {len(right)} of {len(own)} | {alone} | {covered} | {seconds:.1f} |")
    return "\n".join(lines) + "\n"


def failures(rows: list[dict[str, Any]]) -> str:
    """Every case that was not right."""
    wrong = [row for row in rows if not row["right"]]
    lines = [
        f"- {row['robot']}, {row['what']}, number {row['number']}: {row['verdict']}"
        + (f", named {', '.join(row['named'])}" if row["named"] else "")
        + (f" ({'; '.join(row['doubts'])})" if row["doubts"] else "")
        for row in wrong
    ]
    return "\n".join(["Not right:", "", *lines]) + "\n" if lines else "All were right.\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--report", action="store_true", help="write the table into docs/changes.md and run nothing")
    arguments = parser.parse_args()
    rows = [json.loads(line) for line in RESULTS.read_text().splitlines()] if RESULTS.exists() else []
    if not arguments.report:
        there = {(row["robot"], row["what"], row["number"]) for row in rows}
        for robot, plan in PLAN.items():
            for what, count in plan.items():
                for number in range(count):
                    if (robot, what, number) in there:
                        continue
                    row = run(robot, what, number)
                    print(robot, what, number, row["verdict"], row["named"], row["seconds"], flush=True)
                    with RESULTS.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
        return
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(text[: text.index(MARK)] + MARK + table(rows) + "\n" + failures(rows), encoding="utf-8")


if __name__ == "__main__":
    main()
