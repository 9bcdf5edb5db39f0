"""The page `docs/laws.md`: rates with their intervals by kind of case, by mechanism and law, and every case that went wrong."""

from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from benchmarks.hidden.naming_page import share, shown
from reference.noise import KINDS

from .judge import ROWS, SAME, Entry, answers, closed, law_right, outcome, right, sort, visible, wrong_as_fact
from .plans import Plan

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "laws.md"
TOLD = {"tuning": "for development", "main": "the table's", "set_aside": "looked at once, after the last change"}


def _quantile(entries: Iterable[Entry], q: float) -> float | None:
    found = [closed(entry) for entry in entries]
    return float(np.quantile(found, q)) if found else None


def figures(entries: list[Entry]) -> list[tuple[str, str, str]]:
    """Rows (figure, target, what was found) of a set of results."""
    entries = [e for e in entries if "verdict" in e]
    single = [e for e in entries if len(e["hidden"]) == 1 and not e["off"] and visible(e)]
    known = [e for e in single if law_right(e) is not None]
    rows: list[tuple[str, str, object]] = []

    def rate(text: str, target: str, some: Iterable[Entry], test: Callable[[Entry], object]) -> None:
        rows.append((text, target, share(some, lambda e: bool(test(e)))))

    strong = [e for e in single if e["strength"] != "weak"]
    rate("mechanism named, medium and strong", "≥ 97 %", strong, right)
    for sort_of_law in ("laws with a name", "laws without a common name", "drawn curves"):
        own = [e for e in strong if sort(next(iter(e["hidden"]))) == sort_of_law]
        rate(f"of them, {sort_of_law}", "", own, right)
    rate("mechanism named, weak", "≥ 90 %", [e for e in single if e["strength"] == "weak"], right)
    rate("a wrong mechanism named as fact", "≤ 1 %", single, wrong_as_fact)
    rows.append(("gap closed, median", "≥ 98 %", _quantile(single, 0.5)))
    rows.append(("gap closed, 10th percentile", "≥ 90 %", _quantile(single, 0.1)))
    curves = [e for e in known if sort(next(iter(e["hidden"]))) == "drawn curves"]
    rate(
        "law right, where one is told and the hidden one has a name",
        "≥ 90 %",
        [e for e in known if e not in curves],
        law_right,
    )
    rate("drawn curve told as a shape, where the mechanism is right", "", curves, law_right)
    rate("two laws, both named", "≥ 90 %", [e for e in entries if e["kind"] == "pair"], right)
    rate("three laws, all named", "≥ 75 %", [e for e in entries if e["kind"] == "triple"], right)
    for kind in KINDS:
        own = [e for e in entries if e["kind"] == "complete" and e["noise"] == kind]
        rate(f"false alarms on complete models, noise {kind.replace('_', '-')}", "≤ 2 %", own, lambda e: not right(e))
    off = [e for e in entries if e["off"] and not e["hidden"]]
    rate("complete, known constants 1 to 5 % off: nothing named, or wrong constants", "≥ 95 %", off, right)
    rate("of them, nothing named", "", off, lambda e: not e["named"])
    off = [e for e in entries if e["off"] and e["hidden"] and visible(e)]
    rate("hidden law, known constants 1 to 5 % off: named", "≥ 95 %", off, right)
    return [(text, target, shown(found, text)) for text, target, found in rows]


def _said(entry: Entry) -> str:
    names = []
    for name, ids in zip(entry["named"], answers(entry), strict=True):
        law = entry["laws"].get(name)
        names.append("/".join([name, *sorted(ids - {name})]) + (f" ({', '.join(law)})" if law else ""))
    return f"{entry['verdict']}: {', '.join(names) or 'no name'}"


def _by_law(entries: list[Entry]) -> list[str]:
    laws: dict[str, list[Entry]] = {}
    for entry in entries:
        if len(entry["hidden"]) == 1 and "verdict" in entry and not entry["off"]:
            laws.setdefault(next(iter(entry["hidden"])), []).append(entry)
    rows = []
    for law, own in sorted(laws.items()):
        seen = [e for e in own if visible(e)]
        said = ", ".join(f"{count} {word}" for word, count in Counter(outcome(e) for e in seen).most_common())
        rows.append(f"| {law.replace('/', ' | ')} | {sum(map(right, seen))} of {len(seen)} | {said} |")
    return rows


def _failures(entries: list[Entry]) -> list[str]:
    rows = []
    for entry in sorted(entries, key=lambda e: e["case"]):
        if "error" in entry:
            rows.append(f"| {entry['case']} | error | {entry['error']} | |")
        elif "verdict" in entry and not right(entry) and (not entry["hidden"] or visible(entry)):
            rms = f"{entry['before']:.2f} → {entry['after']:.3f}"
            rows.append(f"| {entry['case']} | {outcome(entry)} | {_said(entry)} | {rms} |")
    return rows


def _of_set(name: str, entries: list[Entry], planned: list[Plan]) -> str:
    kinds = Counter(plan.kind for plan in planned)
    ran = ", ".join(f"{kind} {sum(e['kind'] == kind for e in entries)} of {count}" for kind, count in kinds.items())
    broken = sum("error" in e for e in entries)
    unseen = sum("unseen" in e or "verdict" in e and bool(e["hidden"]) and not visible(e) for e in entries)
    seconds = [e["seconds"] for e in entries if "verdict" in e]
    tried = [e for e in entries if "verdict" in e and (not e["hidden"] or visible(e))]
    counts = Counter(e["code"] for e in tried)
    codes = ", ".join(
        f"{code} ({sum(right(e) for e in tried if e['code'] == code)} right of {n})" for code, n in counts.items()
    )
    table = "\n".join(f"| {text} | {target} | {found} |" for text, target, found in figures(entries) if found != "-")
    header = "| figure | target | found |\n| --- | --- | --- |"
    return f"""
## {name.replace("_", " ").capitalize()} ({TOLD[name]})

Cases run: {ran}. {broken} ended with an error; in {unseen} what was hidden does not show:
the baseline absorbs it.
Median time of fit and explanation {np.median(seconds) if seconds else float("nan"):.0f} s. Code (git's name for the
package), and what each got right: {codes}.

{header}
{table}

| mechanism | law | named | outcomes |
| --- | --- | --- | --- |
{chr(10).join(_by_law(entries))}

### Cases that went wrong

| case (robot/kind/mechanism/law/strength/noise/seed) | outcome | said | held-out RMS |
| --- | --- | --- | --- |
{chr(10).join(_failures(entries)) or "| none | | | |"}
"""


def text(found: dict[str, dict[str, Entry]], planned: dict[str, list[Plan]]) -> str:
    """The page from the results of each set."""
    same = "; ".join(f"{law}: {', '.join(sorted(ids))}" for law, ids in sorted(SAME.items()))
    rows = "; ".join(", ".join(sorted(row)) for row in ROWS)
    sets = "".join(_of_set(name, list(own.values()), planned[name]) for name, own in found.items() if own)
    return f"""# Laws that others wrote

Written by `python -m benchmarks.laws --report` from `benchmarks/results/laws_*.jsonl`, which `python -m benchmarks.laws`
appends to, case by case; none that was run is left out. Every case is simulated by the independent simulator in
`reference/` with a part that follows a law of `reference/law_table.py`, written without a look at the catalogue's formulas:
several formulas of each mechanism, laws of one wheel, motor or channel alone, and drawn curves, which are no published law.
Constants, noise level, excitation and what is not strength are drawn from the seed; six logs to fit and three held out,
25 s at 50 Hz. The strength is found on each case: weak, medium and strong are 1.5, 3 and 8 times the noise on held-out
logs once the baseline has absorbed what it can.

A case is right if the verdict is `named` or `ambiguous`, every hidden mechanism is named, exactly or in a declared set (where
known constants are off, one that holds wrong constants of the table is right, too),
and nothing else is. Names that are right besides the mechanism's own: {same}. Neighbours, which do not count as right:
{rows}. `right, not believed`: only right names, but the verdict is `unexplained`; `right among others`: a right name beside
wrong ones, and the verdict `unexplained`. The gap closed is that of all single cases that show, right or not. Intervals are
Wilson's, 95 %.
{sets}"""


def write(found: dict[str, dict[str, Entry]], planned: dict[str, list[Plan]]) -> None:
    """Write the page."""
    PAGE.write_text(text(found, planned), encoding="utf-8")
    print(f"wrote {PAGE.relative_to(ROOT)}")
