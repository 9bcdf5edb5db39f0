"""Which verdicts change when a number of `Policy` is half as large again, or smaller by that? `python -m benchmarks.policy`.

Cases are tuning cases of `benchmarks.laws` (laws that others wrote) and complete models with noise of several kinds. Every
case is explained with the usual numbers, then with each number times 1.5 and divided by 1.5; refits and first looks of the
same model from the same start are done once. A verdict is what is said, the names, and the sets declared alike. Results are
appended to `benchmarks/results/policy.jsonl`, one line a case; `--report` prints a page about it.
"""

import argparse
import importlib
import json
import tempfile
import time
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from benchmarks.silent import append

RESULTS = Path(__file__).parent / "results" / "policy.jsonl"
TIMES = 1.5
CASES = (
    "axis/quick/stribeck_friction", "pioneer/quick/surface_change", "omni/quick/motor_lag/one_motor",
    "pioneer/quick/motor_gain_mismatch/torque_constant", "omni/quick/surface_change/gradual",
    "axis/quick/actuator_dead_zone/unequal", "pioneer/quick/sensor_bias", "omni/quick/voltage_saturation",
    "axis/complete", "pioneer/complete", "omni/complete", "axis/pair", "pioneer/pair",
)  # fmt: skip
"""What the first case of each kind of the tuning set is taken of."""


def changed(name: str, value: float, times: float) -> float | None:
    """The number `name` of a policy, changed; None where it has no such value."""
    new = value * times
    if isinstance(value, int):
        new = max(round(new), 1)
        return None if new == value else new
    if value > 1.0 and name not in ("separated", "many"):  # a normalised RMS, whose floor is one
        return 1.0 + (value - 1.0) * times
    return min(new, 0.99) if name == "alike" else new


def variants() -> dict[str, Any]:
    """The usual policy and all changed ones, by name."""
    from jaxid.explanation.policy import Policy

    usual = Policy()
    found: dict[str, Any] = {"usual": usual}
    for entry in fields(Policy):
        for label, times in (("larger", TIMES), ("smaller", 1 / TIMES)):
            value = changed(entry.name, getattr(usual, entry.name), times)
            if value is not None:
                found[f"{entry.name} {label}"] = replace(usual, **{entry.name: value})
    return found


_answers: dict[Any, Any] = {}


def remembered(function: Callable, key: Callable[..., Any]) -> Callable:
    """The function, whose answer to the same question about the same case is looked up."""

    def ask(*arguments, **options):
        question = function, key(*arguments, **options)
        if question not in _answers:
            _answers[question] = function(*arguments, **options)
        return _answers[question]

    return ask


def _numbers(*mappings) -> tuple:
    return tuple(tuple(sorted((name, float(value)) for name, value in own.items())) for own in mappings)


def _robot(robot) -> tuple:
    return robot.structure, robot.parameters


def _states(states) -> tuple:
    return tuple(sorted((log, *_numbers(own)) for log, own in states.items()))


def remember_everything() -> None:
    """Let `explain` look up refits and first looks that it has made before of a case's logs."""
    explain_module, refit_module, search_module = (
        importlib.import_module(f"jaxid.explanation.{name}") for name in ("explain", "refits.refit", "search.search")
    )
    from jaxid.explanation.policy import current_policy
    from jaxid.explanation.screening.screen import screen

    def of_refit(robot, starts, logs, held_out, noise, initial_states, max_steps=25, rival=float("inf"), angles=None):
        own = tuple(_numbers(start) for start in starts)
        where = logs.names, held_out.names, _states(initial_states), bool(angles)
        return _robot(robot), own, where, max_steps, rival, current_policy().negligible

    def of_screen(robot, logs, effects, noise, known_states, angles=None):
        where = logs.names, _states(known_states), bool(angles)
        return _robot(robot), tuple(effects), where, current_policy().formula

    refit = remembered(refit_module.refit, of_refit)
    refit_module.refit = search_module.refit = refit
    search_module.screen = remembered(screen, of_screen)
    in_full = explain_module.in_full
    explain_module.in_full = remembered(
        in_full, lambda trial, *rest, **options: (_robot(trial.robot), bool(trial.angles))
    )
    # What decides nothing.
    explain_module.localise = explain_module._next = lambda *arguments, **options: None
    explain_module._constants = lambda *arguments: {}


def said(found) -> dict[str, Any]:
    """What an explanation says, as far as it decides anything."""
    return {
        "verdict": found.verdict,
        "names": sorted(effect.id for effect in found.effects),
        "alike": {effect.id: sorted(effect.equivalent_to) for effect in found.effects},
    }


def run(plan) -> dict[str, Any]:
    """One case by all policies."""
    import jaxid
    from benchmarks.hidden.cases import MODEL
    from benchmarks.laws.cases import make
    from benchmarks.laws.sizes import size_of
    from jaxid.model_file import read_model

    sizes = {law: size_of(plan.robot, law, plan.strength, plan.seed, k)[0] for k, law in enumerate(plan.laws)}
    case = make(plan.robot, sizes, plan.seed, noise_kind=plan.noise, constants_off=plan.off)
    with tempfile.TemporaryDirectory() as folder:
        fit_files, held_out_files, model = case.write(Path(folder))
        robot = read_model(model, MODEL[plan.robot]())
        logs = jaxid.read_logs([str(path) for path in fit_files], robot=plan.robot)
        held_out = jaxid.read_logs([str(path) for path in held_out_files], robot=plan.robot)
        fit = jaxid.output_error(robot, logs)
        _answers.clear()
        found: dict[str, Any] = {}
        for name, policy in variants().items():
            begin = time.perf_counter()
            found[name] = said(jaxid.explain(fit, logs, held_out, policy=policy))
            same = "" if found[name] == found["usual"] else f" {found[name]}"
            print(f"  {name}: {time.perf_counter() - begin:.1f} s{same}", flush=True)
    return {"case": plan.name, "hidden": list(case.effects), "said": found}


def _what(entry: dict[str, Any]) -> str:
    names = [" or ".join([name, *entry["alike"][name]]) for name in entry["names"]]
    return f"{entry['verdict']}{': ' if names else ''}{', '.join(names)}"


def page(results: list[dict[str, Any]]) -> str:
    """What came of it, in Markdown."""
    from jaxid.explanation.policy import Policy

    lines = [
        "# The numbers by which an explanation decides", "",
        "By `python -m benchmarks.policy --report` from `benchmarks/results/policy.jsonl`. `explain(..., policy=Policy(...))` "
        "takes other numbers; "
        "what each means stands at `jaxid.explanation.policy.Policy`.", "",
        f"{len(results)} cases, each explained with the usual numbers and with every one times and divided by {TIMES} "
        "(what lies above one, as a normalised RMS does, by its distance from one). `same` counts the cases in which the "
        "verdict, the names and the sets declared alike are the same.", "",
        "| number | usual | same, larger | same, smaller |", "| --- | --- | --- | --- |",
    ]  # fmt: skip
    for entry in fields(Policy):
        cells = []
        for label in ("larger", "smaller"):
            own = [case["said"] for case in results if f"{entry.name} {label}" in case["said"]]
            same = sum(each[f"{entry.name} {label}"] == each["usual"] for each in own)
            cells.append(f"{same} of {len(own)}" if own else "–")
        lines.append(f"| `{entry.name}` | {getattr(Policy(), entry.name):g} | {' | '.join(cells)} |")
    lines += ["", "## What changed", "", "| case | usual | changed number | then |", "| --- | --- | --- | --- |"]
    for case in results:
        usual = case["said"]["usual"]
        for name, entry in case["said"].items():
            if entry != usual:
                lines.append(f"| {case['case']} | {_what(usual)} | {name} | {_what(entry)} |")
    lines += ["", "## The cases", "", "| case | usual |", "| --- | --- |"]
    lines += [f"| {case['case']} | {_what(case['said']['usual'])} |" for case in results]
    return "\n".join(lines) + "\n"


def results() -> list[dict[str, Any]]:
    """What stands in the file."""
    return [json.loads(line) for line in RESULTS.read_text(encoding="utf-8").splitlines()] if RESULTS.is_file() else []


def main() -> None:
    """Run what is not there yet, or report."""
    parser = argparse.ArgumentParser(description="How much verdicts hang on the numbers of Policy.")
    parser.add_argument("--only", default="", help="cases whose name contains this")
    parser.add_argument("--report", action="store_true", help="print what came of it")
    arguments = parser.parse_args()
    if arguments.report:
        print(page(results()))
        return
    from benchmarks.laws.plans import plans

    every = plans("tuning")
    chosen = [next(plan for plan in every if plan.name.startswith(case)) for case in CASES]
    remember_everything()
    there = {entry["case"] for entry in results()}
    for plan in chosen:
        if plan.name not in there and arguments.only in plan.name:
            print(plan.name, flush=True)
            append(RESULTS, run(plan))


if __name__ == "__main__":
    main()
