"""Do wrong answers say so? `python -m benchmarks.silent [--cases 2000]`, then `--report`.

Random robots in random units with random starts and good and poor logs, simulated by `reference/` (no code shared with the
models), fitted by output error as a user calls it. Counts results that are wrong and do not say so, and how often intervals
hold the truth where the data is adequate. Every finished case is a line of `benchmarks/results/silent.jsonl`; a run that is
stopped goes on where it was, cases that older code ran are run again, and two processes share the work with `--part 1/2` and
`--part 2/2`. `--report` writes `docs/silent.md`.

The code was mended after looking at those cases, so they say less and less about others. `--seed N` draws cases that nobody has
seen, and `--wide` from more robots, more hidden forces, and conditions with two things poor at a time; either goes to a file of
its own beside the first, and stays there as it was when the cases were new.
"""

import argparse
import hashlib
import json
import math
import os
import re
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

_ROW = r'^{"number": (\d+), .*"code": "([^"]*)"}$'
"""A whole row: its number comes first and the code's version last."""
_MAKING = ("__init__", "draw", "family", "judge", "other_robots", "own_robots", "robots")
"""Files of `benchmarks/cases` on which rows depend."""
_HOPELESS = ("one log in other units", "swapped sign")


def estimate(robot: jaxid.Robot, logs: jaxid.LogSet) -> jaxid.Fit:
    """What the README says: output error from the robot's own numbers, everything else by default."""
    return jaxid.output_error(robot, logs)


def results_of(seed: int, wide: bool = False) -> Path:
    """Where the rows of a draw go: those of the study itself, or a file of this draw's own."""
    return (
        RESULTS if seed == SEED and not wide else RESULTS.with_name(f"silent_{'wide' if wide else 'new'}_{seed}.jsonl")
    )


def rows_of(path: Path) -> list[dict]:
    """Finished cases, by number: of a case that was run again, the last row; a line that was cut short counts for nothing."""
    rows = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        rows[row["number"]] = row
    return [rows[number] for number in sorted(rows)]


def done_by(path: Path, code: str) -> set[int]:
    """Numbers of the cases that this version of the code has run, so far, in any process."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    return {int(number) for number, version in re.findall(_ROW, text, re.MULTILINE) if version == code}


def append(path: Path, row: dict) -> None:
    """One line at the end, in one piece, so that several processes may write to one file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cut_short = path.exists() and path.stat().st_size and not path.read_bytes().endswith(b"\n")
    line = "\n" * cut_short + json.dumps(finite(row), allow_nan=False) + "\n"
    descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
    try:
        os.write(descriptor, line.encode())
    finally:
        os.close(descriptor)


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
    """The version of the code that makes the rows (package, reference, cases and their judge; not the page that shows them):
    a hash of git's names for it, marked where files differ from what git has."""
    root = Path(__file__).parents[1]

    def git(*words: str) -> str:
        return subprocess.run(["git", "-C", str(root), *words], capture_output=True, text=True).stdout.strip()

    package = os.path.relpath(Path(jaxid.__file__).parent, root)
    made_by = [package, "reference", "benchmarks/silent.py", *(f"benchmarks/cases/{name}.py" for name in _MAKING)]
    names = git("rev-parse", *(f"HEAD:{path}" for path in made_by))
    return hashlib.sha1(names.encode()).hexdigest()[:7] + "+" * bool(git("status", "--porcelain", "--", *made_by))


def blocks(numbers: Sequence[int], arguments: argparse.Namespace) -> list[tuple[str, list[int]]]:
    """The wanted of these numbers, with their robot, a few hundred at a time, robot by robot: a block's cases share programs.

    Those in which one log is of another robot, so to say, come last: every rescue is tried on them.
    """
    found: dict[tuple[int, bool, str], list[int]] = {}
    for number in numbers:
        family, condition = kind(number, arguments.seed, arguments.wide)
        if arguments.family in (None, family) and (arguments.condition is None or arguments.condition in condition):
            found.setdefault((number // _CHUNK, condition in _HOPELESS, family), []).append(number)
    return [(key[-1], sorted(found[key])) for key in sorted(found)]


def in_turn(found: Sequence[tuple[str, list[int]]], part: int, parts: int) -> list[int]:
    """The order of one of several processes: all cases of its own robots, whose programs it alone compiles then, and those of
    the others' from the end, as far as left undone."""
    sizes = Counter({family: 0 for family, _ in found})
    for family, block in found:
        sizes[family] += len(block)
    loads = [0] * parts
    owner = {}
    for family, size in sorted(sizes.items(), key=lambda item: (-item[1], item[0])):
        owner[family] = loads.index(min(loads))
        loads[owner[family]] += size
    own = [number for family, block in found if owner[family] == part for number in block]
    others = [number for family, block in found if owner[family] != part for number in block]
    return own + others[::-1]


def main() -> None:
    """Run what is not done yet, or write the page."""
    parser = argparse.ArgumentParser(description="Do wrong answers say so?")
    parser.add_argument("--cases", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--numbers", type=int, nargs="+", help="these cases")
    parser.add_argument("--family", help="only this one")
    parser.add_argument("--condition", help="only conditions that hold this word")
    parser.add_argument("--seed", type=int, default=SEED, help="another one draws cases that nobody has seen")
    parser.add_argument("--wide", action="store_true", help="more robots, and two things poor at a time")
    parser.add_argument("--out", type=Path, help="by default a file of the draw's own")
    parser.add_argument(
        "--part", default="1/1", help="which of how many processes this is, such as 1/2; they may share --out"
    )
    parser.add_argument("--report", action="store_true", help="write docs/silent.md from what has been run")
    arguments = parser.parse_args()
    out = arguments.out or results_of(arguments.seed, arguments.wide)
    if arguments.report:
        others = sorted(RESULTS.parent.glob("silent_*_*.jsonl"))
        write(rows_of(arguments.out or RESULTS), PAGE, {path.stem: rows_of(path) for path in others})
        return
    count, begin, code = Counter(), time.perf_counter(), code_version()

    part, parts = (int(word) for word in arguments.part.split("/"))
    numbers = arguments.numbers or range(arguments.first, arguments.first + arguments.cases)
    # Shared out before anything is left out, so that a process that begins again has the share that it had.
    order = in_turn(blocks(numbers, arguments), part - 1, parts)
    left = len(set(order) - done_by(out, code))
    for number in order:
        if number in done_by(out, code):
            continue
        try:
            case = draw(number, arguments.seed, arguments.wide)
        except RuntimeError as error:  # the independent simulator gave up: no case
            print(f"{number}: {error}", flush=True)
            continue
        row = run(case, estimate) | {"code": code}
        append(out, row)
        count[row["outcome"]] += 1
        print(
            f"{number} {row['family']}, {row['condition']}: {row['outcome']} {' '.join(row.get('why', []))} "
            f"[{row.get('fit_error', 0):.3g} {row.get('held_out_error', 0):.3g}] {row.get('seconds', 0):.2f} s, "
            f"{sum(count.values())} of {left} in {time.perf_counter() - begin:.0f} s",
            flush=True,
        )
    print(dict(count), f"{time.perf_counter() - begin:.0f} s")


if __name__ == "__main__":
    main()
