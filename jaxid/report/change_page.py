"""The page of a change between two sets of logs: what changed and by how much, how sure that is, and what would have shown."""

import math

import numpy as np

from ..explanation.changes.change import POWER, ExplainedChange, NamedChange
from ..parameters import ParameterTable
from .comparison_page import parameter_table, verdict_of
from .document import Bar, Bars, Block, Code, Listing, More, Page, Section, Tabled, Text, Tone, texts
from .spoken_robot import spoken
from .tables import Cell, Table, number, percent, value_cell

_VERDICTS: dict[str, tuple[str, Tone]] = {
    "unchanged": ("Nothing changed", "good"),
    "named": ("Named", "good"),
    "ambiguous": ("Named, but open", "open"),
    "unexplained": ("Unexplained", "bad"),
}
_CANDIDATES, _NOTICEABLE = 12, 12
"""Candidates and smallest noticeable changes that are shown."""


def _differences(change: NamedChange, table: ParameterTable) -> Table:
    """What one change changes, before and after, and by how much."""
    rows = []
    for name, own in change.differences.items():
        low, high = own.size.ci95
        interval = f"{number(low, 3)} to {number(high, 3)}" if math.isfinite(own.size.std_error) else "none"
        size = value_cell(own.size)
        cells = (
            _name(name, change.words_of(name), table),
            Cell(own.size.unit, "words"),
            Cell(_number(own.before)),
            Cell(_number(own.after)),
        )
        rows.append(
            (*cells, Cell(size.text, f"{size.mark} value".strip()), Cell(interval, "value"), Cell(_share(own.share)))
        )
    header = ("", "unit", "before", "after", "difference", "95 % interval", "of what there was")
    return Table(f"{change.words[0].upper()}{change.words[1:]}", header, tuple(rows), ("± is one standard error.",))


def _name(name: str, words: str, table: ParameterTable) -> Cell:
    """A parameter with what it means, or what else may change, in words."""
    if words == name and name in table:
        return Cell(name, detail=table[name].meaning)
    return Cell(f"{words[:1].upper()}{words[1:]}")


def _number(value: float) -> str:
    return number(value) if value else "0"


def _share(share: float) -> str:
    return percent(100.0 * share) if math.isfinite(share) else "-"


def _what(found: ExplainedChange) -> Section | None:
    if found.change is None:
        return None
    table = found.before.robot.parameters
    blocks: list[Block] = [Tabled(_differences(found.change, table))]
    if found.equivalent:
        blocks.append(Text("These would explain the two sets as well, and these logs cannot tell them apart:"))
        blocks += [Tabled(_differences(own, table)) for own in found.equivalent]
    return Section("What?", tuple(blocks))


def _errors(found: ExplainedChange) -> Bars:
    """The error of one model for both sets, of that with the change, and of two models."""
    rows = [("one model for both sets", found.rms_unchanged, "before")]
    if found.change is not None:
        rows.append((f"with {found.change.title}", found.change.rms, "after"))
    rows.append(("two models", found.rms_separate, ""))
    top = max([value for _, value, _ in rows if math.isfinite(value)], default=1.0)
    bars = tuple(Bar(name, 100.0 * min(value, top) / top, f"{value:.3g}", colour) for name, value, colour in rows)
    return Bars("", bars, "Error on all logs of both sets (RMS), in units of the whitened noise.")


def _chance(p: float) -> str:
    return f"p = {p:.1g}" if p >= 1e-4 else "p < 0.0001"


def _headline(found: ExplainedChange) -> str:
    """The verdict without the sizes, which stand in a table."""
    change = found.change
    if found.verdict == "unchanged" or change is None:
        return found.sentence if found.verdict == "unchanged" else "Something changed that nothing here explains."
    fall = (
        f"the error of one model for both sets falls from {found.rms_unchanged:.3g} to {change.rms:.3g} times the noise"
    )
    if found.verdict == "unexplained":
        return f"Something changed that no single thing explains; nearest comes {change.title}: with it {fall}."
    others = " or ".join(own.words for own in found.equivalent)
    told = f" These logs cannot tell it from {others}." if others else ""
    return f"Changed: {change.words}; {fall}.{told}"


def _sure(found: ExplainedChange) -> Section:
    p = f"of {found.p_value:.2g}" if found.p_value >= 1e-4 else "below 1 in 10,000"
    said = [
        f"If nothing had changed, two sets this different would come up with a probability {p}, all candidates accounted for. "
        f"A change is spoken of below {found.false_alarm:g}."
    ]
    if math.isfinite(found.held_out_gain):
        better = "better" if found.held_out_gain > 0 else "worse"
        said.append(
            f"Held-out logs are predicted {better} with the change: chi-squared falls by {found.held_out_gain:.3g}."
        )
    blocks: list[Block] = list(texts(said))
    if found.doubts:
        blocks += [Text("It is not the answer, since"), Listing(tuple(found.doubts))]
    looked = found.distinct[:_CANDIDATES]
    top = max([own.gain for own in looked], default=0.0)
    if top > 0:
        named = [] if found.change is None else [found.change, *found.change.parts]
        chosen = {own.id: "alike" for other in found.equivalent for own in (other, *other.parts)}
        chosen |= {own.id: "after" for own in named}
        rows = tuple(
            Bar(own.title, 100.0 * max(own.gain, 0.0) / top, f"{own.gain:,.0f}, {_chance(own.p_value)}",
                chosen.get(own.id, ""), chosen.get(own.id) == "after")
            for own in looked
        )  # fmt: skip
        note = "The drop of chi-squared that each promised before anything was refitted, and its probability by chance, alone."
        note += " Light green: these logs cannot tell it from that." if found.equivalent else ""
        blocks.append(More("First look at all candidates", (Bars("", rows, note),)))
    return Section("How sure?", tuple(blocks))


def _seen(found: ExplainedChange) -> Section:
    """What would have shown, and what would not."""
    blocks: list[Block] = []
    table = found.before.robot.parameters
    if found.noticeable:
        rows = tuple(
            (_name(own.name, own.words, table), Cell(own.unit, "words"),
             Cell("-" if own.is_share else _number(own.value)), Cell("-" if own.is_share else number(own.size, 2)),
             Cell(_share(own.size if own.is_share else own.size / abs(own.value)).lstrip("+")
                  if own.is_share or own.value else "-"))
            for own in found.noticeable[:_NOTICEABLE]
        )  # fmt: skip
        header = ("", "unit", "is", "noticed from", "of what there is")
        note = (
            f"The smallest change of each, on its own, that would have shown with a probability of {100 * POWER:.0f} %."
        )
        blocks.append(Tabled(Table("", header, rows, (note,))))
    if found.unseen:
        blocks.append(Text(f"Not shown at all by these logs: {', '.join(found.unseen)}."))
    return Section(
        "What would have shown?", tuple(blocks or [Text("Nothing that a candidate changes shows in these logs.")])
    )


def _fits(found: ExplainedChange) -> Section:
    fits = {"before": found.before, "after": found.after}
    said = [f"{name.capitalize()}: {fit.judgement.sentence}" for name, fit in fits.items() if fit.judgement]
    names = tuple(dict.fromkeys(name for fit in fits.values() for name in (*fit.free_names, *fit.combinations)))
    tables = (Tabled(parameter_table(fits, names, {}, "published")),)
    return Section("Each set on its own", (Listing(tuple(said)), More("Parameters of both fits", tables)))


def _next(found: ExplainedChange) -> tuple[Block, ...]:
    name = spoken(found.before.robot.name)
    if any(verdict_of(fit)[1] == "bad" for fit in (found.before, found.after)):
        lead = "The model lacks something in a set on its own; find that first, since it may pass for a change:"
        return Text(lead), Code(f"jaxid explain {name} --fit LOGS --held-out OTHER_LOGS --out explained")
    if found.verdict == "unchanged":
        return (Text("Go on with one model for both sets. What could have changed unnoticed stands above."),)
    if found.verdict == "named":
        return (Text("Look at the robot for that; a third set of logs after the repair shows whether it is gone."),)
    if found.verdict == "ambiguous":
        return (
            Text("Record the same again with a load, a speed or a floor that tells these apart, before and after."),
        )
    lead = "Each set alone says what its model lacks; several things may have changed at once:"
    return Text(lead), Code(f"jaxid explain {name} --fit LOGS --held-out OTHER_LOGS --out explained")


def change_page(found: ExplainedChange) -> Page:
    """The whole page as data."""
    verdict, tone = _VERDICTS[found.verdict]
    finite = np.isfinite([found.rms_unchanged, found.rms_separate]).all()
    sections = (_what(found), _sure(found), _seen(found), _fits(found))
    return Page(
        title=f"jaxid change {found.before.robot.name}",
        kind=f"jaxid change: {found.before.robot.name}, before and after",
        verdict=verdict,
        tone=tone,
        headline=_headline(found),
        lead=(
            *texts([found.unsound] if found.unsound else []),
            *texts(found.notes),
            *([_errors(found)] if finite else []),
        ),
        sections=tuple(section for section in sections if section is not None),
        next=_next(found),
    )
