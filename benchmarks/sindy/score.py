"""PySINDy's answers under the study's rules, beside jaxid's on the same cases."""

import json
from typing import Any

import numpy as np

from ..hidden.naming_page import answers, named_right, share, summary, visible
from ..naming import RESULTS

Entry = dict[str, Any]
GAIN = 0.05
"""Share of the held-out error that terms have to take away to count."""


def helps(entry: Entry) -> bool:
    """Whether terms survived that make the held-out error smaller by more than 5 %."""
    return bool(entry["terms"]) and entry["after"] < (1 - GAIN) * entry["before"]


def names(entry: Entry) -> list[set[str]]:
    """What the surviving terms are read as, one set of effects a term; terms without a name are left out."""
    return [set(effects) for *_, effects in entry["terms"] if effects] if helps(entry) else []


def as_study(entry: Entry) -> Entry:
    """The answer in the study's form, so that the study's own rules score it.

    Terms that could be the same effect are taken for it: sets that share effects are one name, what they share, so that
    few names account for all surviving terms. The verdict is `named` where anything is named, whatever is left after it
    (jaxid says `unexplained` there); `adequate` where no term helps, `unexplained` where only terms without a name do.
    """
    sets: list[set[str]] = []
    for found in sorted(names(entry), key=len):
        shared = next((k for k, known in enumerate(sets) if known & found), None)
        if shared is None:
            sets.append(found)
        else:
            sets[shared] = sets[shared] & found
    hidden = set(entry["hidden"])
    firsts = [sorted(found, key=lambda name: (name not in hidden, name)) for found in sets]
    verdict = "named" if sets else "unexplained" if helps(entry) else "adequate"
    return {
        **entry,
        "verdict": verdict,
        "named": [ordered[0] for ordered in firsts],
        "equivalent": {ordered[0]: ordered[1:] for ordered in firsts},
        "covered": {},
    }


def unexplained(entry: Entry) -> bool:
    """For an effect outside the catalogue: no term names anything."""
    return not names(entry)


def more(entries: list[Entry]) -> dict[str, Any]:
    """Figures of single effects besides the study's own, of either program's answers in the study's form."""
    single = [e for e in entries if e["kind"] == "single" and visible(e)]
    closed = [(e["before"] - e["after"]) / (e["before"] - 1) for e in single]
    return {
        "hidden effect among the names": share(single, lambda e: any(ids & set(e["hidden"]) for ids in answers(e))),
        "gap closed, median of all single effects": float(np.median(closed)) if closed else None,
    }


def figures(entries: list[Entry]) -> dict[str, Any]:
    """The study's figures for PySINDy's answers."""
    told = [as_study(entry) for entry in entries]
    single = [e for e in told if e["kind"] == "single" and visible(e)]
    outside = [e for e in told if e["kind"] == "outside" and visible(e)]
    found = [e for e in single if helps(e)]
    right = [e for e in single if named_right(e)]
    closed_right = [(e["before"] - e["after"]) / (e["before"] - 1) for e in right]
    return {
        **summary(told),
        "false alarms": share([e for e in told if e["kind"] == "complete"], helps),
        "outside the catalogue unexplained": share(outside, unexplained),
        "parameters inside their 95 % interval": None,
        "gap closed, median": float(np.median(closed_right)) if closed_right else None,
        **more(told),
        "processor seconds a case, median": float(np.median([e["seconds_processor"] for e in entries])),
        "terms a case, median where they help": float(np.median([len(e["terms"]) for e in found])) if found else None,
        "outside, unexplained or more than noise left": share(
            outside, lambda e: unexplained(e) or not e["adequate_after"]
        ),
    }


def by_effect(jaxid: list[Entry], sindy: list[Entry]) -> dict[str, list[int]]:
    """For every hidden single effect that shows: cases, named by jaxid, named by PySINDy."""
    found: dict[str, list[int]] = {}
    for ours, theirs in zip(jaxid, sindy, strict=True):
        if ours["kind"] == "single" and visible(ours):
            row = found.setdefault(next(iter(ours["hidden"])), [0, 0, 0])
            row[0] += 1
            row[1] += named_right(ours)
            row[2] += named_right(as_study(theirs))
    return dict(sorted(found.items()))


def write(sets: dict[str, tuple[dict[str, Entry], dict[str, Entry]]]) -> None:
    """Write `naming_sindy.json`: both programs' figures over the cases that both have run, by set."""
    report = {}
    for name, (jaxid, sindy) in sets.items():
        both = [case for case in jaxid if case in sindy and "error" not in jaxid[case] and "error" not in sindy[case]]
        if not both:
            continue
        ours, theirs = [jaxid[case] for case in both], [sindy[case] for case in both]
        report[name] = {
            "cases": both,
            "errors": sum("error" in entry for entry in sindy.values()),
            "jaxid": {**summary(ours), **more(ours)},
            "pysindy": figures(theirs),
            "pysindy, STLSQ": figures([{**entry, **entry["stlsq"]} for entry in theirs]),
            "by_effect": by_effect(ours, theirs),
        }
    path = RESULTS / "naming_sindy.json"
    path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"wrote {path.relative_to(RESULTS.parents[1])}")
