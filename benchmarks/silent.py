"""Do wrong answers say so? `python -m benchmarks.silent [--cases 2000]`, then `--report`.

Random robots in random units with random starts and good and poor logs, simulated by `reference/` (no code shared with the
models), fitted by output error as a user calls it. Counts results that are wrong and do not say so, and how often intervals
hold the truth where the data is adequate. Every finished case is a line of `benchmarks/results/silent.jsonl`; a run that is
stopped goes on where it was. `--report` writes `docs/silent.md`.
"""

import argparse
import json
import math
import subprocess
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import jaxid
from benchmarks.cases.draw import draw, kind
from benchmarks.cases.judge import run
from benchmarks.cases.page import write

RESULTS = Path(__file__).parent / "results" / "silent.jsonl"
PAGE = Path(__file__).parents[1] / "docs" / "silent.md"
SEED = 10
_CHUNK = 500
"""Cases that are done robot by robot before the next ones are begun."""

_HOPELESS = ("one log in other units", "swapped sign")


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


def code_version() -> str:
    """The version of the package that makes the rows: git's name for its tree, marked where files differ from it."""
    package = Path(jaxid.__file__).parent

    def git(*words: str) -> str:
        return subprocess.run(["git", "-C", str(package), *words], capture_output=True, text=True).stdout.strip()

    return git("rev-parse", "--short", "HEAD:./") + "+" * bool(git("status", "--porcelain", "."))


def by_kind(numbers: Sequence[int], arguments: argparse.Namespace) -> list[int]:
    """The wanted of these numbers, a few hundred at a time, one robot after the other, so that cases share programs.

    Those in which one log is of another robot, so to say, come last: every rescue is tried on them.
    """
    kinds = {number: kind(number, arguments.seed) for number in numbers}
    wanted = [
        number
        for number, (family, condition) in kinds.items()
        if arguments.family in (None, family) and (arguments.condition is None or arguments.condition in condition)
    ]
    return sorted(wanted, key=lambda n: (n // _CHUNK, kinds[n][1] in _HOPELESS, kinds[n][0], n))


def main() -> None:
    """Run what is not done yet, or write the page."""
    parser = argparse.ArgumentParser(description="Do wrong answers say so?")
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--numbers", type=int, nargs="+", help="these cases")
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
    count, begin, code = Counter(), time.perf_counter(), code_version()
    numbers = arguments.numbers or range(arguments.first, arguments.first + arguments.cases)
    for number in by_kind([n for n in numbers if n not in done], arguments):
        try:
            case = draw(number, arguments.seed)
        except RuntimeError as error:  # the independent simulator gave up: no case
            print(f"{number}: {error}", flush=True)
            continue
        row = run(case, estimate) | {"code": code}
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
