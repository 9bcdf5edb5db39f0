"""PySINDy on the blind study's logs. `python -m benchmarks.naming_sindy [--set main] [--only axis] [--limit N] [--report]`.

What a user would reach for instead of `jaxid.explain`: the same cases (`benchmarks/naming.py`), files and nominal model,
the same baseline by output error; then PySINDy regresses the acceleration that the baseline leaves on a library
(`benchmarks/sindy/library.py`), and the surviving terms are read as effects (`readings.py`). Results are appended to
`benchmarks/results/naming_sindy_SET.jsonl`, one line a case; cases that stand there are not run again. `--report` writes
`benchmarks/results/naming_sindy.json` over the cases that both have run, which the page of the study shows.

PySINDy is set by what does best on the cases of `--set fast`; the page says what was changed after a look at `main`. Its
answers with FROLS (forward regression) are scored, which did better there; those with STLSQ, its default, stand beside them.
"""

import argparse
import sys
import tempfile
import time
from pathlib import Path

from .naming import FIRST_SEED, Plan, plans, results, run_left


def answer(robot, logs, held_out, setting) -> dict:
    """What PySINDy's surviving terms say of the logs, given the fitted `robot` and how PySINDy is set."""
    from jaxid.effects import catalogue

    from .sindy.model import library
    from .sindy.readings import read_all
    from .sindy.regression import identify

    found = identify(robot, logs, held_out, setting)
    known = {effect.id for effect in catalogue(robot)}
    read_as = read_all(library(robot), found.coefficients)
    terms = [
        [equation, label, value, [effect for effect in read_as[equation, label] if effect in known]]
        for (equation, label), value in found.coefficients.items()
    ]
    return {
        "terms": terms,
        "before": found.before.normalised_rms,
        "after": found.after.normalised_rms,
        "adequate_before": found.before.adequate,
        "adequate_after": found.after.adequate,
    }


def run(plan: Plan) -> dict:
    """Simulate, write, read, fit the baseline, ask PySINDy; what came of it."""
    import jaxid
    from jaxid.model_file import read_model

    from .hidden.cases import MODEL, make
    from .sindy.regression import Setting

    case = make(plan.robot, plan.effects, plan.seed)
    with tempfile.TemporaryDirectory() as folder:
        fit_files, held_out_files, model = case.write(Path(folder))
        begin, worked = time.perf_counter(), time.process_time()
        robot = read_model(model, MODEL[plan.robot]())
        logs = jaxid.read_logs([str(path) for path in fit_files], robot=plan.robot)
        held_out = jaxid.read_logs([str(path) for path in held_out_files], robot=plan.robot)
        fit = jaxid.output_error(robot, logs)
        between = time.perf_counter()
        found = answer(fit.robot, logs, held_out, Setting())
        end, spent = time.perf_counter(), time.process_time() - worked
        other = answer(fit.robot, logs, held_out, Setting(optimizer="STLSQ"))
    return {
        **plan.record(case.effects),
        **found,
        "seconds": round(end - begin, 1),
        "seconds_baseline": round(between - begin, 1),
        "seconds_processor": round(spent, 1),
        "stlsq": other,
    }


def main() -> None:
    """Run or report."""
    parser = argparse.ArgumentParser(description="PySINDy on the blind study of naming hidden effects.")
    parser.add_argument("--set", choices=list(FIRST_SEED), default="main")
    parser.add_argument("--only", default="", help="run cases whose name contains one of these (comma between)")
    parser.add_argument("--limit", type=int, default=None, help="most cases to run now")
    parser.add_argument("--report", action="store_true", help="write naming_sindy.json from the results")
    arguments = parser.parse_args()
    name = f"sindy_{arguments.set}"
    if arguments.report:
        from .sindy.score import write

        write({known: (results(known), results(f"sindy_{known}")) for known in ("main", "aside")})
        return
    chosen = [plan for plan in plans(arguments.set) if any(part in plan.name for part in arguments.only.split(","))]
    run_left(chosen, name, arguments.limit, run, _told)


def _told(entry: dict) -> str:
    named = sorted({effect for *_, effects in entry["terms"] for effect in effects})
    return f"{len(entry['terms'])} terms: {', '.join(named)}"


if __name__ == "__main__":
    sys.exit(main())
