"""docs/symbols.md is what the built-in robots' tables and channels say. `python tests/test_symbols_page.py` writes it."""

from pathlib import Path

from jaxid import Axis, DifferentialDrive, Omni, Pioneer, Robot

PAGE = Path(__file__).parents[1] / "docs/symbols.md"
MARK = "<!-- symbols -->\n"
ROBOTS = (Pioneer(), Omni(), DifferentialDrive(), Axis())


def cell(text: str) -> str:
    return text.replace("|", "\\|") or "-"


def section(robot: Robot) -> str:
    """One robot: its channels, then its parameters."""
    channels = robot.channels
    rows = [f"## {robot.name}\n", "| column | unit | it is |", "| --- | --- | --- |"]
    for kind, names in (
        ("command", channels.inputs),
        ("measured", channels.outputs),
        ("may be missing", channels.optional),
    ):
        for name in names:
            words = robot.words.get(name, "")
            rows.append(f"| `{name}` | {cell(channels.units.get(name, ''))} | {kind}{': ' + words if words else ''} |")
    rows += [
        "",
        "| symbol | unit | it stands for | default | estimated | from |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, p in robot.parameters.items():
        free = "yes" if p.free else "no"
        rows.append(f"| `{name}` | {cell(p.unit)} | {cell(p.meaning)} | {p.value:.7g} | {free} | {cell(p.source)} |")
    for name, (_, unit, meaning) in robot.combinations.items():
        rows.append(f"| `{name}` | {cell(unit)} | {cell(meaning)} | - | by what it is made of | - |")
    return "\n".join(rows) + "\n"


def symbols() -> str:
    return "\n".join(section(robot) for robot in ROBOTS)


def test_the_page_has_every_symbol_of_every_robot():
    assert PAGE.read_text(encoding="utf-8").endswith(MARK + symbols())


def test_every_symbol_says_what_it_stands_for():
    silent = [f"{robot.name}: {name}" for robot in ROBOTS for name, p in robot.parameters.items() if not p.meaning]
    assert not silent


if __name__ == "__main__":
    PAGE.write_text(PAGE.read_text(encoding="utf-8").split(MARK)[0] + MARK + symbols(), encoding="utf-8")
