"""The measured logs, from files to figures.

    python benchmarks/measured.py --data ../shared/data --out docs/measured.md

Writes the page, its pictures into a folder of the page's name, and every figure to `benchmarks/results/measured.json`.
`--sets emps bam` runs some sets only (and then writes a page of those).
"""

import argparse
import json
from pathlib import Path

from measured_sets import Section, bam, emps, robojackets, robotrace, table

SETS = {"emps": emps, "robotrace": robotrace, "robojackets": robojackets, "bam_xl330": bam}
RESULTS = Path(__file__).parent / "results" / "measured.json"
_MARKS = {True: "yes", False: "no", None: ""}


def _page(sections: dict[str, Section]) -> str:
    rows = [row for section in sections.values() for row in section.rows]
    summary = table(
        ("quantity", "measured", "to compare with", "reached"),
        [(row.quantity, row.measured, row.reference, _MARKS[row.reached]) for row in rows],
    )
    head = f"""# Measured logs

What jaxid makes of recordings that others took from their machines. The page and all its figures come from

    python benchmarks/measured.py --data ../shared/data --out docs/measured.md

with the data sets in a folder beside the checkout; `benchmarks/results/measured.json` has the figures with all digits.
"Free-run fit" is 100 (1 - |measured - simulated| / |measured - mean|) of a simulation that sees the logged inputs only.
Standard errors are those that each fit reports; where unmodelled motion dominates the residual they say little.

{summary}
"""
    return head + "".join(f"\n## {section.title}\n{section.text}" for section in sections.values())


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description="Measure the recorded sets and write the page.")
    parser.add_argument("--data", type=Path, required=True, help="folder with one folder a set")
    parser.add_argument("--out", type=Path, required=True, help="the page to write")
    parser.add_argument("--sets", nargs="+", choices=list(SETS), default=list(SETS), help="sets to measure")
    arguments = parser.parse_args()
    missing = [name for name in arguments.sets if not (arguments.data / name).is_dir()]
    if missing:
        parser.error(f"{arguments.data} has no folder {missing[0]!r}; give the folder that holds the sets.")
    pictures = arguments.out.with_suffix("")
    sections = {}
    for name in arguments.sets:
        sections[name] = SETS[name].measure(arguments.data / name, pictures)
        print(f"{name}: done", flush=True)
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(_page(sections), encoding="utf-8")
    RESULTS.parent.mkdir(parents=True, exist_ok=True)
    figures = {name: section.figures for name, section in sections.items()}
    RESULTS.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
