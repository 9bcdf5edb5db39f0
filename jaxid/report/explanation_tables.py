"""Tables of an explanation: the effects, how sure their names are, the gap by channel, and the parameters that moved."""

import math

from ..estimate.result import Estimate, Fit
from ..explanation.explanation import Explanation
from ..explanation.where.localise import channel_name
from ..robots.effect import in_words
from .intervals import intervals
from .tables import DOUBT, Cell, Table, number, percent, to_text, value_cell, with_error

_MOVED = 2.0
"""Standard errors (of the fit before) beyond which a parameter's move is marked."""
_SAYS_NOTHING = 100.0
"""Width of an interval in units of the value from which it says nothing."""


def interval(estimate: Estimate) -> str:
    """The 95 % interval, "-" where there is none, or, of what is not determined, one that says nothing."""
    low, high = estimate.ci95
    open_ = estimate.status == "not_identifiable" and not high - low < _SAYS_NOTHING * abs(estimate.value)
    if open_ or math.isnan(low) or math.isnan(high):
        return "-"
    # As many digits as tell its ends apart.
    narrow = max(abs(low), abs(high)) / (high - low) if high > low else 1.0
    digits = max(3, math.ceil(math.log10(narrow)) + 1) if 0.0 < narrow < math.inf else 3
    return f"{number(low, digits)} to {number(high, digits)}"


def _unsure(fit: Fit) -> str:
    """The mark behind estimates of a fit that is to be doubted (`tables.DOUBT`)."""
    return "" if fit.trustworthy else " ?"


def effects_table(found: Explanation) -> Table:
    """Every parameter of every effect that was added; below, the formulas and by which law each is, or by which curve."""
    rows, unsure = [], _unsure(found.final)
    for effect in found.effects:
        for k, (name, e) in enumerate(effect.parameters.items()):
            doubt = "" if e.status == "identified" else f" ({in_words(e.status)})"
            value = with_error(e.value, e.std_error) + unsure if not doubt else number(e.value, 3) + doubt
            title, where = (effect.title, effect.where) if k == 0 else ("", "")
            rows.append(
                (Cell(title), Cell(where), Cell(in_words(name)), Cell(value), Cell(interval(e)), Cell(e.unit, "dim"))
            )
    laws = ((effect, f", {effect.law_in_words}" if effect.law_in_words else "") for effect in found.effects)
    formulas = tuple(f"{effect.title}: {effect.formula}{law}" for effect, law in laws)
    header = ("effect", "where", "parameter", "value ± std error", "95 % interval", "unit")
    return Table("What was added", header, tuple(rows), (*formulas, *([DOUBT] if unsure else [])))


def evidence_table(found: Explanation) -> Table:
    """What each effect does to the held-out error, and how far the next name lies behind."""
    rows = []
    for effect in found.effects:
        evidence = effect.evidence
        behind = "-" if evidence.margin is None else number(evidence.margin, 3)
        alike = ", ".join(map(in_words, effect.equivalent_to))
        rows.append(
            (
                Cell(effect.title),
                Cell(f"{evidence.before:.2f} to {evidence.after:.2f}"),
                Cell(f"{evidence.refitted} of {evidence.looked_at}"),
                Cell(in_words(evidence.runner_up) if evidence.runner_up else "-"),
                Cell(behind),
                Cell(alike or "none", "bad" if alike else ""),
            )
        )
    header = ("effect", "held-out error", "refitted", "runner-up", "behind by", "not told apart from")
    notes = (
        "Held-out error in units of the noise. Behind by: chi-squared on the fitted logs, parameters counted; two models that "
        "are equally good differ by a few.",
    )
    return Table("How sure", header, tuple(rows), notes)


def channel_table(found: Explanation) -> Table:
    """Held-out error of every channel before and after, in units of the noise."""
    units = found.model.channels.units
    after = bool(found.effects)
    rows = []
    for name, before in found.before.by_channel.items():
        noise = f"{number(found.before.noise[name], 3)} {units.get(name, '')}".strip()
        own = [Cell(number(before, 3))] + ([Cell(number(found.after.by_channel[name], 3))] if after else [])
        rows.append((Cell(channel_name(name, found.model.words)), *own, Cell("1", "dim"), Cell(noise, "dim")))
    total = [Cell(number(found.before.normalised_rms, 3))]
    total += [Cell(number(found.after.normalised_rms, 3))] if after else []
    rows.append((Cell("all"), *total, Cell("1", "dim"), Cell("")))
    header = ("channel", *(("before", "after") if after else ("error",)), "noise floor", "one unit of noise is")
    notes = ("The noise is what neighbouring samples show; coloured noise is larger, so that its floor is above 1.",)
    coloured = found.colour is not None and found.colour.only_noise
    return Table("Error on held-out logs, in units of the noise (RMS)", header, tuple(rows), notes if coloured else ())


def _told(e: Estimate) -> str:
    """An estimate with its standard error; that of a parameter which the logs do not determine says so."""
    return value_cell(e).text if e.status == "not_identifiable" else with_error(e.value, e.std_error)


def moved_table(found: Explanation, drawn: bool = False) -> Table:
    """The robot's own parameters before and after, and how far each moved; `drawn`: with what they mean and their intervals."""
    rows = []
    table = found.model.parameters
    for name, (before, after) in found.moved.items():
        open_ = "not_identifiable" in (before.status, after.status)  # such a value is one of many
        step = math.nan if open_ else after.value - before.value
        relative = percent(100.0 * step / abs(before.value)) if before.value else "-"
        errors = abs(step) / before.std_error if 0 < before.std_error < math.inf else math.nan
        mark = "bad" if errors > _MOVED else ""
        rows.append(
            (
                Cell(name, detail=table[name].meaning if drawn and name in table else ""),
                Cell(after.unit, "words"),
                Cell(_told(before) + _unsure(found.baseline), "value"),
                Cell(_told(after) + _unsure(found.final), "value"),
                Cell(relative, f"{mark} value".strip()),
                Cell("-" if math.isnan(errors) else f"{errors:.1f}", mark),
                *([intervals(name, {"before": before, "after": after}, ("before", "after"))] if drawn else ()),
            )
        )
    header = ("parameter", "unit", "before", "after", "moved", "in std errors", *(("95 % intervals",) if drawn else ()))
    notes = ("In std errors: of the fit before, which could not know of its own bias.",)
    notes += (DOUBT,) if _unsure(found.baseline) or _unsure(found.final) else ()
    return Table("How the robot's own parameters moved", header, tuple(rows), notes)


def tables(found: Explanation) -> tuple[Table, ...]:
    """The tables that apply."""
    if not found.effects:
        return (channel_table(found),)
    return effects_table(found), evidence_table(found), channel_table(found), moved_table(found)


def text(found: Explanation) -> str:
    """The explanation for a terminal: the verdict, where the gap is, the tables, what to do next."""
    paragraphs = [found.sentence, *found.notes]
    if found.localisation is not None:
        paragraphs.append(found.localisation.sentence)
    if found.next_experiment is not None:
        paragraphs.append(f"Next: {found.next_experiment.sentence}")
    return to_text(tables(found), paragraphs)
