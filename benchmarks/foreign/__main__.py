"""Explain logs that MuJoCo made. `python -m benchmarks.foreign [--only NAME,...] [--page]`.

Needs the extra `benchmarks`. Every case is driven in MuJoCo, written to CSV, read back, fitted and explained with nothing
but the files and the nominal model. Writes `benchmarks/results/foreign.json` and `docs/foreign.md`; `--only` runs some
cases anew and keeps the others' results, `--page` writes the page alone.
"""

import argparse
import json
import tempfile
import time
from importlib.metadata import version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "benchmarks" / "results" / "foreign.json"
PAGE = ROOT / "docs" / "foreign.md"


def run(case: Any) -> dict[str, Any]:
    """Simulate, write, read, fit, explain; what came of it."""
    import jaxid
    from jaxid.model_file import read_model

    from .cases import constants, write

    with tempfile.TemporaryDirectory() as folder:
        files = write(case, Path(folder))
        begin = time.perf_counter()
        robot = read_model(files.model, jaxid.Pioneer())
        logs = jaxid.read_logs([str(path) for path in files.fit], robot="pioneer")
        held_out = jaxid.read_logs([str(path) for path in files.held_out], robot="pioneer")
        fit = jaxid.output_error(robot, logs)
        found = jaxid.explain(fit, logs, held_out, effects=case.effects)
        seconds = time.perf_counter() - begin
    true = constants(case.seed)
    true["Cs"] += case.world.extra_loss / 2.0  # the model's one constant stands for both wheels
    final = {name: found.final[name] for name in found.baseline.free_names if name in found.final.parameters}
    return {
        "told": case.told,
        "answer": case.answer,
        "true": dict(case.true),
        "largest_slip": files.largest_slip,
        "slipping": files.slipping,
        "verdict": found.verdict,
        "named": [effect.id for effect in found.effects],
        "equivalent": {effect.id: list(effect.equivalent_to) for effect in found.effects},
        "parameters": {
            f"{effect.id}.{name}": [estimate.value, estimate.std_error]
            for effect in found.effects
            for name, estimate in effect.parameters.items()
            if estimate.status != "fixed"
        },
        "before": found.before.normalised_rms,
        "after": found.after.normalised_rms,
        "by_channel": {
            name: [found.before.by_channel[name], found.after.by_channel[name]] for name in ("eta1", "eta2")
        },
        "p_white_after": found.after.p_white,
        "first_look": [[c.effect.id, round(c.share, 3)] for c in found.search.first_look[:4]],
        "estimates": {name: [e.value, e.std_error, true[name]] for name, e in final.items()},
        "sentence": found.sentence,
        "where": found.localisation.sentence if found.localisation is not None else "",
        "seconds": round(seconds, 1),
    }


def main() -> None:
    """Run the cases, or some of them, and write the results and the page."""
    from .page import page

    parser = argparse.ArgumentParser(prog="python -m benchmarks.foreign", description="Explain MuJoCo's logs.")
    parser.add_argument("--only", default="", help="names of cases, comma between")
    parser.add_argument("--page", action="store_true", help="write the page from the stored results")
    options = parser.parse_args()
    stored = json.loads(RESULTS.read_text(encoding="utf-8")) if RESULTS.is_file() else {"cases": {}}
    if not options.page:
        from .agreement import agreement
        from .cases import CASES

        stored["versions"] = {"mujoco": version("mujoco"), "jax": version("jax")}
        stored["agreement"] = agreement()
        chosen = [case for case in CASES if not options.only or case.name in options.only.split(",")]
        for case in chosen:
            entry = stored["cases"][case.name] = run(case)
            names = ", ".join(entry["named"]) or "no name"
            told = f"{entry['verdict']}, {names}, {entry['before']:.2f} -> {entry['after']:.3f}"
            print(f"{case.name}: {told} ({entry['seconds']} s)", flush=True)
            ordered = {case.name: stored["cases"][case.name] for case in CASES if case.name in stored["cases"]}
            RESULTS.write_text(json.dumps(stored | {"cases": ordered}, indent=1) + "\n", encoding="utf-8")
    PAGE.write_text(page(json.loads(RESULTS.read_text(encoding="utf-8"))), encoding="utf-8")


if __name__ == "__main__":
    main()
