"""Is the mechanism named whoever wrote its law? `python -m benchmarks.laws [--set tuning|main|set_aside] [--part k/n]`.

Every case is simulated by `reference/` with a law of `reference.law_table`, none of which is the catalogue's own formula,
written to CSV, read back, fitted and explained with nothing but the files and the nominal model. Results are appended to
`benchmarks/results/laws_SET.jsonl`, one line a case; cases that stand there are not run again, so that a study can be stopped,
resumed and shared out. Without `--kind` the quick cases run alone: each law once, at medium strength. `--report` writes
`docs/laws.md` from the files, `--sizes` only finds how large the hidden laws have to be.
"""

import argparse
import json
import subprocess
import tempfile
import time
import traceback
from pathlib import Path

import jax
import numpy as np

from benchmarks.silent import append

from .judge import outcome
from .plans import FIRST_SEED, Plan, plans

RESULTS = Path(__file__).parents[1] / "results"
KINDS = ("quick", "strength", "complete", "constants", "pair", "triple")
SHOWS = 1.15
"""RMS of the fitted baseline below which the largest size that is allowed does not show, and nothing is explained."""
_FORGET = 10
"""Cases after which compiled programs are forgotten."""


def code_version() -> str:
    """Git's name for the package that explains, marked where its files differ from it."""
    root = Path(__file__).parents[2]

    def git(*words: str) -> str:
        return subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True).stdout.strip()

    return git("rev-parse", "--short=9", "HEAD:jaxid") + "+" * bool(git("status", "--porcelain", "--", "jaxid"))


def record(plan: Plan) -> dict:
    """What a line says of the case itself."""
    own = {"robot": plan.robot, "kind": plan.kind, "strength": plan.strength, "seed": plan.seed}
    return {"case": plan.name, **own, "noise": plan.noise, "off": plan.off, "hidden": {law: {} for law in plan.laws}}


def run(plan: Plan) -> dict:
    """Simulate, write, read, fit, explain; what came of it."""
    import jaxid
    from benchmarks.hidden.cases import MODEL
    from jaxid.model_file import read_model

    from .cases import make
    from .sizes import size_of

    sizes = {law: size_of(plan.robot, law, plan.strength, plan.seed, k) for k, law in enumerate(plan.laws)}
    shown_as = [rms for _, rms in sizes.values()]
    if shown_as and max(shown_as) < SHOWS:
        return {**record(plan), "unseen": max(shown_as)}
    laws = {law: size for law, (size, _) in sizes.items()}
    case = make(plan.robot, laws, plan.seed, noise_kind=plan.noise, constants_off=plan.off)
    with tempfile.TemporaryDirectory() as folder:
        fit_files, held_out_files, model = case.write(Path(folder))
        begin = time.perf_counter()
        robot = read_model(model, MODEL[plan.robot]())
        logs = jaxid.read_logs([str(path) for path in fit_files], robot=plan.robot)
        held_out = jaxid.read_logs([str(path) for path in held_out_files], robot=plan.robot)
        fit = jaxid.output_error(robot, logs)
        found = jaxid.explain(fit, logs, held_out)
        seconds = time.perf_counter() - begin
    return {
        **record(plan),
        "hidden": case.effects,
        "verdict": found.verdict,
        "named": [effect.id for effect in found.effects],
        "equivalent": {effect.id: list(effect.equivalent_to) for effect in found.effects},
        "laws": {effect.id: _laws(effect) for effect in found.effects},
        "before": found.before.normalised_rms,
        "after": found.after.normalised_rms,
        "refitted": [
            [[t.id, round(t.held_out.normalised_rms, 4), round(t.score, 1)] for t in step.trials[:6]]
            for step in found.search.steps
        ],
        "doubts": list(found.doubts),
        "final": found.final.judgement.verdict if found.final.judgement is not None else "",
        "seconds": round(seconds, 1),
    }


def _laws(effect) -> list[str]:
    """The law that an effect is said to follow and those that it cannot be told from, where the explanation says any."""
    return [law for law in (getattr(effect, "law", ""), *getattr(effect, "laws_alike", ())) if law]


def results(name: str) -> dict[str, dict]:
    """What stands in the set's file, by case; of a case that was run again, the last line."""
    path = RESULTS / f"laws_{name}.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return {entry["case"]: entry for entry in map(json.loads, filter(None, lines))}


def run_left(chosen: list[Plan], name: str, again: bool) -> None:
    """Run what has no result in the set's file yet, or none by this version of the package."""
    code = code_version()

    def there() -> set[str]:
        return {case for case, entry in results(name).items() if not again or entry["code"] == code}

    left = [plan for plan in chosen if plan.name not in there()]
    print(f"{len(chosen)} cases, {len(chosen) - len(left)} there already", flush=True)
    for count, plan in enumerate(left, start=1):
        if plan.name in there():  # another process had it
            continue
        begin = time.perf_counter()
        try:
            entry = run(plan)
        except Exception as error:  # one bad case must not end a study of hours
            traceback.print_exc()
            entry = {**record(plan), "error": f"{type(error).__name__}: {error}"}
        append(RESULTS / f"laws_{name}.jsonl", entry | {"code": code})
        said = (
            entry.get("error") or ""
            if "verdict" not in entry
            else f"{entry['verdict']}: {', '.join(entry['named'])} {entry['equivalent']}"
        )
        rms = f"{entry.get('before', np.nan):.2f} -> {entry.get('after', np.nan):.3f}"
        took = f"{entry.get('seconds')} of {time.perf_counter() - begin:.1f} s"
        print(f"[{count}/{len(left)}] {plan.name}: {outcome(entry)}; {said} ({rms}, {took})", flush=True)
        if count % _FORGET == 0:
            jax.clear_caches()


def main() -> None:
    """Run, find sizes, or report."""
    parser = argparse.ArgumentParser(description="Is the mechanism named whoever wrote its law?")
    parser.add_argument("--set", choices=list(FIRST_SEED), default="main")
    parser.add_argument("--kind", choices=(*KINDS, "all"), default="quick")
    parser.add_argument("--part", default="1/1", help="k/n: every n-th case from the k-th")
    parser.add_argument("--only", default="", help="cases whose name contains one of these (comma between)")
    parser.add_argument("--again", action="store_true", help="also what another version of the package has explained")
    parser.add_argument("--sizes", action="store_true", help="find the sizes of the hidden laws only")
    parser.add_argument("--report", action="store_true", help="write docs/laws.md")
    arguments = parser.parse_args()
    if arguments.report:
        from .page import write

        write({name: results(name) for name in FIRST_SEED}, {name: plans(name) for name in FIRST_SEED})
        return
    number, of = (int(part) for part in arguments.part.split("/"))
    kinds = KINDS if arguments.kind == "all" else (arguments.kind,)
    chosen = [plan for plan in plans(arguments.set) if plan.kind in kinds]
    chosen = [p for p in chosen[number - 1 :: of] if any(part in p.name for part in arguments.only.split(","))]
    if not arguments.sizes:
        run_left(chosen, arguments.set, arguments.again)
        return
    from .sizes import size_of

    for plan in chosen:
        for k, law in enumerate(plan.laws):
            print(plan.name, *size_of(plan.robot, law, plan.strength, plan.seed, k), flush=True)


if __name__ == "__main__":
    main()
