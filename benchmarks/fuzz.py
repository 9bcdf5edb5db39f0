"""At least 10,000 broken inputs and what becomes of them: `python -m benchmarks.fuzz`.

Every breakage of `benchmarks/fuzzing` on every good log, model files, mappings, random changes of bytes and cells, the
command line, and disks that fail. Writes `benchmarks/results/fuzz.json` and the section "Bad input" of
`docs/robustness.md`, and ends with exit status 1 if any case came out wrong. `--quick` takes a twentieth and writes
nothing.
"""

import argparse
import itertools
import json
import shutil
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

from benchmarks.fuzzing import corpus, disk, recordings
from benchmarks.fuzzing.corpus import Case
from benchmarks.fuzzing.good import good_logs
from benchmarks.fuzzing.judge import RIGHT, Outcome, Verdict, judge_log, reference

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks/results/fuzz.json"
PAGE = ROOT / "docs/robustness.md"
TITLE = "## Bad input"
_ROWS_SECONDS = 300


def _disk_cases(folder: Path) -> Iterator[tuple[str, Verdict]]:
    axis = next(good for good in good_logs() if good.robot == "axis")
    parts = (disk.reading, disk.writing, disk.full_disk)
    for part in parts:
        place = folder / part.__name__
        place.mkdir(mode=0o755)
        yield from part(place, axis)
    for number in range(60):
        yield "killed while it writes", disk.killed(folder, number)


def _cases(seeds: int, number: int, random: int, every: int) -> Iterator[Case]:
    """All cases; with `every` above 1 only each so-many-th of the corpus."""
    logs = corpus.broken_logs(seeds, number, fit_every=20)
    yield from itertools.islice(logs, 0, None, every)
    yield from corpus.mutated_logs(random, number)
    yield from recordings.broken_recordings(random // 4, number)
    yield from itertools.islice(corpus.broken_models(seeds, number), 0, None, every)
    yield from itertools.islice(corpus.broken_mappings(), 0, None, every)
    yield from corpus.commands(number, every)


def _rows(folder: Path) -> tuple[Verdict, float]:
    """A million rows, read, looked over and batched, and the processor seconds that took."""
    good = corpus.million_rows()
    path = folder / "million.csv"
    path.write_text(good.text)
    reference(good)
    begin = time.process_time()
    verdict = judge_log(path, good, harmless=True, seconds=_ROWS_SECONDS)
    return verdict, time.process_time() - begin


def _table(counts: dict[str, Counter[Outcome]]) -> str:
    right = (Outcome.SAME, Outcome.TOLD, Outcome.REFUSED)
    lines = ["| breakage | cases | same numbers | finding | one-sentence error | anything else |", "|" + " --- |" * 6]
    total: Counter[Outcome] = Counter()
    for kind, found in counts.items():
        lines.append(_row(kind, found, right))
        total += found
    return "\n".join([*lines, _row("**all**", total, right)])


def _row(kind: str, found: Counter[Outcome], right: tuple[Outcome, ...]) -> str:
    tried = sum(count for outcome, count in found.items() if outcome is not Outcome.UNSEEN)
    cells = [tried, *(found[outcome] for outcome in right), tried - sum(found[outcome] for outcome in right)]
    return f"| {kind} | " + " | ".join(f"{cell:,}" for cell in cells) + " |"


def _section(counts: dict[str, Counter[Outcome]], seconds: float) -> str:
    unseen = sum(found[Outcome.UNSEEN] for found in counts.values())
    return f"""{TITLE}

Written by `python -m benchmarks.fuzz`: good logs of three robots, recordings (ROS 1 and ROS 2 bags, MCAP, SQLite, data logs,
MATLAB files), model files and mappings, each broken on purpose (`benchmarks/fuzzing/` has every way in a line or two) or at
random, read, looked over by pre-flight and batched; every twentieth log goes on through integral least squares, others through
the command line. Each must end in the same numbers as the good one, in a finding of pre-flight, or in an error of one sentence
that names file and remedy. *Anything else* is a traceback, other numbers without a word, a hang, half a file, a harmless file
refused, or an error without its place.

{_table(counts)}

One log of a million rows took {seconds:.1f} processor seconds to read, look over and batch. {unseen:,} random changes are
not counted: they leave a file that plainly says another plausible number, which nobody could see. The same holds for faults
that no single log shows: a speed that is twice too large, degrees where the robot hardly turned, a clean end a few seconds
early, a measurement of another run of the same inputs. Limits of the constants in the robot's model file, and logs held out
with `--held-out`, are what catches these.

A killed run leaves files that are whole or as they were before; the hidden `.NAME.*.part` beside them can be deleted.
"""


def _write_page(section: str) -> None:
    """Put the section in the place of its former self, or at the end."""
    page = PAGE.read_text(encoding="utf-8") if PAGE.exists() else "# Robustness\n"
    before, found, after = page.partition(TITLE)
    rest = after[after.index("\n## ") :] if found and "\n## " in after else ""
    PAGE.write_text(f"{before.rstrip()}\n\n{section.rstrip()}\n{rest}", encoding="utf-8")


def main() -> int:
    """Try everything, count and write; the number of cases that came out wrong."""
    parser = argparse.ArgumentParser(description="What becomes of 10,000 broken inputs.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=2, help="times that each breakage is made of each log")
    parser.add_argument("--random", type=int, default=4000, help="random changes of logs")
    parser.add_argument("--quick", action="store_true", help="a twentieth, and nothing is written")
    arguments = parser.parse_args()
    every = 20 if arguments.quick else 1
    counts: dict[str, Counter[Outcome]] = defaultdict(Counter)
    names: dict[str, Counter[str]] = defaultdict(Counter)
    wrong: list[dict[str, str]] = []
    begin = last = time.perf_counter()

    def count(kind: str, name: str, source: str, verdict: Verdict) -> None:
        nonlocal last
        counts[kind][verdict.outcome] += 1
        names[f"{kind}: {name}"][verdict.outcome] += 1
        if verdict.outcome not in (*RIGHT, Outcome.UNSEEN):
            said = "".join(verdict.said.strip().splitlines()[-1:]).replace(f"{ROOT}/", "")
            wrong.append({"kind": kind, "name": name, "source": source, "outcome": verdict.outcome, "said": said})
            print(f"WRONG {kind}, {name}, {source}: {verdict.outcome} {verdict.said[-600:]}", flush=True)
        if time.perf_counter() - last > 10:
            last = time.perf_counter()
            done = sum(found.total() for found in counts.values())
            print(f"{done} cases, {len(wrong)} wrong, {last - begin:.0f} s; now {kind}: {name}", flush=True)

    with tempfile.TemporaryDirectory() as home:
        Path(home).chmod(0o755)
        for case in _cases(arguments.repeats, arguments.seed, arguments.random // every, every):
            folder = Path(home) / "case"
            folder.mkdir()
            count(case.kind, case.name, case.source, case.judge(folder))
            shutil.rmtree(folder)
        for name, verdict in _disk_cases(Path(home)):
            count("disk", name, "axis", verdict)
        verdict, rows_seconds = _rows(Path(home))
        count("size", "a million rows", "pioneer", verdict)

    print(_table(counts))
    tried = sum(found.total() - found[Outcome.UNSEEN] for found in counts.values())
    print(f"{tried} cases in {time.perf_counter() - begin:.0f} s, {len(wrong)} wrong; seed {arguments.seed}")
    if not arguments.quick:
        document = {
            "seed": arguments.seed,
            "cases": tried,
            "wrong": wrong,
            "million_rows_seconds": round(rows_seconds, 1),
            "by_kind": counts,
            "by_breakage": names,
        }
        RESULTS.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        _write_page(_section(counts, rows_seconds))
    return len(wrong)


if __name__ == "__main__":
    raise SystemExit(1 if main() else 0)
