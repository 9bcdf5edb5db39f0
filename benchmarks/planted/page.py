"""What came of the planted effects: a verdict for each, and the page."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..measured_sets import table

ROOT = Path(__file__).resolve().parents[2]
RESULTS, PAGE = ROOT / "benchmarks" / "results" / "planted.jsonl", ROOT / "docs" / "planted.md"
_NORMAL = 1.96
_ALIKE = ({"sensor_lag", "motor_lag"}, {"sensor_delay", "input_delay"})
"""What one axis can hardly tell apart: another of these is no new name for what was there before."""

Row = dict[str, Any]


def rows_of() -> list[Row]:
    """The last line of every case, in the order of the first."""
    found: dict[tuple[str, str], Row] = {}
    for line in RESULTS.read_text().splitlines() if RESULTS.is_file() else ():
        row = json.loads(line)
        found[row["set"], row["planted"]] = row
    return list(found.values())


def judged(row: Row, plain: Row) -> str:
    """What was said of a planted effect beside what is said of the recording as it came."""
    there = {effect["id"] for effect in plain["effects"]}
    there |= set().union(*(alike for alike in _ALIKE if alike & there))
    accepted = set(row["accepted"])
    said = [{effect["id"], *effect["equivalent"]} for effect in row["effects"]]
    named = any(names & accepted for names in said)
    others = [e["id"] for e, names in zip(row["effects"], said, strict=True) if not names & (accepted | there)]
    if others:
        return f"right, and {', '.join(others)} as well" if named else f"wrong: {', '.join(others)}"
    if named:
        return "right"
    return "right (nothing new)" if not accepted or row["may_be_absorbed"] else "missed"


def covered(row: Row, plain: Row) -> list[bool]:
    """Whether each planted size lies in the 95 % interval of its estimate, of mechanisms that were not there before."""
    there = {effect["id"] for effect in plain["effects"]}
    sizes = {(mechanism, name): size for mechanism, name, size in row["sizes"] if mechanism not in there}
    found = []
    for effect in row["effects"]:
        for name, (value, error) in effect["parameters"].items():
            size = next((s for (m, n), s in sizes.items() if m == effect["id"] and name.endswith(n)), None)
            if size is not None and error is not None:
                found.append(abs(value - size) <= _NORMAL * error)
    return found


def _said(row: Row) -> str:
    return ", ".join(" or ".join([e["id"], *e["equivalent"]]) for e in row["effects"]) or "-"


def write(rows: list[Row], cases: Mapping[str, int]) -> None:
    """The page, of so many `cases` a set, with nothing planted and with every effect."""
    plain = {row["set"]: row for row in rows if not row["planted"]}
    planted = [row for row in rows if row["planted"] and row["set"] in plain]
    verdicts = [judged(row, plain[row["set"]]) for row in planted]
    sizes = [one for row in planted for one in covered(row, plain[row["set"]])]
    right = sum(verdict.startswith("right") and " as well" not in verdict for verdict in verdicts)
    wrong = sum(verdict.startswith("wrong") for verdict in verdicts)
    run = [
        f"{name} ({sum(row['set'] == name for row in rows)} of {count})"
        for name, count in cases.items()
        if name in plain
    ]
    left = [name for name in cases if name not in plain]
    lines = [
        f"Cases run: {', '.join(run)}{'; not run yet: ' + ', '.join(left) if left else ''}.",
        "",
        f"{right} of {len(verdicts)} answers are right: what was planted is named, alone or in a declared set, and nothing "
        f"else is new; or nothing is new where nothing can be said. {sum(v == 'missed' for v in verdicts)} were missed, "
        f"{wrong} got only another name. The planted size lies in the 95 % interval of {sum(sizes)} of {len(sizes)} estimates.",
        "",
        table(
            ("set", "planted", "held-out error, times the noise", "named", "answer"),
            [
                (row["set"], row["planted"] or "nothing", f"{row['before']:.1f} to {row['after']:.1f}", _said(row),
                 judged(row, plain[row["set"]]) if row["planted"] and row["set"] in plain else "-")
                for row in rows
            ],
        ),
    ]  # fmt: skip
    PAGE.write_text(_HEAD + "\n".join(lines) + "\n", encoding="utf-8")


_HEAD = """# Effects planted in recordings

Written by `python -m benchmarks.planted --data ../shared/data`; a line a case in `benchmarks/results/planted.jsonl`. Into
recordings of real machines software plants what it can plant exactly: measurements that come late, through a filter, off by a
bias or a drift, scaled; commands replaced by those of which a dead zone, a limit or a weaker motor would have made the recorded
ones; and what is no effect, rows lost and coarse steps. `explain` is asked before and after, and what counts is what it names
then that it did not name before. Of what was named before, a motor's lag may become a sensor's and an input's delay a sensor's:
one axis can hardly tell them apart.

"""
