"""What `jaxid.explain` says about recordings of real machines, without being told what to look for.

    python -m benchmarks.explained --data ../shared/data    # about a quarter of an hour; --sets emps rot_B runs some

Writes `docs/explained.md` and `benchmarks/results/explained.json`. Every set is cut into logs to fit and held-out logs;
the baseline is the plain robot. Speeds that were filtered before they were logged have hardly any white noise, so that
errors "in units of the noise" are large; the shares by which they fall are what counts.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from jaxid import AXIS, Axis, Log, LogSet, output_error
from jaxid.explanation.explain import explain
from jaxid.explanation.explanation import Explanation
from jaxid.explanation.where.missing_force import missing_force
from jaxid.robots.effect import Effect
from jaxid.robots.robot import Robot

from .measured_sets import bam, bam_ladder, bam_loop, husky, robotrace, table
from .measured_sets.emps_loop import Record
from .measured_sets.emps_loop import load as load_emps

ROOT = Path(__file__).resolve().parents[1]
PAGE, RESULTS = ROOT / "docs" / "explained.md", ROOT / "benchmarks" / "results" / "explained.json"
_EMPS_SAMPLES = 5  # ms between samples: twice per period of the cut-off of the published filter
_EMPS_SECONDS = 4.0


@dataclass(frozen=True)
class Case:
    """One set: baseline, logs to fit and held-out ones, a user's own candidates, and what is known about the answer."""

    title: str
    robot: Robot
    fit: LogSet
    held_out: LogSet
    known: str
    effects: tuple[Effect, ...] = ()


def _emps_logs(record: Record, name: str) -> list[Log]:
    """Logs of four seconds: mean force of five milliseconds in, filtered speed out."""
    samples = len(record.t) // _EMPS_SAMPLES * _EMPS_SAMPLES
    force = (record.gain * record.vir)[:samples].reshape(-1, _EMPS_SAMPLES).mean(axis=1)
    whole = Log.from_arrays(
        name, record.t[:samples:_EMPS_SAMPLES], force[:, None], {"v": record.v[:samples:_EMPS_SAMPLES]}, AXIS
    )
    starts = np.arange(0.05, whole.duration - _EMPS_SECONDS / 2, _EMPS_SECONDS)
    parts = [whole.window(start, start + _EMPS_SECONDS - 1e-3) for start in starts]
    return [replace(part, name=f"{name} {start:.0f} s") for start, part in zip(starts, parts, strict=True)]


def emps(data: Path) -> Case:
    """The ball-screw axis: four stretches of the estimation record to fit, two held out."""
    logs = _emps_logs(load_emps(data / "emps", "DATA_EMPS"), "estimation")
    robot = Axis().with_values(M=95.0, Fv=200.0, Fc=20.0)
    known = "published: viscous friction 166.7 N s/m forwards, 240.4 backwards (asymmetry -0.181)"
    return Case("EMPS, ball-screw axis", robot, LogSet(logs[:4]), LogSet(logs[4:]), known)


def _robotrace(name: str) -> Callable[[Path], Case]:
    recording = next(r for r in robotrace.CLEAN if r.name == name)

    def case(data: Path) -> Case:
        log = robotrace.load(data / "robotrace", recording)
        borders = np.array([0.0, 0.25, 0.5, 0.7, 1.1]) * log.duration
        parts = [log.window(a, b - 1e-6) for a, b in zip(borders[:-1], borders[1:], strict=True)]
        parts = [replace(part, name=f"{name} part {k + 1}") for k, part in enumerate(parts)]
        known = "nothing published; a motor's or a gyro filter's lag is suspected, tra_* are driven straight"
        return Case(f"Robotrace {name}", robotrace.robot(recording, ()), LogSet(parts[:3]), LogSet(parts[3:]), known)

    return case


def bam_xl330(data: Path) -> Case:
    """The servo with its pendulum, in closed loop: the authors' own further terms are handed in as candidates."""
    fit, held_out = bam_loop.load(data / "bam_xl330").split(held_out=bam.CHECK)
    known = "the authors' ladder: Stribeck (M2), load-dependent (M3), directional load-dependent friction (M4 to M6)"
    own = (bam.JointStribeck(), bam.LoadFriction(), bam.DirectionalFriction())
    return Case("BAM, servo with pendulum", bam_loop.robot(), fit, held_out, known, own)


def _husky(ground: str, title: str, known: str) -> Callable[[Path], Case]:
    def case(data: Path) -> Case:
        logs = husky.load(data / "husky", ground)
        fit, held_out = logs.split(held_out=logs.names[2::3])
        return Case(title, husky.SkidSteer(), fit, held_out, known, (husky.Scrub(), husky.TurningDrag()))

    return case


CASES: dict[str, Callable[[Path], Case]] = {
    "emps": emps,
    "tra_A": _robotrace("tra_A"),
    "tra_C_fan": _robotrace("tra_C_fan"),
    "rot_A": _robotrace("rot_A"),
    "rot_B": _robotrace("rot_B"),
    "bam_xl330": bam_xl330,
    "husky_wetgrass": _husky(
        "wetgrass", "Husky on wet grass", "turning costs more than driving straight: wheels dragged sideways (scrub)"
    ),
    "husky_wheels_up": _husky("wheels_up", "Husky, wheels off the ground", "the same robot with nothing to scrub on"),
}


def _figures(found: Explanation, seconds: float) -> dict:
    return {
        "verdict": found.verdict,
        "sentence": found.sentence,
        "where": found.localisation.sentence if found.localisation else "",
        "before": found.before.normalised_rms,
        "after": found.after.normalised_rms,
        "errors": {n: [h.by_channel[n] * h.noise[n] for h in (found.before, found.after)] for n in found.before.noise},
        "effects": [
            {"id": e.id, "sentence": e.sentence, "equivalent": list(e.equivalent_to),
             "parameters": {name: asdict(p) for name, p in e.parameters.items()}}
            for e in found.effects
        ],
        "refitted": [[[t.id, t.held_out.normalised_rms] for t in step.trials] for step in found.search.steps],
        "moved": {name: [before.value, after.value] for name, (before, after) in found.moved.items()},
        "seconds": seconds,
    }  # fmt: skip


def pushes(found: Explanation, data: Path) -> dict:
    """The missing force in the validation record, whose pulses of force (half a second each) are taken out of the logged
    input here: its mean during the pulses and between them, against the pulses' own height."""
    record = load_emps(data / "emps", "DATA_EMPS_PULSES")
    logs = LogSet(_emps_logs(replace(record, vir=record.vir - record.pulse), "validation"))
    pulses = LogSet(_emps_logs(replace(record, vir=record.pulse), "validation"))
    true = np.concatenate([log.inputs[:, 0] for log in pulses])
    force = np.concatenate([history.force[:, 0] for history in missing_force(found.model, logs)])
    on = true > 0.5 * true.max()
    slope = float(np.cov(force, true)[0, 1] / np.var(true))
    return {
        "pulses": int(np.sum(np.diff(on.astype(int)) == 1)),
        "height": float(true.max()),
        "during": float(np.mean(force[on])),
        "between": float(np.mean(force[~on])),
        "share": slope,
        "correlation": float(np.corrcoef(force, true)[0, 1]),
    }


def pushes_text(p: dict) -> str:
    """What `pushes` found, in words."""
    return (
        f"In the validation record {p['pulses']} pulses of {p['height']:.0f} N push the carriage for half a second "
        f"each. Taken out of the logged input, they are left to the missing force of the model found here: its mean is "
        f"{p['during']:.0f} N during the pulses and {p['between']:.0f} N between them, and it follows them with a "
        f"correlation of {p['correlation']:.3f}."
    )


def ladder(found: Explanation, data: Path) -> dict:
    """Position errors [rad] on the fitted and the held-out runs: baseline, what was found, and the authors' parameters."""
    case = bam_xl330(data)
    own = {"jaxid, baseline (M1)": found.baseline.robot, "jaxid, explained": found.final.robot}
    theirs = bam_ladder.published_robots(data / "bam_xl330")
    return {
        name: {"fitted": bam_ladder.errors(robot, case.fit), "held_out": bam_ladder.errors(robot, case.held_out)}
        for name, robot in (own | theirs).items()
    }


EXTRAS: dict[str, tuple[str, Callable[[Explanation, Path], Any], Callable[[Any], str]]] = {
    "emps": ("pushes", pushes, pushes_text),
    "bam_xl330": ("ladder", ladder, bam_ladder.text),
    "husky_wetgrass": ("turning", lambda found, data: husky.turning_costs(data / "husky", "wetgrass"), husky.text),
    "husky_wheels_up": ("turning", lambda found, data: husky.turning_costs(data / "husky", "wheels_up"), husky.text),
}
"""Per set what else is measured: its name in the results, how it is measured, and how the page tells it."""


def _section(name: str, case: Case, figures: dict) -> str:
    rows = [(e["sentence"],) for e in figures["effects"]]
    lines = [f"\n## {case.title}\n", f"Known: {case.known}.\n", figures["sentence"] + " " + figures["where"], ""]
    if rows:
        lines += [table(("what was added",), rows), ""]
        moved = ", ".join(f"{n} {a:.4g} to {b:.4g}" for n, (a, b) in figures["moved"].items())
        lines += [f"The robot's own parameters moved: {moved}.", ""]
    if "errors" in figures:
        units = case.robot.channels.units
        errors = ", ".join(f"{n} {a:.3g} to {b:.3g} {units.get(n, '')}" for n, (a, b) in figures["errors"].items())
        lines += [f"Held-out rms errors by channel, before and after: {errors}.", ""]
    if figures["refitted"]:
        tried = "; ".join(", ".join(f"{name} {rms:.2f}" for name, rms in step) for step in figures["refitted"])
        lines += [f"Refitted candidates and their held-out errors, step by step: {tried}.", ""]
    if name in EXTRAS:
        key, _, text = EXTRAS[name]
        lines += [text(figures[key]), ""]
    return "\n".join(lines)


def main() -> None:
    """Explain and write."""
    parser = argparse.ArgumentParser(description="Explain the recorded sets and write the page.")
    parser.add_argument("--data", type=Path, required=True, help="folder with one folder a set")
    parser.add_argument("--sets", nargs="+", choices=list(CASES), default=list(CASES))
    parser.add_argument("--page", action="store_true", help="write the page from the stored results")
    arguments = parser.parse_args()
    results = json.loads(RESULTS.read_text()) if RESULTS.is_file() else {}
    for name in () if arguments.page else arguments.sets:
        case = CASES[name](arguments.data)
        begin = time.perf_counter()
        fit = output_error(case.robot, case.fit)
        found = explain(fit, case.fit, case.held_out, effects=case.effects)
        results[name] = _figures(found, time.perf_counter() - begin)
        if name in EXTRAS:
            key, measure, _ = EXTRAS[name]
            results[name][key] = measure(found, arguments.data)
        print(f"{name}: {found.sentence}", flush=True)
        RESULTS.write_text(json.dumps(results, indent=1) + "\n")
    cases = {name: CASES[name](arguments.data) for name in CASES if name in results}
    results = {name: results[name] for name in cases}
    summary = table(
        ("set", "verdict", "added", "held-out error, times the noise", "gap closed"),
        [
            (case.title, r["verdict"], ", ".join(e["id"] for e in r["effects"]) or "-",
             f"{r['before']:.1f} to {r['after']:.1f}", f"{100 * (r['before'] - r['after']) / (r['before'] - 1):.0f} %")
            for case, r in zip(cases.values(), results.values(), strict=True)
        ],
    )  # fmt: skip
    text = f"""# Recordings explained

Written by `python -m benchmarks.explained --data ../shared/data`; digits in `benchmarks/results/explained.json`. Each set
was cut into logs to fit and held-out logs, the plain robot fitted, and `jaxid.explain` run on it, with no word about what
to look for; beside the catalogue it was handed a user's own candidates for BAM (three of the authors' friction terms) and
for Husky (two laws of resistance to turning). Most of these speeds were filtered before they were logged: their white noise
is tiny, and errors in units of it are large. What counts is how far they fall, and what remains is reported as unexplained.
Sets are run one at a time (`--sets`); what stands here of a set is from its last run.

{summary}
"""
    text += "".join(_section(name, case, results[name]) for name, case in cases.items())
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
