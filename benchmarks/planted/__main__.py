"""Plant effects in recordings and explain them: `python -m benchmarks.planted --data ../shared/data` (`--sets`, `--report`).

Writes a line a case to `benchmarks/results/planted.jsonl` as it goes, of which the last counts, and `docs/planted.md`.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import jaxid
from jaxid import LogSet
from jaxid.explanation.explanation import Explanation

from .page import RESULTS, rows_of, write
from .plants import Planted
from .sets import COUNTS, SETS, Recorded


def _explained(case: Recorded, planted: Planted | None) -> Explanation:
    fit, held_out = (
        logs if planted is None else LogSet(planted.plant(log) for log in logs) for logs in (case.fit, case.held_out)
    )
    return jaxid.explain(jaxid.output_error(case.robot, fit), fit, held_out, effects=case.effects)


def _row(name: str, planted: Planted | None, found: Explanation, seconds: float) -> dict[str, Any]:
    return {
        "set": name,
        "planted": planted.name if planted else "",
        "accepted": list(planted.mechanisms) if planted else [],
        "may_be_absorbed": bool(planted and planted.may_be_absorbed),
        "sizes": [[*key, size] for key, size in planted.sizes.items()] if planted else [],
        "verdict": found.verdict,
        "before": found.before.normalised_rms,
        "after": found.after.normalised_rms,
        "effects": [
            {
                "id": effect.id,
                "law": effect.law,
                "equivalent": list(effect.equivalent_to),
                "parameters": {n: [p.value, p.std_error] for n, p in effect.parameters.items()},
            }
            for effect in found.effects
        ],
        "seconds": seconds,
    }


def main() -> None:
    """Plant, explain, judge, write."""
    parser = argparse.ArgumentParser(description="Plant effects in recordings of real machines and explain them.")
    parser.add_argument("--data", type=Path, help="folder with one folder a set")
    parser.add_argument("--sets", nargs="+", choices=list(SETS), default=list(SETS))
    parser.add_argument("--only", nargs="+", default=[], help="names of what is planted; '' is nothing")
    parser.add_argument("--report", action="store_true", help="write the page from the stored results")
    arguments = parser.parse_args()
    if not arguments.report and arguments.data is None:
        parser.error("give --data, the folder with one folder a set")
    for name in () if arguments.report else arguments.sets:
        case = SETS[name](arguments.data)
        for planted in (None, *case.planted):
            if arguments.only and (planted.name if planted else "") not in arguments.only:
                continue
            begin = time.perf_counter()
            row = _row(name, planted, _explained(case, planted), time.perf_counter() - begin)
            with RESULTS.open("a") as file:
                file.write(json.dumps(row) + "\n")
            told = [(e["id"], e["law"], e["equivalent"], e["parameters"]) for e in row["effects"]]
            print(
                f"{name}, {row['planted'] or 'nothing planted'}: {row['before']:.1f} to {row['after']:.1f}, {told}",
                flush=True,
            )
    write(rows_of(), COUNTS)


if __name__ == "__main__":
    main()
