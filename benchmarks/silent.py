"""Do wrong answers say so? `python -m benchmarks.silent [--cases 2000]`, then `--report`.

Random robots in random units with random starts and good and poor logs, simulated by `reference/` (no code shared with the
models), fitted by output error as a user calls it. Counts results that are wrong and do not say so, and how often intervals
hold the truth where the data is adequate. Every finished case is a line of `benchmarks/results/silent.jsonl`; a run that is
stopped goes on where it was. `--report` writes `docs/silent.md`.
"""

import argparse
import json
import math
import time
from collections import Counter
from pathlib import Path

import jaxid
from benchmarks.cases.draw import draw
from benchmarks.cases.judge import run
from benchmarks.cases.page import write

RESULTS = Path(__file__).parent / "results" / "silent.jsonl"
PAGE = Path(__file__).parents[1] / "docs" / "silent.md"
SEED = 10


def estimate(robot: jaxid.Robot, logs: jaxid.LogSet) -> jaxid.Fit:
    """What the README says: output error from the robot's own numbers, everything else by default."""
    return jaxid.output_error(robot, logs)


def rows_of(path: Path) -> list[dict]:
    """Finished cases, by number."""
    if not path.exists():
        return []
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return sorted(rows, key=lambda row: row["number"])


def finite(value):
    """The value with None for every number that is not finite, as JSON can hold it."""
    if isinstance(value, dict):
        return {name: finite(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [finite(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def main() -> None:
    """Run what is not done yet, or write the page."""
    parser = argparse.ArgumentParser(description="Do wrong answers say so?")
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--family", help="only this one")
    parser.add_argument("--condition", help="only conditions that hold this word")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--report", action="store_true", help="write docs/silent.md from what has been run")
    arguments = parser.parse_args()
    if arguments.report:
        write(rows_of(arguments.out), PAGE)
        return
    done = {row["number"] for row in rows_of(arguments.out)}
    count, begin = Counter(), time.perf_counter()

    def wanted(family: str, condition: str) -> bool:
        right_family = arguments.family in (None, family)
        return right_family and (arguments.condition is None or arguments.condition in condition)

    for number in range(arguments.first, arguments.first + arguments.cases):
        if number in done:
            continue
        try:
            case = draw(number, arguments.seed, wanted)
        except RuntimeError as error:  # the independent simulator gave up: no case
            print(f"{number}: {error}", flush=True)
            continue
        if case is None:
            continue
        row = run(case, estimate)
        with arguments.out.open("a", encoding="utf-8") as file:
            file.write(json.dumps(finite(row), allow_nan=False) + "\n")
        count[row["outcome"]] += 1
        print(
            f"{number} {row['family']}, {row['condition']}: {row['outcome']} {' '.join(row.get('why', []))} "
            f"[{row.get('fit_error', 0):.3g} {row.get('held_out_error', 0):.3g}] {row.get('seconds', 0):.2f} s",
            flush=True,
        )
    print(dict(count), f"{time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()
