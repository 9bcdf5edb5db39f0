"""The table of traits in docs/robots.md is what the robots and effects say."""

import re
from pathlib import Path

from jaxid import Axis, DifferentialDrive, Omni, Pioneer
from jaxid.effects.catalogue import ALL
from jaxid.robots.traits import TRAITS, asked

PAGE = Path(__file__).parents[1] / "docs/robots.md"


def table() -> str:
    robots = (Pioneer(), Omni(), Axis(), DifferentialDrive())
    rows = ["| trait | it says | effects that need it | " + " | ".join(r.name for r in robots) + " |"]
    rows.append("| --- " * (3 + len(robots)) + "|")
    for trait, said in TRAITS.items():
        needing = [effect.id for effect in ALL if trait in asked(effect)]
        if trait == "mechanism":
            there = [", ".join(sorted(robot.mechanisms)) or "no" for robot in robots]
        else:
            there = ["yes" if trait in robot.traits else "no" for robot in robots]
        rows.append(f"| `{trait}` | {said} | {', '.join(needing) or '-'} | {' | '.join(there)} |")
    anyone = [effect.id for effect in ALL if not asked(effect)]
    return "\n".join(rows) + f"\n\nAny robot can have: {', '.join(anyone)}.\n"


def test_the_page_has_the_table_of_traits():
    assert PAGE.read_text().endswith("<!-- traits -->\n" + table())


def test_nothing_outside_the_robots_asks_which_robot_it_is():
    """Their class or name is asked for by robots themselves, and by the papers' own wing."""
    package = Path(__file__).parents[1] / "jaxid"
    switch = re.compile(
        r"isinstance\([^)]*\b(Pioneer|Omni|Axis|Custom|DifferentialDrive)\b|robot\.name (==|!=|in|not in) ['\"({]"
    )
    found = []
    for path in package.rglob("*.py"):
        place = path.relative_to(package)
        if place.parts[0] not in ("robots", "papers"):
            found += [f"{place}: {line.strip()}" for line in path.read_text().splitlines() if switch.search(line)]
    assert not found, found
