"""docs/effects.md is what the catalogue says of itself; `python tests/test_effects_page.py` writes it anew."""

import importlib
import re
from pathlib import Path

from jaxid import Axis, DifferentialDrive, Omni, Pioneer
from jaxid.effects.catalogue import MECHANISMS
from jaxid.robots.effect import Effect, in_words
from jaxid.robots.traits import refusal

PAGE = Path(__file__).parents[1] / "docs/effects.md"
MARK = "<!-- mechanisms -->\n"
ROBOTS = (Pioneer(), Omni(), Axis(), DifferentialDrive())


def source(effect: Effect) -> str:
    """The first paragraph of the effect's module: what it is, and where its laws are from."""
    text = importlib.import_module(type(effect).__module__).__doc__ or ""
    return " ".join(text.split("\n\n")[0].split())


def who(law: Effect) -> str:
    """Which built-in robots can have a law, and which have it already in numbers of their own."""
    can = [robot.name for robot in ROBOTS if refusal(law, robot) is None and law.id not in robot.expressed]
    if law.id == "coulomb_friction":
        return "none; yours without dry friction"
    if law.id == "sideways_friction":
        return "none; yours that moves sideways on wheels that rub alike"
    if "steered" in law.needs:
        return "none; yours with an input that does not drive"
    return "all" if len(can) == len(ROBOTS) else ", ".join(can) or "none"


def section(laws: tuple[Effect, ...]) -> str:
    """One mechanism: its place, what it is, a row for each law."""
    first = laws[0]
    title = in_words(first.id)
    title = f"{title[0].upper()}{title[1:]}"
    rows = [f"### {title} (`{first.id}`)\n", f"{source(first)}\n"]
    rows.append(f"![{title}: the motion with and without it, and what is missing without it](effects/{first.id}.svg)\n")
    rows += ["| law | formula | built-in robots that can have it |", "| --- | --- | --- |"]
    for law in laws:
        formula = law.formula.replace("|", "\\|")
        rows.append(f"| {f'`{law.law}`' if law.law else '(its only one)'} | `{formula}` | {who(law)} |")
    return "\n".join(rows) + "\n"


def mechanisms() -> str:
    """All mechanisms, by where they act."""
    places = dict.fromkeys(laws[0].where for laws in MECHANISMS)
    parts = []
    for place in places:
        own = [section(laws) for laws in MECHANISMS if laws[0].where == place]
        parts.append(f"## {place[0].upper()}{place[1:]}\n\n" + "\n".join(own))
    return "\n".join(parts)


def page() -> str:
    """The page, its part below the mark written anew."""
    return PAGE.read_text(encoding="utf-8").split(MARK)[0] + MARK + mechanisms()


def test_the_page_has_every_mechanism_and_law():
    assert PAGE.read_text(encoding="utf-8") == page()


def test_every_mechanism_has_a_light_picture():
    pictures = {path.stem: path.stat().st_size for path in (PAGE.parent / "effects").iterdir()}
    assert set(pictures) == {laws[0].id for laws in MECHANISMS}
    assert max(pictures.values()) < 40_000


def test_every_mechanism_says_what_it_is_and_is_somebody_s():
    for laws in MECHANISMS:
        assert source(laws[0]).endswith((".", ").")), laws[0].id
        assert any(who(law) != "none" for law in laws), laws[0].id
        names = [law.law for law in laws]
        assert len(set(names)) == len(names) and all(re.fullmatch(r"[a-z_]*", name) for name in names)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
