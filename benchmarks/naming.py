"""The blind study: hidden effects, named or not. `python -m benchmarks.naming [--set main] [--shard 1/2] [--report]`.

Every case is simulated by `reference/`, written to CSV, read back, fitted and explained with nothing but the files and
the nominal model. Results are appended to `benchmarks/results/naming_SET.jsonl`, one line a case; cases that stand there
are not run again, so that a study can be stopped, resumed and shared out among processes. `--report` writes
`benchmarks/results/naming.json`, `docs/naming.md` and its pictures from those files.

Sets: `main` is what was looked at while the workflow was built; `aside` has other seeds and was looked at once, at the
end; `fast` is the slice in the test suite.
"""

import argparse
import json
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import jax
import numpy as np

RESULTS = Path(__file__).parent / "results"
SIZES = Path(__file__).parent / "hidden" / "sizes.json"
ROBOTS = ("pioneer", "omni", "axis")
_FORGET = 10
"""Cases after which compiled programs are forgotten."""
FIRST_SEED = {"main": 100, "aside": 5000, "fast": 900}


@dataclass(frozen=True)
class Plan:
    """One case of a set: `kind` is "single", "complete", "pair" or "outside"."""

    robot: str
    kind: str
    effects: dict[str, float]
    strength: str
    seed: int

    @property
    def name(self) -> str:
        """Key of the case in the results."""
        return f"{self.robot}/{self.kind}/{'+'.join(self.effects) or 'none'}/{self.strength}/{self.seed}"

    def record(self, hidden: dict) -> dict:
        """What a line of the results says of the case, in which the effects `hidden` were."""
        own = {"robot": self.robot, "kind": self.kind, "strength": self.strength, "seed": self.seed}
        return {"case": self.name, **own, "hidden": hidden}


def plans(name: str) -> list[Plan]:
    """All cases of a set, in an order in which every part of it is a fair sample."""
    from .hidden.cases import OUTSIDE, STRENGTHS

    sizes = json.loads(SIZES.read_text(encoding="utf-8"))
    rng = np.random.default_rng(FIRST_SEED[name])
    found: list[Plan] = []
    seed = FIRST_SEED[name]
    for robot in ROBOTS:
        known = {k: v for k, v in sizes.get(robot, {}).items() if k not in OUTSIDE}
        outside = {k: v for k, v in sizes.get(robot, {}).items() if k in OUTSIDE}
        own = []
        for strength in STRENGTHS:
            own += [("single", {k: v[strength]}, strength) for k, v in known.items()]
        if robot == "omni":
            own.append(("single", {"coriolis_coupling": 1.0}, "strong"))
        own += [("complete", {}, "-")] * (30 if name == "main" else 15)
        for strength in ("medium", "strong"):
            own += [("outside", {k: v[strength]}, strength) for k, v in outside.items()]
        names = sorted(known)
        for _ in range(12 if name == "main" else 6):
            one, other = rng.choice(len(names), 2, replace=False)
            own.append(("pair", {names[k]: known[names[k]]["medium"] for k in (one, other)}, "medium"))
        if name == "fast":
            own = [c for c in own if c[0] == "single" and c[2] == "medium"][::8] + [("complete", {}, "-")]
        for kind, effects, strength in own:
            found.append(Plan(robot, kind, effects, strength, seed))
            seed += 1
    order = rng.permutation(len(found))
    return [found[i] for i in order]


def true_parameters(robot: str, hidden: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
    """The hidden effects' constants in the model's own terms, where the two have the same meaning."""
    from .hidden.cases import MODEL

    channels = MODEL[robot]().channels
    inputs, outputs = channels.inputs, channels.outputs
    same = {
        "actuator_dead_zone": "threshold",
        "battery_sag": "resistance",
        "motor_lag": "time_constant",
        "input_delay": "delay",
        "motor_heating": "coefficient",
        "asymmetric_friction": "asymmetry",
        "asymmetric_viscous_friction": "asymmetry",
        "sublinear_viscous_friction": "deficit",
        "quadratic_drag": "coefficient",
        "sensor_lag": "time_constant",
        "sensor_delay": "delay",
    }
    true: dict[str, dict[str, float]] = {}
    for name, p in hidden.items():
        if name in same:
            true[name] = {same[name]: p[same[name]]}
        elif name in ("voltage_saturation", "traction_limit"):
            true[name] = {"inverse_limit": 1.0 / p["limit"]}
        elif name == "stribeck_friction":
            true[name] = {"amplitude": p["amplitude"], "speed": p["speed"]} if robot == "pioneer" else {}
        elif name == "wheel_radius_mismatch":
            true[name] = {"radius_mismatch": p["mismatch"] / 2}
        elif name == "surface_change":
            true[name] = {"coulomb": p["coulomb"], "viscous": p["viscous"]}
        elif name == "ground_slope":
            pull = np.sin(p["angle"])
            true[name] = {"slope_x": pull * np.cos(p["direction"]), "slope_y": pull * np.sin(p["direction"])}
        elif name == "lateral_com_offset" and robot == "pioneer":
            true[name] = {"xm": p["offset"]}
        elif name == "sensor_bias":
            true[name] = {f"bias_{c}": p["bias"] * (i + 1 == p["channel"]) for i, c in enumerate(outputs)}
        elif name == "sensor_scale":
            true[name] = {f"error_{c}": p["error"] * (i + 1 == p["channel"]) for i, c in enumerate(outputs)}
        elif name == "motor_gain_mismatch":
            true[name] = {f"gain_{c}": p["mismatch"] * (i + 1 == p["motor"]) for i, c in enumerate(inputs)}
    return true


def _seen_from(hidden: dict[str, float], angle: float, true: dict[str, float]) -> dict[str, float]:
    """A change of the surface, from the other side of its line if that is the side that was estimated.

    Friction (1 + c) beyond a line is, seen from beyond, friction scaled by 1 / (1 + c) on the near side.
    """
    if np.cos(angle - hidden["angle"]) < 0:
        return {name: -c / (1 + c) for name, c in true.items()}
    return true


def run(plan: Plan) -> dict:
    """Simulate, write, read, fit, explain; what came of it."""
    import jaxid
    from jaxid.explanation.explain import explain
    from jaxid.model_file import read_model

    from .hidden.cases import MODEL, make

    case = make(plan.robot, plan.effects, plan.seed)
    with tempfile.TemporaryDirectory() as folder:
        fit_files, held_out_files, model = case.write(Path(folder))
        begin = time.perf_counter()
        robot = read_model(model, MODEL[plan.robot]())
        logs = jaxid.read_logs([str(path) for path in fit_files], robot=plan.robot)
        held_out = jaxid.read_logs([str(path) for path in held_out_files], robot=plan.robot)
        fit = jaxid.output_error(robot, logs)
        found = explain(fit, logs, held_out)
        seconds = time.perf_counter() - begin
    true = true_parameters(plan.robot, case.effects)
    covered = {}
    for effect in found.effects:
        constants = true.get(effect.id, {})
        if constants and effect.id == "surface_change":
            constants = _seen_from(case.effects[effect.id], effect.parameters["angle"].value, constants)
        for name, value in constants.items():
            estimate = effect.parameters.get(name)
            if estimate is not None and estimate.status == "identified":
                low, high = estimate.ci95
                covered[f"{effect.id}.{name}"] = [
                    float(value),
                    estimate.value,
                    estimate.std_error,
                    bool(low <= value <= high),
                ]
    return {
        **plan.record(case.effects),
        "verdict": found.verdict,
        "named": [effect.id for effect in found.effects],
        "equivalent": {effect.id: list(effect.equivalent_to) for effect in found.effects},
        "before": found.before.normalised_rms,
        "after": found.after.normalised_rms,
        "p_white_before": found.before.p_white,
        "p_white_after": found.after.p_white,
        "first_look": [[c.effect.id, round(c.share, 4)] for c in found.search.first_look[:6]],
        "refitted": [
            [[t.id, round(t.held_out.normalised_rms, 4), round(t.score, 1)] for t in step.trials]
            for step in found.search.steps
        ],
        "covered": covered,
        "seconds": round(seconds, 1),
    }


def results(name: str) -> dict[str, dict]:
    """What stands in the set's file by case."""
    path = RESULTS / f"naming_{name}.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return {entry["case"]: entry for entry in map(json.loads, lines)}


def main() -> None:
    """Run or report."""
    parser = argparse.ArgumentParser(description="Blind study of naming hidden effects.")
    parser.add_argument("--set", choices=list(FIRST_SEED), default="main")
    parser.add_argument("--shard", default="1/1", help="K/N: every N-th case from the K-th")
    parser.add_argument("--only", default="", help="run cases whose name contains one of these (comma between)")
    parser.add_argument("--limit", type=int, default=None, help="most cases to run now")
    parser.add_argument("--report", action="store_true", help="write the page from the results")
    arguments = parser.parse_args()
    if arguments.report:
        from .hidden.naming_page import write

        planned = {
            name: [(robot, sum(plan.robot == robot for plan in plans(name))) for robot in ROBOTS]
            for name in ("main", "aside")
        }
        write(results("main"), results("aside"), planned)
        return
    number, of = (int(part) for part in arguments.shard.split("/"))
    chosen = [
        plan
        for plan in plans(arguments.set)[number - 1 :: of]
        if any(part in plan.name for part in arguments.only.split(","))
    ]
    run_left(chosen, arguments.set, arguments.limit, run, _told)


def _told(entry: dict) -> str:
    return f"{entry['verdict']}: {', '.join(entry['named'])} {entry['equivalent']}"


def run_left(
    chosen: list[Plan], name: str, limit: int | None, run: Callable[[Plan], dict], told: Callable[[dict], str]
) -> None:
    """Run the plans that have no result in `naming_NAME.jsonl` yet, and append theirs, one line a case."""
    done = results(name)
    left = [plan for plan in chosen if plan.name not in done][:limit]
    print(f"{len(chosen)} cases, {len(chosen) - len(left)} there already or left for later", flush=True)
    for count, plan in enumerate(left, start=1):
        try:
            entry = run(plan)
        except Exception as error:  # one bad case must not end a study of hours
            traceback.print_exc()
            entry = {"case": plan.name, "robot": plan.robot, "kind": plan.kind, "strength": plan.strength,
                     "seed": plan.seed, "error": f"{type(error).__name__}: {error}"}  # fmt: skip
        with (RESULTS / f"naming_{name}.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")
        rms = f"{entry.get('before', np.nan):.2f} -> {entry.get('after', np.nan):.3f}"
        what = entry["error"] if "error" in entry else told(entry)
        print(f"[{count}/{len(left)}] {plan.name}: {what} ({rms}, {entry.get('seconds')} s)", flush=True)
        if count % _FORGET == 0:
            jax.clear_caches()  # hundreds of cases would fill the memory with programs


if __name__ == "__main__":
    sys.exit(main())
